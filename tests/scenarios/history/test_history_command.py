"""`velodrome history` on releases of a tiny package: what it finds, what it refuses, and what a kill leaves behind."""

from __future__ import annotations

import json
import random
import shutil
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from mill import CIRCLE, FAULT, PACKAGE, ROUND_OFF, install_mill, make_package_wheel, make_wheel, use_registry

from velodrome.scenarios.files import file_digest
from velodrome.scenarios.history.environments import ReleaseEnvironment, open_environment
from velodrome.scenarios.history.releases import Release

KILLS = 10


@pytest.fixture
def registry(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A registry without any release yet, the engine installed, a short scenario, and an empty cache."""
    install_mill(tmp_path / "installed", monkeypatch)
    folder = tmp_path / "registry"
    use_registry(folder, monkeypatch)
    monkeypatch.setenv("VELODROME_CACHE", str(tmp_path / "cache"))
    (tmp_path / "circle.toml").write_text(CIRCLE, encoding="utf-8")
    return folder


def cached(tmp_path: Path) -> list[Path]:
    return sorted((tmp_path / "cache" / "releases").glob(f"{PACKAGE}-*"))


def statuses(document: dict[str, Any]) -> dict[str, tuple[str, str | None]]:
    return {row["version"]: (row["status"], row["since_previous"]) for row in document["releases"]}


def test_a_planted_fault_in_a_wheel_is_the_turning_point(velodrome, registry: Path, tmp_path: Path) -> None:
    make_wheel(registry, "1.0")
    build = make_wheel(tmp_path / "build", "1.0", stretch=FAULT)
    found = velodrome("history", f"{PACKAGE}==1.0", "circle.toml", "--wheel", str(build), "--json")
    assert found.status == 0, found.stderr
    document = found.json()
    (point,) = document["turning_points"]
    assert (point["release"], point["since"]) == (f"1.0 wheel {file_digest(build)[:8]}", "1.0")
    moved = {move["quantity"]: move for move in point["quantities"]}
    assert moved["position_error"]["status"] == "worse"
    assert moved["position_error"]["after"] > moved["position_error"]["before"] + moved["position_error"]["limit"]
    assert [(row["wheel"], row["companions"]) for row in document["releases"]] == [(None, []), (str(build), [])]
    # The table has what the document has.
    table = pq.ParquetFile(tmp_path / "history" / PACKAGE / "rides.parquet").read().to_pylist()
    assert [row["bits"] for row in table] == [row["bits"] for row in document["releases"]]
    assert [row["position_error"] for row in table] == [
        row["quantities"]["position_error"] for row in document["releases"]
    ]
    assert all(len(row["sample_time"]) == len(row["sample_coordinates"]) > 10 for row in table)


@pytest.mark.slow
def test_every_kind_of_release_has_its_row(velodrome, registry: Path, tmp_path: Path) -> None:
    make_wheel(registry, "1.0")
    make_wheel(registry, "1.1")
    make_wheel(registry, "1.2", stretch=ROUND_OFF)
    make_wheel(registry, "1.3", stretch=FAULT)
    make_wheel(registry, "1.4", before="os.abort()")
    make_wheel(registry, "1.5", before="time.sleep(1000)")
    make_wheel(registry, "1.6", before='raise UnsuitableProblem("it rides no circles")')
    make_wheel(registry, "1.7", before="1 / 0")
    make_wheel(registry, "1.8", requires="numpy<1")
    make_wheel(registry, "1.9", requires="wheelmill-companion-that-nobody-has")
    make_wheel(registry, "1.10", stretch=FAULT)
    found = velodrome("history", f"{PACKAGE}>=1.0", "circle.toml", "--time-limit", "30", "--json")
    assert found.status == 0, found.stderr
    document = found.json()
    assert statuses(document) == {
        "1.0": ("rode", None),
        "1.1": ("rode", "same-bits"),
        "1.2": ("rode", "round-off"),
        "1.3": ("rode", "changed"),  # the fault cancels a part of the error of some quantities
        "1.4": ("failed", "worse"),
        "1.5": ("failed", None),
        "1.6": ("refused", None),
        "1.7": ("failed", None),
        "1.8": ("not-installable", None),
        "1.9": ("not-installable", None),
        "1.10": ("rode", "same-bits"),  # against 1.3, the last that rode
    }
    reasons = {row["version"]: row["reason"] for row in document["releases"]}
    assert reasons["1.4"] == "its process ended by SIGABRT"
    assert reasons["1.5"].startswith("no result within 30 s, while in simulate (wheelmill.py, line ")
    assert reasons["1.6"] == "it rides no circles"
    assert "ZeroDivisionError" in reasons["1.7"]
    assert "numpy<1" in reasons["1.8"]
    assert "companion" in reasons["1.9"]
    assert [point["version"] for point in document["turning_points"]] == ["1.3", "1.4", "1.10"]
    assert {path.name.split("-")[1] for path in cached(tmp_path)} == {f"1.{n}" for n in (0, 1, 2, 3, 4, 5, 6, 7, 10)}

    # What is there already is not ridden again.
    before = rows_of(tmp_path / "history" / PACKAGE)
    again = velodrome("history", f"{PACKAGE}>=1.0,<1.4", "circle.toml", "--resume", "--json")
    assert statuses(again.json()) == {v: s for v, s in statuses(document).items() if v in ("1.0", "1.1", "1.2", "1.3")}
    assert rows_of(tmp_path / "history" / PACKAGE) == before

    halved = velodrome("history", f"{PACKAGE}>=1.0,<1.4", "circle.toml", "--bisect", "--out", "halved", "--json").json()
    assert halved["bisected"]
    assert [(point["since"], point["version"]) for point in halved["turning_points"]] == [("1.2", "1.3")]

    # Without a registry the cached releases are there, and a line says so.
    for wheel in registry.glob("*.whl"):
        wheel.unlink()
    offline = velodrome("history", f"{PACKAGE}>=1.0,<1.3", "circle.toml", "--out", "offline")
    assert offline.status == 0
    assert "the releases of wheelmill are not known" in offline.stderr
    assert "3 of them in the cache" in offline.stderr
    assert "1.0 to 1.2" in offline.stdout


def rows_of(out: Path) -> dict[str, tuple[int, bytes]]:
    """When each row was written, and its contents."""
    return {path.name: (path.stat().st_mtime_ns, path.read_bytes()) for path in (out / "rows").glob("[!.]*.json")}


def start_history(folder: Path, resume: bool) -> subprocess.Popen[str]:
    code = "from velodrome.scenarios.cli import main; main()"
    words = ["history", f"{PACKAGE}>=1", "circle.toml", "--out", "out", "--json", *(["--resume"] if resume else [])]
    return subprocess.Popen(
        [sys.executable, "-c", code, *words],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def children_of(pid: int) -> set[int]:
    """All processes that a process has started, and those that they have."""
    found: set[int] = set()
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        for child in task.read_text().split():
            found |= {int(child)} | children_of(int(child))
    return found


def is_ride_process(pid: int) -> bool:
    return b"velodrome.scenarios.history.ride" in read_command_line(pid)


def is_at_work(pid: int) -> bool:
    """Whether a process installs or rides a release."""
    return is_ride_process(pid) or b"\0install\0" in read_command_line(pid)


def are_gone(pids: set[int]) -> bool:
    """Whether ride processes end soon; one that is still loading notices afterwards that it is not needed."""
    give_up = time.monotonic() + 60
    while any(map(is_ride_process, pids)) and time.monotonic() < give_up:
        time.sleep(0.05)
    return not any(map(is_ride_process, pids))


def read_command_line(pid: int) -> bytes:
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""


@pytest.mark.slow
def test_ten_kills_lose_nothing_and_repeat_nothing(registry: Path, tmp_path: Path) -> None:
    for minor, stretch in enumerate((1.0, 1.0, ROUND_OFF, FAULT, FAULT, 1.0) * 2):
        make_wheel(registry, f"1.{minor}", stretch=stretch, before="time.sleep(0.2)")
    chance = random.Random(5)
    out, known, resume, hit = tmp_path / "out", dict[str, tuple[int, bytes]](), False, 0
    for _ in range(KILLS):
        process = start_history(tmp_path, resume)
        give_up = time.monotonic() + 120
        while not any(map(is_at_work, children_of(process.pid))) and process.poll() is None:
            assert time.monotonic() < give_up
            time.sleep(0.05)
        time.sleep(chance.uniform(0.0, 4.0))
        rides = {pid for pid in children_of(process.pid) if is_ride_process(pid)}
        hit += process.poll() is None
        process.kill()
        process.communicate()
        assert are_gone(rides), "a ride outlives its history"
        resume = (out / "rows").is_dir()
        now = rows_of(out) if resume else {}
        assert {name: now.get(name) for name in known} == known, "a finished ride was done again"
        known = now
    assert hit == KILLS, "the history was over before the last kill"
    text, errors = start_history(tmp_path, resume).communicate(timeout=300)
    document = json.loads(text)
    assert document["complete"], errors
    now = rows_of(out)
    assert {name: now[name] for name in known} == known
    assert {path.name.split("-")[1] for path in cached(tmp_path)} == {f"1.{n}" for n in range(12)}
    (tmp_path / "undisturbed").mkdir()
    (tmp_path / "undisturbed" / "circle.toml").write_text(CIRCLE, encoding="utf-8")
    text, _ = start_history(tmp_path / "undisturbed", False).communicate(timeout=300)
    assert json.loads(text) == document


def test_a_damaged_environment_is_made_again_and_the_suites_own_is_untouched(registry: Path, tmp_path: Path) -> None:
    from velodrome.scenarios.history import Children

    make_wheel(registry, "1.0")
    cache, children = tmp_path / "cache" / "releases", Children()
    installed = sorted((path, path.stat().st_mtime_ns) for path in (tmp_path / "installed").rglob("*.py"))

    def open_release() -> ReleaseEnvironment:
        with open_environment(Release(PACKAGE, "1.0"), cache, children) as found:
            return found

    made = open_release()
    wheel = registry / f"{PACKAGE}-1.0-py3-none-any.whl"
    assert made.packages == {PACKAGE: {"version": "1.0", "sha256": file_digest(wheel), "wheel": None}}
    module = made.folder / f"{PACKAGE}.py"
    whole = module.read_bytes()
    assert open_release() == made
    module.write_bytes(whole + b"# changed\n")
    assert replace(open_release(), installed=made.installed) == made
    assert module.read_bytes() == whole
    # What a killed process left behind is no environment, and is removed.
    (cache / f".making-{made.folder.name}-left").mkdir()
    module.unlink()
    open_release()
    assert [path.name for path in cache.iterdir() if not path.name.endswith(".lock")] == [made.folder.name]
    assert sorted((path, path.stat().st_mtime_ns) for path in (tmp_path / "installed").rglob("*.py")) == installed


@pytest.mark.slow
def test_a_row_counts_for_the_files_that_ride(velodrome, registry: Path, tmp_path: Path) -> None:
    make_package_wheel(registry, "wheelmill-core", "2.0", {"wheelmill_core.py": ""})
    wheel = make_wheel(registry, "1.0")
    build = make_wheel(tmp_path / "build", "1.1", requires="wheelmill-core")
    words = ("history", f"{PACKAGE}==1.0", "circle.toml", "--wheel", str(build), "--json")
    first = velodrome(*words).json()
    label = f"1.1 wheel {file_digest(build)[:8]}"
    assert [line for line in first["remarks"] if line.startswith(f"{label}: not of the given wheels")]
    rows = {row["version"]: row for row in first["releases"]}
    assert rows["1.0"]["packages"] == {PACKAGE: {"version": "1.0", "sha256": file_digest(wheel), "wheel": None}}
    assert {name: package["wheel"] for name, package in rows["1.1"]["packages"].items()} == {
        PACKAGE: build.name,
        "wheelmill-core": None,
    }
    # Other bytes of the same version ride when the cache has them, and not before.
    make_wheel(registry, "1.0", stretch=FAULT)
    assert velodrome(*words, "--resume").json() == first
    (environment,) = (path for path in cached(tmp_path) if "-wheel-" not in path.name)
    shutil.rmtree(environment)
    assert velodrome(*words, "--resume").json() == first  # what was ridden remains while nobody installs it again
    assert velodrome("history", f"{PACKAGE}==1.0", "circle.toml", "--out", "other").status == 0
    again = {row["version"]: row for row in velodrome(*words, "--resume").json()["releases"]}
    assert again["1.0"]["packages"][PACKAGE]["sha256"] == file_digest(wheel)
    assert again["1.0"]["bits"] != rows["1.0"]["bits"]
    assert again["1.1"]["bits"] == rows["1.1"]["bits"]


@pytest.mark.slow
def test_a_release_whose_environment_is_removed_is_tried_again(velodrome, registry: Path, tmp_path: Path) -> None:
    removing = "import shutil; shutil.rmtree(os.path.dirname(__file__)); import wheelmill_late"
    make_wheel(registry, "1.0", before=f"if not os.path.exists({str(tmp_path / 'once')!r}): {removing}")
    words = ("history", f"{PACKAGE}==1.0", "circle.toml", "--json")
    found = velodrome(*words)
    assert found.status == 1
    (row,) = found.json()["releases"]
    assert row["status"] == "not-installable"
    assert row["reason"].endswith("was removed while it rode")
    (tmp_path / "once").touch()
    assert [row["status"] for row in velodrome(*words, "--resume").json()["releases"]] == ["rode"]


def test_bad_input_is_one_line(velodrome, registry: Path, tmp_path: Path) -> None:
    make_wheel(registry, "1.0")
    make_wheel(registry, "1.5")
    (tmp_path / "used" / "rows").mkdir(parents=True)
    for words, told in (
        (["wheelmil==1.0"], "no installed engine is of the package 'wheelmil' (did you mean 'wheelmill'?)"),
        ([f"{PACKAGE}==1.2"], "no release fits ==1.2 on this platform; the nearest is 1.5"),
        ([f"{PACKAGE}>=2"], "no release fits >=2 on this platform; the nearest is 1.5"),
        ([PACKAGE], "name the releases too"),
        ([f"{PACKAGE}==1.0", "--engine", "exudyn"], "engine 'exudyn' is not of the package 'wheelmill'"),
        ([f"{PACKAGE}==1.0", "--engine", "exudyn-*"], "no engine of the package 'wheelmill' fits"),
        ([f"{PACKAGE}==1.0", "--engine", "wheelmil"], "did you mean 'wheelmill'?"),
        ([f"{PACKAGE}==1.0", "--wheel", "absent.whl"], "--wheel absent.whl: there is no such file"),
        ([f"{PACKAGE}==1.0", "circel"], "no scenario 'circel'"),
        ([f"{PACKAGE}==1.0", "circle.toml", "--resume", "--out", "empty"], "there is no history to resume"),
        ([f"{PACKAGE}==1.0", "circle.toml", "--out", "used"], "holds a history already"),
    ):
        found = velodrome("history", *words)
        assert found.status == 2, words
        assert told in found.stderr, found.stderr
        assert len(found.stderr.splitlines()) == 1, found.stderr
        assert found.stdout == ""
