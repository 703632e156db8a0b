"""The code that adapts a library to the suite: of engines of other packages, it is not part of the suite's own."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from packaging.utils import canonicalize_name

from ...engines.engine import REFERENCE
from ...engines.registry import find_announcement, package_of
from ..files import digest_named_files


@cache
def digest_adapter(engine: str, package: str) -> str | None:
    """Return the SHA-256 of the files of the package that announces an engine.

    They are found by the modules of the package, so that those of an editable install count as they are now.

    Parameters
    ----------
    engine : str
    package : str
        Canonical name of the package whose releases ride.

    Returns
    -------
    str or None
        None where the engine comes with the releases themselves, or with the suite, whose digest covers it.
    """
    announced_by = package_of(engine)
    if announced_by is None or canonicalize_name(announced_by) in (package, package_of(REFERENCE)):
        return None
    return digest_named_files(sorted(_list_files(engine)))


def _list_files(engine: str) -> Iterator[tuple[str, Path]]:
    """Yield the files of an adapter's modules with their names below the folder of the modules."""
    point = find_announcement(engine)
    tops = {point.module.partition(".")[0]}
    for file in (point.dist.files if point.dist is not None else None) or []:
        top, _, inside = str(file).partition("/")
        if top.endswith((".dist-info", ".egg-info")) or top in ("..", "__pycache__"):
            continue
        if inside or top.endswith(".py"):
            tops.add(top.removesuffix(".py"))
    for top in tops:
        for place in _find_places(top):
            paths = [place] if place.is_file() else (path for path in place.rglob("*") if path.is_file())
            for path in paths:
                if "__pycache__" not in path.parts:
                    yield str(path.relative_to(place.parent)), path


def _find_places(top: str) -> list[Path]:
    """Return the file of a module, or the folders of a package; none where there is no such module."""
    spec = find_spec(top)
    if spec is None:
        return []
    if spec.submodule_search_locations is not None:
        return [Path(place).resolve() for place in spec.submodule_search_locations]
    return [] if spec.origin is None else [Path(spec.origin).resolve()]
