"""A release's environment laid over this process's, and the check that nothing else of its packages was loaded."""

from __future__ import annotations

import importlib
import os
import re
import site
import sys
from collections.abc import Iterator, Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from types import ModuleType

from packaging.version import Version

from .requirements import list_regular_modules, list_top_modules

_MAPS = Path("/proc/self/maps")
_SEARCHED_FIRST = "LD_LIBRARY_PATH"  # folders in which the system looks before those that a library names itself
_PRELOADED = "LD_PRELOAD"


class WrongRelease(RuntimeError):
    """Raised if the package that was loaded is not the release that was asked for."""


def lay_over(folder: Path) -> list[Path]:
    """Put a release's environment first on Python's path, with the folders that path files add of it.

    A path file of the suite's environment may have added some already, behind its own: packages of cmeel, such as
    Pinocchio's, lie in a folder of every folder of the path.

    Returns
    -------
    list of Path
        The folders of the environment that are on the path, itself first.
    """
    inside = [entry for entry in sys.path if entry and Path(entry).is_relative_to(folder)]
    known = [entry for entry in sys.path if entry not in inside]
    sys.path[:] = known
    site.addsitedir(str(folder))  # a folder of PYTHONPATH alone would not have its path files read
    added = [entry for entry in sys.path if entry not in known]
    own = list(dict.fromkeys([str(folder), *added, *inside]))
    sys.path[:] = [*own, *known]
    importlib.invalidate_caches()
    folders = [Path(entry) for entry in own]
    sys.meta_path.insert(0, _OwnModulesOnly(folders))
    return folders


class _OwnModulesOnly(MetaPathFinder):
    """Find the modules of a release's packages in its environment alone.

    A package may extend its path to others of its name, and would then load modules of the suite's installed release.
    The other way round, a release may be a part of another package, as ``mujoco.mjx`` is: what it has of that is found
    in its environment first.

    Parameters
    ----------
    own : list of Path
        Folders of the environment on the path.
    """

    def __init__(self, own: list[Path]) -> None:
        self._own = own
        there = [folder for folder in own if folder.is_dir()]
        self._tops = {top for folder in there for top in list_regular_modules(folder)}
        self._shared = {top for folder in there for top in list_top_modules(folder)} - self._tops

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return the specification of a module of the environment; None for all other modules.

        Raises
        ------
        ModuleNotFoundError
            If the environment does not have the module, but it has the package.
        """
        top = fullname.partition(".")[0]
        if top in self._shared:
            return self._find_shared(fullname, target)
        if top not in self._tops:
            return None
        places = (
            [str(folder) for folder in self._own]
            if path is None
            else [entry for entry in path if any(Path(entry).is_relative_to(folder) for folder in self._own)]
        )
        found = PathFinder.find_spec(fullname, places, target)
        if found is None:
            raise ModuleNotFoundError(f"No module named {fullname!r} in the release", name=fullname)
        return found

    def _find_shared(self, fullname: str, target: ModuleType | None) -> ModuleSpec | None:
        """Return the specification of a module that the environment has of a package that others share."""
        *parents, _ = fullname.split(".")
        found = PathFinder.find_spec(fullname, [str(folder.joinpath(*parents)) for folder in self._own], target)
        return found if found is not None and found.loader is not None and found.origin is not None else None


def require_release(folder: Path, package: str, version: str) -> None:
    """Make sure that a package's metadata are those of the release in the folder.

    Raises
    ------
    WrongRelease
        If they are not.
    """
    try:
        found = distribution(package)
    except PackageNotFoundError as error:
        raise WrongRelease(f"{package} is not in its environment") from error
    where = Path(str(found.locate_file(""))).resolve()
    if where != folder.resolve() or Version(found.version) != Version(version):
        raise WrongRelease(f"{package} {version} was asked for, and {found.version} in {where} is found")


def require_loaded_from(own: list[Path]) -> None:
    """Make sure that modules of the laid-over packages come from their environment, compiled libraries too.

    Of a namespace package, which several packages may share, only what the environment has must come from there. The
    system's variables for its linker may put other libraries in the place of the environment's, and are not changed,
    since Python itself may need them.

    Parameters
    ----------
    own : list of Path
        The folders of the environment on the path, as `lay_over` returns them.

    Raises
    ------
    WrongRelease
        If a module or a compiled library of the same name comes from elsewhere, or nothing of them is loaded.
    """
    there = [folder for folder in own if folder.is_dir()]
    tops = {top for folder in there for top in list_top_modules(folder)}
    regular = {top for folder in there for top in list_regular_modules(folder)}
    loaded = 0
    for name, module in list(sys.modules.items()):
        top = name.partition(".")[0]
        if top not in tops or (top not in regular and not _has_module(there, name)):
            continue
        places = _find_places(module)
        if places and not any(place.is_relative_to(folder.resolve()) for place in places for folder in own):
            raise WrongRelease(f"module {name} was loaded from {places[0]}, not from the release's environment")
        loaded += bool(places)
    if not loaded:
        raise WrongRelease("the engine loaded nothing of the release, so that the ride says nothing about it")
    mapped = _list_mapped_files()
    for name, path in _list_replacements(there):
        if path in mapped:
            raise WrongRelease(
                f"{path}, of {_SEARCHED_FIRST} or {_PRELOADED}, was loaded instead of the release's {name}"
            )
    elsewhere = [Path(entry).resolve() for entry in sys.path if Path(entry) not in own]
    for path in mapped:
        for other in elsewhere:
            if not path.is_relative_to(other):
                continue
            inside = path.relative_to(other)
            top = path.name if path == other else inside.parts[0]
            shared = any((folder / inside).exists() for folder in there)
            if {top, top.partition(".")[0]} & regular or (top in tops and shared):
                raise WrongRelease(f"{path} was loaded, which is not of the release's environment")


def _has_module(folders: list[Path], name: str) -> bool:
    """Whether a module of a namespace package, which several packages may share, lies in one of these folders."""
    *parents, last = name.split(".")
    return any(
        entry.name.partition(".")[0] == last
        for folder in folders
        if folder.joinpath(*parents).is_dir()
        for entry in folder.joinpath(*parents).iterdir()
        # A folder without a module of its own is no more than a place that is shared as well.
        if (any(entry.glob("__init__.*")) if entry.is_dir() else entry.suffix in (".py", ".so", ".pyd"))
    )


def _list_replacements(folders: list[Path]) -> Iterator[tuple[str, Path]]:
    """Yield the names of an environment's compiled libraries for which the linker finds other files first."""
    preloaded = [Path(entry) for entry in re.split("[ :]", os.environ.get(_PRELOADED, "")) if entry]
    searched = [Path(entry) for entry in re.split("[:;]", os.environ.get(_SEARCHED_FIRST, "")) if entry]
    if not preloaded and not searched:
        return
    for library in {path for folder in folders for path in folder.rglob("*.so*") if path.is_file()}:
        others = [folder / library.name for folder in searched]
        others += [path for path in preloaded if path.name == library.name]
        for other in others:
            if other.is_file() and not any(other.resolve().is_relative_to(folder.resolve()) for folder in folders):
                yield library.name, other.resolve()


def _find_places(module: ModuleType) -> list[Path]:
    file = getattr(module, "__file__", None)
    places = [file] if isinstance(file, str) else list(getattr(module, "__path__", None) or [])
    return [Path(place).resolve() for place in places]


def _list_mapped_files() -> set[Path]:
    """Return the files that are mapped into this process, compiled libraries among them; none on other systems."""
    if not _MAPS.exists():
        return set()
    fields = (line.split(maxsplit=5) for line in _MAPS.read_text(errors="replace").splitlines())
    return {Path(field[5]) for field in fields if len(field) == 6 and field[5].startswith("/")}
