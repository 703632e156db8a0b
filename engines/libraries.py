"""The libraries that an announced engine needs, and the command that installs them.

An entry point names the extra of its package whose requirements are the engine's library, for example
``drake-native = "velodrome.engines.drake.engine:NATIVE [drake]"``. Without an extra, an engine needs what its package
needs anyway.
"""

from __future__ import annotations

from functools import cache
from importlib.metadata import EntryPoint, PackageNotFoundError, version

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name


def list_missing(point: EntryPoint, any_release: bool = False) -> list[str]:
    """Return the requirements of an engine's extras that are not installed, or only in an unsuitable version.

    Parameters
    ----------
    point : EntryPoint
    any_release : bool
        Whether every installed version counts as suitable.

    Returns
    -------
    list of str
        Requirements without their conditions, such as ``mujoco-mjx>=3.17``.
    """
    if not point.extras or point.dist is None:
        return []
    needed = _list_extra_requirements(point)
    return [f"{found.name}{found.specifier}" for found in needed if not _is_installed(found, any_release)]


def list_extra_packages(point: EntryPoint) -> list[str]:
    """Return the canonical names of the packages that an engine's extras need."""
    return [canonicalize_name(found.name) for found in _list_extra_requirements(point)]


def _list_extra_requirements(point: EntryPoint) -> tuple[Requirement, ...]:
    lines = (point.dist.requires if point.dist is not None else None) or []
    return _select_requirements(tuple(lines), tuple(point.extras))


@cache  # reading requirements takes some milliseconds, and engines are listed for every scenario that is validated
def _select_requirements(lines: tuple[str, ...], extras: tuple[str, ...]) -> tuple[Requirement, ...]:
    """Read the requirements that are one of the extras' own."""
    found = []
    for line in lines:
        requirement = Requirement(line)
        # Without an extra its marker is false; requirements without a marker are the package's own.
        if requirement.marker is None or requirement.marker.evaluate({"extra": ""}):
            continue
        if any(requirement.marker.evaluate({"extra": extra}) for extra in extras):
            found.append(requirement)
    return tuple(found)


def install_command(point: EntryPoint) -> str:
    """Return the shell command that installs an engine's library."""
    package = "" if point.dist is None else point.dist.name
    return f"pip install '{package}[{','.join(point.extras)}]'"


def _is_installed(requirement: Requirement, any_release: bool) -> bool:
    try:
        found = version(requirement.name)
    except PackageNotFoundError:
        return False
    return any_release or requirement.specifier.contains(found, prereleases=True)
