"""Environments of releases: folders with a release and its companions, laid over the suite's own environment.

The folders are kept in a cache folder and used again. One is made under a temporary name and renamed when it is whole;
a digest of its files is held against them whenever it is used.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import shutil
import sys
import sysconfig
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import distributions
from pathlib import Path
from typing import Any

from packaging.utils import canonicalize_name

from ..error import ScenarioError
from ..files import content_digest, write_sealed
from ..run import read_json
from .children import Children, StoppedError
from .pip_calls import PipError, install_packages
from .releases import Release
from .requirements import RequirementConflict, list_unmet

_MARKER = "environment.json"
_MARKER_VERSION = 1
_DEEPEST = 10  # levels of dependencies
_LOOK = 0.2  # [s] between two attempts to get a lock


class NotInstallable(RuntimeError):
    """Raised for a release that has no environment; the message is one line."""


@dataclass(frozen=True)
class ReleaseEnvironment:
    """The environment of one release.

    Attributes
    ----------
    folder : Path
    packages : dict
        Versions of the packages in it, by canonical name.
    digest : str
        SHA-256 of its files.
    """

    folder: Path
    packages: dict[str, str]
    digest: str


def find_cache_folder(own: Path | None = None) -> Path:
    """Return the folder of all environments: ``releases`` in a given folder, or in the user's cache folder."""
    if own is not None:
        return own / "releases"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "velodrome" / "releases"


def list_cached_versions(package: str, cache: Path) -> list[str]:
    """Return the versions of a package's releases of the registry that have an environment in the cache."""
    found = []
    for path in sorted(cache.glob(f"{package}-*{_platform_suffix()}/{_MARKER}")):
        marker = _read_marker(path)
        if marker is not None and marker["package"] == package and marker["wheel"] is None:
            found.append(str(marker["version"]))
    return found


def open_environment(release: Release, cache: Path, children: Children) -> ReleaseEnvironment:
    """Return a release's environment, made if it is not in the cache or not as it was made.

    Raises
    ------
    NotInstallable
        If pip does not install it, or it does not go with the suite's environment.
    ScenarioError
        If the cache folder cannot be written.
    """
    path = cache / f"{release.key}{_platform_suffix()}"
    try:
        cache.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ScenarioError(f"{cache}: the folder of environments cannot be made: {error.strerror}") from error
    with _lock_file(cache / f".{path.name}.lock", children):
        found = _check_environment(path, release)
        if found is not None:
            return found
        for stale in [path, *cache.glob(f".making-{path.name}-*")]:
            shutil.rmtree(stale, ignore_errors=True)
        making = Path(tempfile.mkdtemp(prefix=f".making-{path.name}-", dir=cache))
        try:
            _fill_environment(making, release, children)
            os.replace(making, path)
        except (PipError, RequirementConflict) as error:
            raise NotInstallable(str(error)) from error
        finally:
            shutil.rmtree(making, ignore_errors=True)
        found = _check_environment(path, release)
    if found is None:
        raise NotInstallable(f"its environment {path} changed while it was made")
    return found


def _fill_environment(folder: Path, release: Release, children: Children) -> None:
    wanted = [f"{release.package}=={release.version}" if release.wheel is None else str(release.wheel.resolve())]
    for _ in range(_DEEPEST):
        # In a folder of its own, since pip replaces whole modules in a folder that has them already.
        own = folder / ".new"
        install_packages(wanted, own, children)
        _merge_folder(own, folder)
        wanted = list_unmet(folder, release.package)
        if not wanted:
            break
    else:
        raise RequirementConflict(f"its dependencies do not come to an end: {', '.join(wanted)}")
    marker = {
        "package": release.package,
        "version": release.version,
        "wheel": None if release.wheel is None else release.wheel.name,
        "wheel_sha256": release.digest,
        "packages": _list_packages(folder),
        "files_sha256": _digest_files(folder),
    }
    write_sealed(folder / _MARKER, marker, _MARKER_VERSION)


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


def _check_environment(path: Path, release: Release) -> ReleaseEnvironment | None:
    """Return an environment that is whole and goes with the suite's present one, None otherwise."""
    marker = _read_marker(path / _MARKER)
    if marker is None or (marker["package"], marker["version"]) != (release.package, release.version):
        return None
    if marker["files_sha256"] != _digest_files(path):
        return None
    try:
        if list_unmet(path, release.package):
            return None
    except RequirementConflict:
        return None
    return ReleaseEnvironment(path, marker["packages"], marker["files_sha256"])


def _read_marker(path: Path) -> dict[str, Any] | None:
    try:
        marker = read_json(path)
        if marker["sha256"] != content_digest(marker):
            return None
        return marker
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _list_packages(folder: Path) -> dict[str, str]:
    found = distributions(path=[str(folder)])
    return dict(sorted((canonicalize_name(one.name), one.version) for one in found))


def _digest_files(folder: Path) -> str:
    """Return the SHA-256 of all files of an environment, without compiled bytecode, which Python may write anew."""
    found = hashlib.sha256()
    paths = (path for path in folder.rglob("*") if path.is_file() and path != folder / _MARKER)
    for path in sorted(path for path in paths if "__pycache__" not in path.parts):
        name = str(path.relative_to(folder)).encode()
        found.update(b"%d %b %d\n" % (len(name), name, path.stat().st_size))
        with path.open("rb") as file:
            while block := file.read(1 << 20):
                found.update(block)
    return found.hexdigest()


def _platform_suffix() -> str:
    return f"-{sys.implementation.cache_tag}-{sysconfig.get_platform()}"


@contextmanager
def _lock_file(path: Path, children: Children) -> Iterator[None]:
    """Hold a lock that only one process, and one thread of it, has at a time; a process that ends loses it."""
    file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    try:
        while True:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                # Another process makes this environment; waiting in the system would not notice a stop.
                if children.stopped:
                    raise StoppedError("stopped while another process made the environment") from None
                time.sleep(_LOOK)
        yield
    finally:
        os.close(file)
