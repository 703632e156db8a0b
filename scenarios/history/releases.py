"""The releases of a package that a history compares: as the command line names them, and as the registry has them."""

from __future__ import annotations

import zipfile
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from packaging.requirements import InvalidRequirement, Requirement
from packaging.specifiers import InvalidSpecifier, SpecifierSet
from packaging.utils import InvalidWheelFilename, canonicalize_name, parse_wheel_filename
from packaging.version import InvalidVersion, Version

from ..error import ScenarioError
from ..files import file_digest
from ..scenario import show_value

_OPERATORS = ("==", "!=", "<=", ">=", "<", ">", "~=")
_WHEEL_SUFFIX = ".whl"
_EXAMPLE = "e.g. 'mujoco==3.9.0,4.0.0' or 'mujoco>=3.3,<4.1'"


@dataclass(frozen=True)
class Release:
    """One release of a package: of the registry, or a wheel.

    Attributes
    ----------
    package : str
        Canonical name of the package.
    version : str
    wheel : Path or None
        File of a wheel, as the user named it; None for a release of the registry.
    digest : str or None
        SHA-256 of the wheel in hexadecimal digits.
    """

    package: str
    version: str
    wheel: Path | None = None
    digest: str | None = None

    @property
    def label(self) -> str:
        """The version, for a wheel with the first digits of its digest, since builds may have a version in common."""
        return self.version if self.digest is None else f"{self.version} wheel {self.digest[:8]}"

    @property
    def key(self) -> str:
        """Text that identifies the release and, for a wheel, its contents."""
        return f"{self.package}-{self.version}" + ("" if self.digest is None else f"-wheel-{self.digest[:16]}")


@dataclass(frozen=True)
class ReleaseRange:
    """Releases of a package as the command line names them.

    Attributes
    ----------
    package : str
        Canonical name of the package.
    text : str
        What the user wrote after the name.
    alternatives : tuple of SpecifierSet
        A release belongs to the range if it fits one of them; empty if only wheels are compared.
    """

    package: str
    text: str
    alternatives: tuple[SpecifierSet, ...]

    @property
    def exact(self) -> tuple[str, ...] | None:
        """The versions if all of them are written out, None otherwise."""
        only = [next(iter(found)) for found in self.alternatives if len(found) == 1]
        written = [one.version for one in only if one.operator == "==" and not one.version.endswith(".*")]
        return tuple(written) if len(written) == len(self.alternatives) else None

    def select(self, versions: Iterable[str]) -> list[str]:
        """Return the versions that belong to the range, oldest first.

        Pre-releases belong to it where a bound is one itself, or where they are the only ones.
        """
        known = list(versions)
        found = {version for one in self.alternatives for version in one.filter(known)}
        return sorted(found, key=Version)


def parse_release_range(text: str) -> ReleaseRange:
    """Parse ``PACKAGE==V1,V2,…``, any other PEP 440 specifier, or a package alone.

    Raises
    ------
    ScenarioError
        If it is none of these, in one line.
    """
    at = min((place for sign in "=!<>~" if (place := text.find(sign)) >= 0), default=len(text))
    name, rest = text[:at].strip(), text[at:].strip()
    try:
        requirement = Requirement(name)
    except InvalidRequirement as error:
        raise ScenarioError(f"{show_value(repr(text))}: must be a package with its releases, {_EXAMPLE}") from error
    if requirement.extras or requirement.url or requirement.marker:
        raise ScenarioError(f"{show_value(repr(text))}: must be the name of a package with its releases, {_EXAMPLE}")
    parts = [part.strip() for part in rest.split(",") if part.strip()]
    package = canonicalize_name(requirement.name)
    try:
        # Versions without an operator continue the list that "==" begins.
        if parts and parts[0].startswith("==") and not any(part.startswith(_OPERATORS) for part in parts[1:]):
            versions = [parts[0].removeprefix("==").strip(), *parts[1:]]
            return ReleaseRange(package, rest, tuple(SpecifierSet(f"=={version}") for version in versions))
        return ReleaseRange(package, rest, (SpecifierSet(",".join(parts)),) if parts else ())
    except InvalidSpecifier as error:
        raise ScenarioError(
            f"{show_value(repr(text))}: {show_value(rest)} is no list of releases; write {_EXAMPLE}"
        ) from error


def read_wheel(path: Path, package: str) -> Release:
    """Return the release that a wheel is.

    Raises
    ------
    ScenarioError
        If the file is missing, no wheel, or one of another package.
    """
    where = f"--wheel {show_value(str(path))}"
    if not path.is_file():
        raise ScenarioError(f"{where}: there is no such file; name a {_WHEEL_SUFFIX} file of {package}")
    try:
        name, version, _, _ = parse_wheel_filename(path.name)
    except (InvalidWheelFilename, InvalidVersion) as error:
        raise ScenarioError(f"{where}: is not a wheel by its name; name a {_WHEEL_SUFFIX} file of {package}") from error
    if canonicalize_name(name) != package:
        raise ScenarioError(f"{where}: is a wheel of {name}, not of {package}")
    if not zipfile.is_zipfile(path):
        raise ScenarioError(f"{where}: is damaged or no wheel: it is no zip file")
    return Release(package, str(version), path, file_digest(path))


def order_releases(package: str, versions: Collection[str], wheels: Sequence[Release]) -> tuple[Release, ...]:
    """Return releases by version, oldest first; a wheel follows the release of its version.

    Equal wheels count once.
    """
    found = [Release(package, version) for version in versions]
    found += {wheel.digest: wheel for wheel in wheels}.values()
    return tuple(sorted(found, key=lambda release: (Version(release.version), release.wheel is not None)))


def nearest_version(wanted: str, known: Collection[str]) -> str | None:
    """Return the oldest known version that is not older than a wanted one, else the newest; None if none is known."""
    ordered = sorted(known, key=Version)
    try:
        later = [version for version in ordered if Version(version) >= Version(wanted.removesuffix(".*"))]
    except InvalidVersion:
        later = []
    return next(iter(later or ordered[-1:]), None)
