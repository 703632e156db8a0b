"""The releases of a package that a history compares: as the command line names them, and as the registry has them."""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from packaging.requirements import InvalidRequirement, Requirement
from packaging.specifiers import InvalidSpecifier, SpecifierSet
from packaging.utils import canonicalize_name
from packaging.version import InvalidVersion, Version

from ..error import ScenarioError
from ..scenario import show_value
from .wheels import WheelFile, group_wheels, read_wheel

_OPERATORS = ("==", "!=", "<=", ">=", "<", ">", "~=")
_EXAMPLE = "e.g. 'mujoco==3.9.0,4.0.0' or 'mujoco>=3.3,<4.1'"


@dataclass(frozen=True)
class Release:
    """One release of a package: of the registry, or of wheels.

    Attributes
    ----------
    package : str
        Canonical name of the package.
    version : str
    files : tuple of WheelFile
        The package's wheel and then those of its companions; empty for a release of the registry.
    """

    package: str
    version: str
    files: tuple[WheelFile, ...] = ()

    @property
    def wheel(self) -> Path | None:
        """The package's wheel, as the user named it; None for a release of the registry."""
        return self.files[0].path if self.files else None

    @property
    def digest(self) -> str | None:
        """SHA-256 of the wheel in hexadecimal digits; with companions, of the digests of all, one a line."""
        if len(self.files) <= 1:
            return self.files[0].digest if self.files else None
        return hashlib.sha256("".join(f"{file.digest}\n" for file in self.files).encode()).hexdigest()

    @property
    def label(self) -> str:
        """The version, for a wheel with the first digits of its digest, since builds may have a version in common."""
        return self.version if self.digest is None else f"{self.version} wheel {self.digest[:8]}"

    @property
    def key(self) -> str:
        """Text that identifies the release and, for wheels, their contents."""
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


def read_wheel_releases(paths: Sequence[Path], package: str) -> list[Release]:
    """Return the releases that wheels are, see `velodrome.scenarios.history.wheels.group_wheels`.

    Raises
    ------
    ScenarioError
        If a file is missing, no wheel, or belongs to no release of the package.
    """
    groups = group_wheels([read_wheel(path, package) for path in paths], package)
    return [Release(package, files[0].version, files) for files in groups]


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
