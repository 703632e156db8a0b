"""What of the suite's environment a ride has loaded: its row holds as long as that is there in the same versions."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, distribution, packages_distributions, version
from pathlib import Path

from packaging.utils import canonicalize_name


def list_loaded_packages(own: Sequence[Path], owners: Mapping[str, Sequence[str]] | None = None) -> dict[str, str]:
    """Return the versions of the packages of which this process has loaded a module, by their canonical names.

    Parameters
    ----------
    own : sequence of Path
        Folders of a release's environment, whose packages are left out.
    owners : mapping, optional
        Packages by top-level module, by `importlib.metadata.packages_distributions`, which takes a while.
    """
    owners = packages_distributions() if owners is None else owners
    tops = {name.partition(".")[0] for name in list(sys.modules)}
    found = {}
    for name in {name for top in tops for name in owners.get(top, ())}:
        try:
            package = distribution(name)
        except PackageNotFoundError:
            continue
        where = Path(str(package.locate_file(""))).resolve()
        if not any(where.is_relative_to(folder.resolve()) for folder in own):
            found[canonicalize_name(name)] = package.version
    return dict(sorted(found.items()))


def are_installed(packages: Mapping[str, str]) -> bool:
    """Return whether packages are installed in the same versions."""
    return all(_find_version(name) == wanted for name, wanted in packages.items())


def _find_version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None
