"""The registry of engines: which are announced, which of them are installed, and loading one by name.

Engines are found by the entry-point group ``velodrome.engines`` alone; see `velodrome.engines.engine.Engine`.
"""

from __future__ import annotations

import re
import reprlib
from importlib.metadata import EntryPoint
from typing import cast

from packaging.utils import canonicalize_name

from .announcements import list_entry_points
from .engine import REFERENCE, why_failed
from .format_version import VERSION_KEY
from .guard import GuardedEngine, call_engine, where_raised
from .libraries import install_command, list_extra_packages, list_missing
from .names import suggest_name
from .releases import find_reach

ENTRY_POINT_GROUP = "velodrome.engines"
_FACTS = ("name", "version", "gives", "settings")
_MEMBERS = (*_FACTS, "check", "step_noise", "simulate")

# Keys in documents whose other keys are names of engines; engines with these names are ignored.
RESERVED_NAMES = (VERSION_KEY, "sha256")
# Files are named after engines, so that a name must not be a path.
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")


def _find_entry_points() -> dict[str, EntryPoint]:
    """Return the entry points of engines by name, without those whose names are not permitted.

    Raises
    ------
    ValueError
        If two packages announce the same name, since which of them is loaded would depend on the order of the path.
    """
    found: dict[str, EntryPoint] = {}
    for point in list_entry_points(ENTRY_POINT_GROUP):
        if not _NAME.fullmatch(point.name) or point.name in RESERVED_NAMES:
            continue
        other = found.setdefault(point.name, point)
        # The same package may be on the path twice, e.g. with an editable install.
        if other is not point and _distribution(other) != _distribution(point):
            raise ValueError(
                f"engine {point.name!r} is announced by two packages, {_distribution(other)} and "
                f"{_distribution(point)}; uninstall one of them"
            )
    return found


def _distribution(point: EntryPoint) -> str:
    """Return the normalised name of the distribution that announces an entry point."""
    return point.value if point.dist is None else re.sub(r"[-_.]+", "-", point.dist.name).lower()


def engine_names() -> list[str]:
    """Return the names of all installed engines, the reference first.

    Engines that are announced but whose library is not installed are not among them, see `uninstalled_engines`.

    Raises
    ------
    ValueError
        If two packages announce engines with the same name.
    """
    there = (name for name, point in _find_entry_points().items() if not list_missing(point))
    return sorted(there, key=lambda name: (name != REFERENCE, name))


def default_engines() -> list[str]:
    """Return the names of the engines that ride where none is named, the reference first.

    They are those of the suite's own dependencies. Engines of an extra and of other packages ride when they are chosen.
    """
    points = _find_entry_points()
    own = _distribution(points[REFERENCE]) if REFERENCE in points else None
    return [name for name in engine_names() if not points[name].extras and _distribution(points[name]) == own]


def uninstalled_engines() -> dict[str, str]:
    """Return the announced engines whose library is not installed, with the command that installs it, by name."""
    points = sorted(_find_entry_points().items())
    return {name: install_command(point) for name, point in points if list_missing(point)}


def load_engine(name: str, any_release: bool = False) -> GuardedEngine:
    """Load an engine by name.

    Parameters
    ----------
    name : str
    any_release : bool
        Whether an engine that declares a `LibraryReach` is loaded with releases of its library that its extra excludes
        as well; its ``check`` refuses those with which it cannot ride.

    Raises
    ------
    ValueError
        If no engine with that name is installed, its library is missing, the announced object is not an engine, or two
        packages announce engines with the same name.
    """
    points = _find_entry_points()
    if name not in points:
        raise ValueError(f"engine {name!r} is not installed ({suggest_name(name, engine_names())})")
    missing = list_missing(points[name])
    if any_release and missing and not list_missing(points[name], any_release=True):
        engine = _read_engine(points[name], _MEMBERS)
        if find_reach(engine) is not None:
            return engine
    if missing:
        raise ValueError(
            f"engine {name!r} needs {' and '.join(missing)}, not installed; install: {install_command(points[name])}"
        )
    return _read_engine(points[name], _MEMBERS)


def preview_engine(name: str) -> GuardedEngine:
    """Load an announced engine whose library may be missing, to read its settings and what it says of itself.

    Returns
    -------
    GuardedEngine
        Without its library it has an empty version and cannot ride.

    Raises
    ------
    ValueError
        If no such engine is announced, or its code cannot be loaded without its library.
    """
    points = _find_entry_points()
    if name in points and list_missing(points[name]):
        return _read_engine(points[name], tuple(member for member in _MEMBERS if member != "version"))
    return load_engine(name)


def _read_engine(point: EntryPoint, required: tuple[str, ...]) -> GuardedEngine:
    """Load the engine of an entry point, which must have the required members."""
    name, where = point.name, f"engine {point.name!r}, announced as {point.value},"
    engine = None
    try:
        engine = call_engine(point.load)
        members = {member: call_engine(getattr, engine, member) for member in required}
    except Exception as error:  # another package's code may break in any way
        if isinstance(error, AttributeError) and error.obj is engine and where_raised(error) is None:
            raise ValueError(f"{where} is no engine: it has no {error.name}") from error
        raise ValueError(f"{where} cannot be loaded: {why_failed(error)}") from error
    if members["name"] != name:
        raise ValueError(f"{where} calls itself {members['name']!r}; both names must be the same")
    takes = call_engine(getattr, engine, "takes_inputs", False)
    if not isinstance(takes, bool):
        raise ValueError(f"{where} has takes_inputs = {reprlib.repr(takes)}; it must be True or False")
    facts = {fact: members.get(fact, "") for fact in _FACTS}
    return GuardedEngine(engine, **facts, takes_inputs=takes)


def find_announcement(name: str) -> EntryPoint:
    """Return the entry point that announces an engine.

    Raises
    ------
    KeyError
        If no engine with that name is announced.
    """
    return _find_entry_points()[name]


def package_of(name: str) -> str | None:
    """Return the name of the distribution that announces an engine, or None if it is unknown.

    Raises
    ------
    KeyError
        If no engine with that name is announced.
    """
    distribution = _find_entry_points()[name].dist
    return None if distribution is None else distribution.name


def packages() -> dict[str, str]:
    """Return the versions of the packages that announce engines, by name of the package."""
    found = (point.dist for point in _find_entry_points().values())
    return {dist.name: dist.version for dist in found if dist is not None}


def list_library_packages(name: str) -> tuple[str, ...]:
    """Return the packages whose releases an installed engine rides in, by their canonical names.

    They are its ``packages``; without that attribute, what the extra of its entry point needs, or the package that
    announces it.

    Raises
    ------
    ValueError
        If the engine cannot be loaded.
    """
    engine = load_engine(name)
    own: object = getattr(engine.inner, "packages", None)
    if isinstance(own, tuple):
        return tuple(canonicalize_name(str(package)) for package in cast("tuple[object, ...]", own))
    point = _find_entry_points()[name]
    return tuple(list_extra_packages(point)) if point.extras else (_distribution(point),)
