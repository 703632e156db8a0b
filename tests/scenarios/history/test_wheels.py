"""Wheels as the user gives them: what is refused, and which of them form a release."""

from __future__ import annotations

import hashlib
import zipfile
from pathlib import Path

import pytest
from mill import PACKAGE, make_package_wheel, make_wheel

from velodrome.scenarios.error import ScenarioError
from velodrome.scenarios.history.companions import describe_registry_companions
from velodrome.scenarios.history.releases import Release, read_wheel_releases

CORE = "wheelmill-core"


def make_core(folder: Path, version: str = "2.0", requires: str | None = None, text: str = "") -> Path:
    return make_package_wheel(folder, CORE, version, {"wheelmill_core.py": text}, requires)


def names_of(paths: list[Path]) -> list[list[str]]:
    return [[str(file.path) for file in release.files] for release in read_wheel_releases(paths, PACKAGE)]


def test_a_file_that_is_no_wheel_of_the_package_is_refused(tmp_path: Path) -> None:
    wheel = make_wheel(tmp_path, "1.0")
    renamed = tmp_path / f"{PACKAGE}-1.1-py3-none-any.whl"
    renamed.write_bytes(wheel.read_bytes())
    bare = tmp_path / f"{PACKAGE}-1.2-py3-none-any.whl"
    with zipfile.ZipFile(bare, "w") as archive:
        archive.writestr("a", "b")
    damaged = tmp_path / f"{PACKAGE}-1.3-py3-none-any.whl"
    data = make_wheel(tmp_path / "whole", "1.3").read_bytes()
    damaged.write_bytes(data.replace(b"STRETCH = 1.0", b"STRETCH = 2.0"))  # the checksum is that of the other line
    text = tmp_path / f"{PACKAGE}-2.0-py3-none-any.whl"
    text.write_text("no zip")
    for path, words in (
        (tmp_path / "absent.whl", "there is no such file"),
        (tmp_path, "there is no such file"),
        (renamed, f"is {PACKAGE} 1.0 inside; give the file the name with which it was built"),
        (bare, "is no wheel: it has the metadata of 0 packages"),
        (damaged, f"is damaged: {PACKAGE}.py in it cannot be read"),
        (text, "it is no zip file"),
        (make_core(tmp_path), f"is a wheel of {CORE}, not of {PACKAGE}$"),
        (wheel.rename(tmp_path / "wheelmill.zip"), "is not a wheel by its name"),
    ):
        with pytest.raises(ScenarioError, match=words) as told:
            read_wheel_releases([path], PACKAGE)
        assert "\n" not in str(told.value)


def test_a_required_wheel_belongs_to_the_release_of_the_wheel_that_requires_it(tmp_path: Path) -> None:
    own = make_wheel(tmp_path, "2.0", requires=f"{CORE}==2.0")
    core = make_core(tmp_path, requires="wheelmill-base")
    base = make_package_wheel(tmp_path, "wheelmill-base", "7", {})
    alone, other = make_wheel(tmp_path, "1.0"), make_core(tmp_path / "other", text="other")
    assert names_of([core, base, own, alone]) == [[str(own), str(core), str(base)], [str(alone)]]
    one, another = (read_wheel_releases([own, path], PACKAGE)[0] for path in (core, other))
    assert len({one.key, another.key, read_wheel_releases([own], PACKAGE)[0].key}) == 3
    assert one.label != another.label
    digests = [hashlib.sha256(path.read_bytes()).hexdigest() for path in (own, core)]
    assert one.digest == hashlib.sha256("".join(f"{digest}\n" for digest in digests).encode()).hexdigest()


def test_two_builds_have_the_companions_in_their_own_folders(tmp_path: Path) -> None:
    wanted = [
        [make_wheel(tmp_path / name, "2.0", requires=CORE), make_core(tmp_path / name, text=name)]
        for name in ("before", "after")
    ]
    paths = [wanted[0][0], wanted[1][1], wanted[1][0], wanted[0][1]]
    assert names_of(paths) == [[str(path) for path in pair] for pair in wanted]
    assert len({release.digest for release in read_wheel_releases(paths, PACKAGE)}) == 2
    # One that lies with neither is of both, where they have none.
    shared = make_core(tmp_path / "shared")
    assert names_of([wanted[0][0], wanted[1][0], shared]) == [[str(pair[0]), str(shared)] for pair in wanted]


def test_companions_that_are_of_no_release_or_of_the_same_are_refused(tmp_path: Path) -> None:
    own = make_wheel(tmp_path, "2.0", requires=f"{CORE}==2.0")
    with pytest.raises(ScenarioError, match=f"and no given wheel of {PACKAGE} needs {CORE} 3.0"):
        read_wheel_releases([own, make_core(tmp_path, "3.0")], PACKAGE)
    cores = [make_core(tmp_path / name, text=name) for name in ("a", "b")]
    with pytest.raises(ScenarioError, match="put each into the folder of its own wheel"):
        read_wheel_releases([own, *cores], PACKAGE)


def test_a_remark_tells_what_of_a_builds_release_is_the_registrys(tmp_path: Path) -> None:
    (build,) = read_wheel_releases([make_wheel(tmp_path, "2.0", requires=CORE)], PACKAGE)
    own = {"version": "2.0", "sha256": None, "wheel": "own.whl"}
    core = {"version": "2.1", "sha256": None, "wheel": None}
    told = describe_registry_companions(build, {PACKAGE: own, CORE: core})
    assert told is not None
    assert told.startswith(f"{build.label}: not of the given wheels but of the registry: {CORE} 2.1; ")
    assert describe_registry_companions(build, {PACKAGE: own, CORE: own}) is None
    assert describe_registry_companions(Release(PACKAGE, "2.0"), {PACKAGE: core, CORE: core}) is None
