"""Modules of a release's environment that would take the place of the suite's own."""

from __future__ import annotations

import sys
from functools import cache
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from .requirements import RequirementConflict, find_suite_packages, list_regular_modules, list_top_modules

_SUITE = "velodrome"
# Some packages install their tests by mistake, as a module of the same name as Python's own tests, which nobody loads.
_HARMLESS = frozenset({"test"})


def refuse_replaced_modules(folder: Path, package: str) -> None:
    """Make sure that packages in a folder replace no module with which the suite computes and compares.

    Parameters
    ----------
    folder : Path
    package : str
        Canonical name of the package whose release the folder holds.

    Raises
    ------
    RequirementConflict
        If they do: the release's figures would be measured by other code than those of other releases.
    """
    regular = list_regular_modules(folder)
    owners = _list_suite_files(package)
    replaced = {}
    for top in sorted(list_top_modules(folder) - _HARMLESS):
        if top in sys.stdlib_module_names:
            replaced[top] = "Python's standard library"
        elif top in owners:
            owner, files = owners[top]
            # Of a namespace package, which several packages may share, only the same files are a replacement.
            if top in regular or any((folder / file).is_file() for file in files):
                replaced[top] = f"{owner}, with which the suite computes"
    if replaced:
        told = "; ".join(f"{top} (of {owner})" for top, owner in replaced.items())
        raise RequirementConflict(f"it brings modules that would replace the suite's: {told}")


@cache
def _list_suite_files(package: str) -> dict[str, tuple[str, list[str]]]:
    """Return, by top module, one of the suite's packages that has it, and that package's files below it."""
    found: dict[str, tuple[str, list[str]]] = {_SUITE: (_SUITE, [])}
    for name in sorted(find_suite_packages(package)):
        try:
            files = distribution(name).files or []
        except PackageNotFoundError:
            continue
        for file in files:
            top = file.parts[0]
            if top in ("..", "__pycache__") or top.endswith((".dist-info", ".pth")) or "__pycache__" in file.parts:
                continue
            if len(file.parts) == 1:
                top = top.partition(".")[0]
            found.setdefault(top, (name, []))[1].append(str(file))
    return found
