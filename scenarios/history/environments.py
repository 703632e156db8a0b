"""Environments of releases: folders with a release and its companions, laid over the suite's own environment.

The folders are kept in a cache folder and used again. One is made under a temporary name and renamed when it is whole;
a digest of its files is held against them whenever it is used. A release has one for each set of versions in the
suite's environment that what is laid over depends on.
"""

from __future__ import annotations

import os
import shutil
import sys
import sysconfig
import uuid
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..error import ScenarioError
from .children import Children
from .file_locks import hold_lock
from .fill_environment import MARKER, digest_files, fill_environment, read_marker
from .pip_calls import PipError
from .problems import digest_json
from .releases import Release
from .requirements import RequirementConflict, resolve_needs


class NotInstallable(RuntimeError):
    """Raised for a release that has no environment; the message is one line."""


@dataclass(frozen=True)
class ReleaseEnvironment:
    """The environment of one release.

    Attributes
    ----------
    folder : Path
    packages : dict
        By canonical name of each package in it: ``version``, ``sha256`` of the file that was installed, None where pip
        did not say it, and ``wheel``, the name of the file that the user gave, None for one of the registry.
    installed : str
        When it was made, UTC, ISO 8601.
    digest : str
        SHA-256 of its files.
    """

    folder: Path
    packages: dict[str, dict[str, str | None]]
    installed: str
    digest: str

    def is_there(self) -> bool:
        """Whether nobody has removed it meanwhile."""
        return (self.folder / MARKER).is_file()


def find_cache_folder(own: Path | None = None) -> Path:
    """Return the folder of all environments: ``releases`` in a given folder, or in the user's cache folder.

    The path is absolute, since the processes that use the folder may change their own working directory.
    """
    if own is not None:
        return own.absolute() / "releases"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache").absolute() / "velodrome" / "releases"


def list_cached_versions(package: str, cache: Path) -> list[str]:
    """Return the versions of a package's releases of the registry that have an environment in the cache."""
    found: set[str] = set()
    for path in cache.glob(f"{package}-*{_platform_suffix()}-*/{MARKER}"):
        marker = read_marker(path.parent)
        if marker is None or (marker["package"], marker["wheel_sha256"]) != (package, None):
            continue
        if _goes_with_suite(path.parent, marker):
            found.add(str(marker["version"]))
    return sorted(found)


def read_cached_packages(release: Release, cache: Path) -> dict[str, dict[str, str | None]] | None:
    """Return the packages of a release's environment in the cache, None without one."""
    markers = (marker for _, marker in _list_fitting(release, cache))
    return next((marker["packages"] for marker in markers), None)


@contextmanager
def open_environment(release: Release, cache: Path, children: Children) -> Iterator[ReleaseEnvironment]:
    """Yield a release's environment, made if it is not in the cache or not as it was made.

    No other process replaces it meanwhile.

    Raises
    ------
    NotInstallable
        If pip does not install it, it does not go with the suite's environment, or it cannot be written.
    ScenarioError
        If the cache folder cannot be made.
    """
    cache = cache.absolute()
    try:
        cache.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ScenarioError(f"{cache}: the folder of environments cannot be made: {error.strerror}") from error
    with ExitStack() as using:
        with hold_lock(cache / f".{_name_all(release)}.lock", children):
            found = _find_environment(release, cache, children, using)
            if found is None:
                path = _make_environment(release, cache, children)
                found = _find_environment(release, cache, children, using)
                if found is None:
                    raise NotInstallable(f"its environment {path} changed while it was made")
        yield found


def _find_environment(release: Release, cache: Path, children: Children, using: ExitStack) -> ReleaseEnvironment | None:
    """Return an environment that is whole and goes with the suite's, with a lock on it; None without one."""
    for path, marker in _list_fitting(release, cache):
        with ExitStack() as lock:
            lock.enter_context(hold_lock(_name_lock(path), children, shared=True))
            if marker["files_sha256"] == digest_files(path):
                using.push(lock.pop_all())
                return ReleaseEnvironment(path, marker["packages"], marker["installed"], marker["files_sha256"])
    return None


def _make_environment(release: Release, cache: Path, children: Children) -> Path:
    name = _name_all(release)
    for stale in cache.glob(f".making-{name}-*"):
        shutil.rmtree(stale, ignore_errors=True)
    making = cache / f".making-{name}-{uuid.uuid4().hex[:8]}"
    try:
        making.mkdir()  # with the rights that the umask gives, since the folder may be shared by several users
        suite = fill_environment(making, release, children)
        path = cache / f"{name}-{digest_json(dict(suite))[:8]}"
        with hold_lock(_name_lock(path), children):
            shutil.rmtree(path, ignore_errors=True)
            os.replace(making, path)
        return path
    except (PipError, RequirementConflict) as error:
        raise NotInstallable(str(error)) from error
    except OSError as error:
        raise NotInstallable(f"its environment cannot be made in {cache}: {error.strerror or error}") from error
    finally:
        shutil.rmtree(making, ignore_errors=True)


def _list_fitting(release: Release, cache: Path) -> list[tuple[Path, dict[str, Any]]]:
    """Return the environments of a release that go with the suite's present one, with their descriptions."""
    identity = (release.package, release.version, release.digest)
    found: list[tuple[Path, dict[str, Any]]] = []
    for path in sorted(cache.absolute().glob(f"{_name_all(release)}-*")):
        marker = read_marker(path)
        if marker is None or (marker["package"], marker["version"], marker["wheel_sha256"]) != identity:
            continue
        if _goes_with_suite(path, marker):
            found.append((path, marker))
    return found


def _goes_with_suite(path: Path, marker: Mapping[str, Any]) -> bool:
    """Whether the suite's environment has what it had when an environment was made, of what the release needs."""
    try:
        needs = resolve_needs(path, marker["package"])
    except (RequirementConflict, OSError):
        return False
    return not needs.unmet and needs.suite == marker["suite"]


def _name_all(release: Release) -> str:
    """Return the name of the environments of a release up to the part in which they differ."""
    return f"{release.key}{_platform_suffix()}"


def _name_lock(path: Path) -> Path:
    return path.with_name(f".{path.name}.lock")


def _platform_suffix() -> str:
    return f"-{sys.implementation.cache_tag}-{sysconfig.get_platform()}"
