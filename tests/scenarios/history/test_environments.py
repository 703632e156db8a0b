"""Environments of releases: what is installed is what was asked for, and none is changed under a ride."""

from __future__ import annotations

import os
import threading
from pathlib import Path

import pytest
from mill import FAULT, PACKAGE, make_package_wheel, make_wheel, use_registry

from velodrome.scenarios.files import file_digest
from velodrome.scenarios.history import Children, environments, find_cache_folder
from velodrome.scenarios.history.environments import (
    NotInstallable,
    ReleaseEnvironment,
    open_environment,
    read_cached_packages,
)
from velodrome.scenarios.history.releases import Release, read_wheel_releases

pytestmark = pytest.mark.once  # pip and folders; `test_history_command` rides in environments

HELPER = "wheelmill-helper"


@pytest.fixture
def registry(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "registry"
    use_registry(folder, monkeypatch)
    return folder


@pytest.fixture
def cache(tmp_path: Path) -> Path:
    return tmp_path / "cache"


def open_once(release: Release, cache: Path) -> ReleaseEnvironment:
    with open_environment(release, cache, Children()) as found:
        return found


def make_helper(folder: Path, version: str) -> Path:
    return make_package_wheel(folder, HELPER, version, {"wheelmill_helper.py": f"VERSION = {version!r}\n"})


def test_a_wheel_that_is_overwritten_is_not_ridden_as_the_one_it_was(tmp_path: Path, cache: Path) -> None:
    build = make_wheel(tmp_path / "build", "1.0")
    (release,) = read_wheel_releases([build], PACKAGE)
    whole = build.read_bytes()
    make_wheel(tmp_path / "build", "1.0", stretch=FAULT)
    with pytest.raises(NotInstallable, match="has changed since the history was started"):
        open_once(release, cache)
    build.write_bytes(whole)
    assert "STRETCH = 1.0\n" in (open_once(release, cache).folder / f"{PACKAGE}.py").read_text()


@pytest.mark.slow
def test_companions_are_of_the_build_and_not_of_the_registry(tmp_path: Path, registry: Path, cache: Path) -> None:
    make_helper(registry, "2.0")
    wheels = [make_wheel(tmp_path / "build", "1.0", requires=HELPER), make_helper(tmp_path / "build", "1.5")]
    (release,) = read_wheel_releases(wheels, PACKAGE)
    assert open_once(release, cache).packages == {
        name: {"version": version, "sha256": file_digest(path), "wheel": path.name}
        for name, version, path in ((PACKAGE, "1.0", wheels[0]), (HELPER, "1.5", wheels[1]))
    }
    (alone,) = read_wheel_releases(wheels[:1], PACKAGE)
    found = open_once(alone, cache).packages[HELPER]
    assert (found["version"], found["wheel"]) == ("2.0", None)


@pytest.mark.slow
def test_a_version_with_a_local_part_is_another_release(registry: Path, cache: Path) -> None:
    make_wheel(registry, "1.0")
    make_wheel(registry, "1.0+fault", stretch=FAULT)
    for version in ("1.0", "1.0+fault"):
        assert open_once(Release(PACKAGE, version), cache).packages[PACKAGE]["version"] == version


def test_suites_that_have_other_packages_have_environments_of_their_own(
    tmp_path: Path, registry: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make_wheel(registry, "1.0", requires=HELPER)
    make_helper(registry, "2.0")
    release = Release(PACKAGE, "1.0")
    without = open_once(release, cache)
    assert {*without.packages} == {PACKAGE, HELPER}
    with monkeypatch.context() as suite:
        info = tmp_path / "suite" / "wheelmill_helper-1.0.dist-info"
        info.mkdir(parents=True)
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {HELPER}\nVersion: 1.0\n")
        suite.syspath_prepend(str(tmp_path / "suite"))
        assert read_cached_packages(release, cache) is None
        having = open_once(release, cache)
        assert {*having.packages} == {PACKAGE}
        assert open_once(release, cache) == having
    assert open_once(release, cache) == without


@pytest.mark.slow
def test_no_environment_is_replaced_while_it_is_ridden(
    registry: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make_wheel(registry, "1.0")
    release = Release(PACKAGE, "1.0")
    found: list[ReleaseEnvironment] = []
    other = threading.Thread(target=lambda: found.append(open_once(release, cache)))
    with open_environment(release, cache, Children()) as riding:
        module = riding.folder / f"{PACKAGE}.py"
        module.write_text("changed\n")
        other.start()
        other.join(4.0)
        assert other.is_alive()
        assert module.read_text() == "changed\n"
    other.join()
    assert found[0].digest == riding.digest
    assert "STRETCH" in module.read_text()


@pytest.mark.parametrize(
    ("module", "told"),
    [
        ("numpy/__init__.py", r"numpy \(of numpy, with which the suite computes\)"),
        ("velodrome/__init__.py", r"velodrome \(of velodrome"),
        ("enum.py", r"enum \(of Python's standard library\)"),
    ],
)
def test_a_release_that_brings_modules_of_the_suite_is_not_installable(
    module: str, told: str, tmp_path: Path, cache: Path
) -> None:
    (release,) = read_wheel_releases([make_package_wheel(tmp_path, PACKAGE, "1.0", {module: ""})], PACKAGE)
    with pytest.raises(NotInstallable, match=told):
        open_once(release, cache)


def test_a_cache_that_cannot_be_written_serves_what_it_has(
    registry: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make_wheel(registry, "1.0")
    make_wheel(registry, "1.1")
    made = open_once(Release(PACKAGE, "1.0"), cache)
    # Others may read it, as far as the umask lets them.
    umask = os.umask(0)
    os.umask(umask)
    assert made.folder.stat().st_mode & 0o777 == 0o777 & ~umask
    opening, making = os.open, Path.mkdir

    def open_read_only(path: str | Path, flags: int, *rest: int) -> int:
        if str(path).startswith(str(cache)) and flags & (os.O_RDWR | os.O_CREAT):
            raise OSError(30, "Read-only file system")
        return opening(path, flags, *rest)

    def make_folder(path: Path, mode: int = 0o777, parents: bool = False, exist_ok: bool = False) -> None:
        if path.is_relative_to(cache) and not path.exists():
            raise OSError(30, "Read-only file system")
        making(path, mode, parents, exist_ok)

    # Root may write to any folder, so that its rights alone would not make it read-only.
    monkeypatch.setattr(os, "open", open_read_only)
    monkeypatch.setattr(Path, "mkdir", make_folder)
    assert open_once(Release(PACKAGE, "1.0"), cache) == made
    with pytest.raises(NotInstallable, match=r"cannot be made in .*: Read-only file system"):
        open_once(Release(PACKAGE, "1.1"), cache)


def test_the_folder_of_environments_is_absolute(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert find_cache_folder(Path("near")) == tmp_path / "near" / "releases"
    monkeypatch.setenv("XDG_CACHE_HOME", "caches")
    assert find_cache_folder() == tmp_path / "caches" / "velodrome" / "releases"
    assert environments.list_cached_versions(PACKAGE, Path("near")) == []
