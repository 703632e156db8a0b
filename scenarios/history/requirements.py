"""What the packages of a release's environment need, and which of it the suite's environment has."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from importlib.metadata import Distribution, PackageNotFoundError, distribution, distributions
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

_SUITE = "velodrome"


class RequirementConflict(RuntimeError):
    """Raised for a release that needs a version of a package that the rest of the suite cannot have."""


def find_suite_packages(package: str) -> set[str]:
    """Return the canonical names of all packages that the suite needs even without a package."""
    found: set[str] = set()
    left = [_SUITE]
    while left:
        name = left.pop()
        if name in found or name == package:
            continue
        found.add(name)
        try:
            needed = list_needs(distribution(name), ())
        except PackageNotFoundError:
            continue
        left += [canonicalize_name(requirement.name) for requirement in needed]
    return found


@dataclass(frozen=True)
class ResolvedNeeds:
    """What the packages in a folder need, as the suite's present environment meets it.

    Attributes
    ----------
    unmet : tuple of str
        Requirements of packages that have to be installed into the folder as well.
    suite : dict
        By canonical name of every package that is needed, without those of the suite itself: its version in the suite's
        environment, None where that does not have it. What is laid over depends on nothing else of that environment.
    """

    unmet: tuple[str, ...]
    suite: Mapping[str, str | None]


def resolve_needs(folder: Path, package: str) -> ResolvedNeeds:
    """Find which needs of the packages in a folder are not met.

    A requirement is met by a package in the folder, or by the suite's environment. The latter does not help where both
    would share a module: Python takes a whole module from the folder that comes first, so that a release's companion
    package must lie beside it.

    Parameters
    ----------
    folder : Path
    package : str
        Canonical name of the package whose release the folder holds.

    Raises
    ------
    RequirementConflict
        If a package that the suite itself needs would have to be another version. It is never replaced, since the
        reference and the comparison would be replaced with it.
    """
    here = {canonicalize_name(found.name): found for found in distributions(path=[str(folder)])}
    own_modules = list_top_modules(folder)
    suite = find_suite_packages(package)
    unmet: dict[str, str] = {}
    versions: dict[str, str | None] = {}
    extras: dict[str, set[str]] = {name: set() for name in here}
    left = list(here)
    while left:
        name = left.pop()
        for requirement in list_needs(here[name], extras[name]):
            needed = canonicalize_name(requirement.name)
            installed = _find_installed(needed)
            if needed not in suite and needed != package:
                versions[needed] = None if installed is None else installed.version
            if needed in here:
                new = requirement.extras - extras[needed]
                if new:
                    extras[needed] |= new
                    left.append(needed)
                if not _fits(requirement, here[needed]):
                    raise RequirementConflict(f"{name} needs {requirement}, but {here[needed].version} is beside it")
                continue
            fits = installed is not None and _fits(requirement, installed)
            if needed in suite:
                if not fits:
                    has = "not installed" if installed is None else f"{installed.version} in the suite's environment"
                    raise RequirementConflict(f"{name} needs {requirement}, and {needed} is {has}")
            elif not fits or (installed is not None and _share_modules(installed, own_modules)):
                extra = f"[{','.join(sorted(requirement.extras))}]" if requirement.extras else ""
                unmet[needed] = f"{requirement.name}{extra}{requirement.specifier}"
    return ResolvedNeeds(tuple(unmet[name] for name in sorted(unmet)), dict(sorted(versions.items())))


def list_top_modules(folder: Path) -> set[str]:
    """Return the names of the modules and packages that lie directly in a folder."""
    found = set()
    for entry in folder.iterdir():
        if entry.name.endswith(".dist-info") or entry.name in ("__pycache__", "bin") or entry.name.startswith("."):
            continue
        if entry.is_dir():
            found.add(entry.name)
        elif entry.suffix in (".py", ".so", ".pyd"):
            found.add(entry.name.partition(".")[0])
    return found


def list_regular_modules(folder: Path) -> set[str]:
    """Return the modules in a folder without namespace packages, which several packages may share."""
    tops = list_top_modules(folder)
    return {top for top in tops if not (folder / top).is_dir() or (folder / top / "__init__.py").exists()}


def list_needs(found: Distribution, extras: Iterable[str]) -> Iterator[Requirement]:
    """Yield what a package needs on this platform, with what these of its extras need."""
    for line in found.requires or []:
        requirement = Requirement(line)
        marker = requirement.marker
        if marker is None or any(marker.evaluate({"extra": extra}) for extra in ("", *extras)):
            yield requirement


def _find_installed(name: str) -> Distribution | None:
    try:
        return distribution(name)
    except PackageNotFoundError:
        return None


def _fits(requirement: Requirement, found: Distribution) -> bool:
    return requirement.specifier.contains(found.version, prereleases=True)


def _share_modules(found: Distribution, modules: set[str]) -> bool:
    files = found.files or []
    tops = {path.parts[0].partition(".")[0] if len(path.parts) == 1 else path.parts[0] for path in files}
    return bool(tops & modules)
