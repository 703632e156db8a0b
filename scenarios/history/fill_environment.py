"""The contents of a release's environment: the release, its companions, and what else it lacks."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import distributions
from pathlib import Path
from typing import Any

from packaging.utils import canonicalize_name
from packaging.version import Version

from ..files import file_digest, write_sealed
from ..run import read_sealed
from .children import Children
from .pip_calls import PipError, install_packages
from .releases import Release
from .replaced_modules import refuse_replaced_modules
from .requirements import RequirementConflict, resolve_needs
from .wheels import WheelFile

MARKER = "environment.json"
_MARKER_VERSION = 2
_DEEPEST = 10  # levels of dependencies


def fill_environment(folder: Path, release: Release, children: Children) -> Mapping[str, str | None]:
    """Install a release with all that it lacks into an empty folder, and describe it there in a file.

    Returns
    -------
    dict
        What the suite's environment has of what the release needs, see
        `velodrome.scenarios.history.requirements.ResolvedNeeds`.

    Raises
    ------
    PipError, RequirementConflict
        If there is no environment of the release.
    """
    archives: dict[str, str | None] = {}

    def add(what: Sequence[str]) -> None:
        # In a folder of its own, since pip replaces whole modules in a folder that has them already.
        own = folder / ".new"
        archives.update(install_packages(what, own, children))
        refuse_replaced_modules(own, release.package)
        _merge_folder(own, folder)

    if release.files:
        for wheel in release.files:
            add([str(_copy_wheel(wheel, folder / ".wheels"))])
        shutil.rmtree(folder / ".wheels")
    else:
        # "==" would take builds of that version too, which have other versions behind a plus sign.
        add([f"{release.package}==={release.version}"])
    found = resolve_needs(folder, release.package)
    for _ in range(_DEEPEST):
        if not found.unmet:
            break
        add(found.unmet)
        found = resolve_needs(folder, release.package)
    if found.unmet:
        raise RequirementConflict(f"its dependencies do not come to an end: {', '.join(found.unmet)}")
    versions = list_packages(folder)
    there = versions.get(release.package)
    if there is None or Version(there) != Version(release.version):
        raise PipError(f"pip has installed {there or 'nothing'} for {release.package} {release.version}")
    given = {wheel.package: str(wheel.path.name) for wheel in release.files}
    marker = {
        "package": release.package,
        "version": release.version,
        "wheel_sha256": release.digest,
        "packages": {
            name: {"version": version, "sha256": archives.get(name), "wheel": given.get(name)}
            for name, version in versions.items()
        },
        "suite": dict(found.suite),
        "installed": datetime.now(UTC).isoformat(timespec="seconds"),
        "files_sha256": digest_files(folder),
    }
    write_sealed(folder / MARKER, marker, _MARKER_VERSION)
    return found.suite


def read_marker(folder: Path) -> dict[str, Any] | None:
    """Return what `fill_environment` has written about an environment; None if it is damaged or of another format."""
    try:
        marker = read_sealed(folder / MARKER, _MARKER_VERSION)
        return marker if "suite" in marker else None
    except (OSError, ValueError):
        return None


def list_packages(folder: Path) -> dict[str, str]:
    """Return the versions of the packages in a folder by canonical name."""
    found = distributions(path=[str(folder)])
    return dict(sorted((canonicalize_name(one.name), one.version) for one in found))


def digest_files(folder: Path) -> str:
    """Return the SHA-256 of all files of an environment, without compiled bytecode, which Python may write anew."""
    found = hashlib.sha256()
    paths = (path for path in folder.rglob("*") if path.is_file() and path != folder / MARKER)
    for path in sorted(path for path in paths if "__pycache__" not in path.parts):
        name = str(path.relative_to(folder)).encode()
        found.update(b"%d %b %d\n" % (len(name), name, path.stat().st_size))
        with path.open("rb") as file:
            while block := file.read(1 << 20):
                found.update(block)
    return found.hexdigest()


def _copy_wheel(wheel: WheelFile, folder: Path) -> Path:
    """Copy a wheel, so that what pip installs is what was digested, and return the copy's path."""
    folder.mkdir(exist_ok=True)
    copy = folder / wheel.path.name
    try:
        shutil.copyfile(wheel.path, copy)
    except OSError as error:
        raise PipError(f"{wheel.path} cannot be read any more: {error.strerror}") from error
    if file_digest(copy) != wheel.digest:
        raise PipError(f"{wheel.path} has changed since the history was started; start it again for the new build")
    return copy


def _merge_folder(source: Path, target: Path) -> None:
    """Move all files of a folder into another, where files that are there already stay.

    Of a file that a package and its dependency both have, the package's is kept, as if it were installed last.
    """
    for path in [path for path in source.rglob("*") if not path.is_dir()]:
        place = target / path.relative_to(source)
        if not place.exists():
            place.parent.mkdir(parents=True, exist_ok=True)
            path.replace(place)
    shutil.rmtree(source)
