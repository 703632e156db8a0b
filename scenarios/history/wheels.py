"""Wheels that the user gives: what they say of themselves, and which of them form a release."""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib.metadata import distributions
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import InvalidWheelFilename, canonicalize_name, parse_wheel_filename
from packaging.version import InvalidVersion, Version

from ..error import ScenarioError
from ..files import file_digest
from ..scenario import show_value
from .requirements import list_needs

_WHEEL_SUFFIX = ".whl"


@dataclass(frozen=True)
class WheelFile:
    """A wheel as the user named it.

    Attributes
    ----------
    package : str
        Canonical name.
    version : str
    path : Path
    digest : str
        SHA-256 in hexadecimal digits.
    needs : tuple of Requirement
        What it requires on this platform.
    """

    package: str
    version: str
    path: Path
    digest: str
    needs: tuple[Requirement, ...] = field(default=(), compare=False)


def read_wheel(path: Path, package: str) -> WheelFile:
    """Return a wheel, of a package or of what it requires.

    Parameters
    ----------
    path : Path
    package : str
        Canonical name of the package whose releases are compared; for the messages.

    Raises
    ------
    ScenarioError
        If the file is missing, damaged or no wheel, or its name is not that of its contents.
    """
    where = f"--wheel {show_value(str(path))}"
    if not path.is_file():
        raise ScenarioError(f"{where}: there is no such file; name a {_WHEEL_SUFFIX} file of {package}")
    try:
        name, version, _, _ = parse_wheel_filename(path.name)
    except (InvalidWheelFilename, InvalidVersion) as error:
        raise ScenarioError(f"{where}: is not a wheel by its name; name a {_WHEEL_SUFFIX} file of {package}") from error
    if not zipfile.is_zipfile(path):
        raise ScenarioError(f"{where}: is damaged or no wheel: it is no zip file")
    try:
        with zipfile.ZipFile(path) as archive:
            damaged = archive.testzip()
        if damaged is not None:
            raise ScenarioError(f"{where}: is damaged: {show_value(damaged)} in it cannot be read")
        inside = list(distributions(path=[str(path)]))
        found = [(canonicalize_name(one.name), Version(one.version), tuple(list_needs(one, ()))) for one in inside]
    except ScenarioError:
        raise
    except Exception as error:  # zip files and metadata can be wrong in many ways
        raise ScenarioError(f"{where}: is damaged: {type(error).__name__}: {show_value(str(error))}") from error
    if len(found) != 1:
        raise ScenarioError(f"{where}: is no wheel: it has the metadata of {len(found)} packages, not of one")
    ((package_inside, version_inside, needs),) = found
    if (package_inside, version_inside) != (canonicalize_name(name), version):
        raise ScenarioError(
            f"{where}: is {package_inside} {version_inside} inside; give the file the name with which it was built"
        )
    return WheelFile(package_inside, str(version), path, file_digest(path), needs)


def group_wheels(wheels: Sequence[WheelFile], package: str) -> list[tuple[WheelFile, ...]]:
    """Return the wheels of each release: the package's own, then its companions.

    A wheel of another package is a companion of those wheels of the package that require it in its version, directly or
    by another companion: of those in its own folder if there are any, of all otherwise.

    Raises
    ------
    ScenarioError
        If a wheel belongs to no release, or two of one package belong to the same one.
    """
    own = [wheel for wheel in wheels if wheel.package == package]
    others = [wheel for wheel in wheels if wheel.package != package]
    with_own = {wheel.path.parent.resolve() for wheel in own}
    releases: list[tuple[WheelFile, ...]] = []
    used: set[WheelFile] = set()
    for wheel in own:
        folder = wheel.path.parent.resolve()
        near = [
            one for one in others if one.path.parent.resolve() == folder or one.path.parent.resolve() not in with_own
        ]
        companions = _choose_companions(wheel, near)
        used |= {*companions}
        releases.append((wheel, *companions))
    for other in others:
        if other not in used:
            needed = f", and no given wheel of {package} needs {other.package} {other.version}" if own else ""
            raise ScenarioError(
                f"--wheel {show_value(str(other.path))}: is a wheel of {other.package}, not of {package}{needed}"
            )
    return releases


def _choose_companions(wheel: WheelFile, others: Sequence[WheelFile]) -> list[WheelFile]:
    chosen: dict[str, WheelFile] = {}
    left = [wheel]
    while left:
        for requirement in left.pop().needs:
            name = canonicalize_name(requirement.name)
            fitting = {
                other.digest: other
                for other in others
                if other.package == name and requirement.specifier.contains(other.version, prereleases=True)
            }
            if name in chosen or not fitting:
                continue
            first, *more = fitting.values()
            if more:
                raise ScenarioError(
                    f"--wheel {show_value(str(more[0].path))}: another wheel of {name} for the same release is "
                    f"{show_value(str(first.path))}; put each into the folder of its own wheel of {wheel.package}"
                )
            chosen[name] = first
            left.append(first)
    return list(chosen.values())
