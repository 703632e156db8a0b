"""`velodrome run --release`: an ordinary run folder of a release that rides in an environment of its own."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from mill import CIRCLE, PACKAGE, install_mill, make_wheel, use_registry

from velodrome.engines.storage import read_trajectory

pytestmark = pytest.mark.once  # pip and folders; `test_history_command` rides in environments

RUN = ("run", "circle.toml", "--json", "--release")


@pytest.fixture
def registry(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A registry without any release yet, release 1.0 of the engine installed, a short scenario, and an empty cache."""
    install_mill(tmp_path / "installed", monkeypatch)
    # The module of the test before may be loaded still.
    monkeypatch.delitem(sys.modules, PACKAGE, raising=False)
    folder = tmp_path / "registry"
    use_registry(folder, monkeypatch)
    monkeypatch.setenv("VELODROME_CACHE", str(tmp_path / "cache"))
    (tmp_path / "circle.toml").write_text(CIRCLE, encoding="utf-8")
    return folder


def test_a_run_with_another_release_is_a_run_folder_like_any_other(velodrome, registry: Path, tmp_path: Path) -> None:
    make_wheel(registry, "1.3")
    found = velodrome(*RUN, f"{PACKAGE}==1.3", "--out", "released", "--set", "engines.wheelmill.step=0.002")
    assert found.status == 0, found.stderr
    (run,) = found.json()["runs"]
    assert (run["release"], run["failures"], [*run["engines"]]) == (f"{PACKAGE} 1.3", {}, ["reference", PACKAGE])
    folder = Path(run["folder"])
    assert folder.parent == Path("released")
    manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    assert manifest["engines"][PACKAGE]["version"] == manifest["libraries"][PACKAGE] == "1.3"
    assert manifest["engines"][PACKAGE]["settings"] == {"step": 0.002}
    assert (manifest["release"]["package"], manifest["release"]["release"]) == (PACKAGE, "1.3")
    assert manifest["release"]["packages"][PACKAGE]["version"] == "1.3"
    assert read_trajectory(folder / f"{PACKAGE}.parquet").version == "1.3"
    assert (folder / "comparison.rrd").is_file()


def test_what_is_no_release_that_can_run_is_one_line(velodrome, registry: Path, tmp_path: Path) -> None:
    make_wheel(registry, "1.0")
    make_wheel(registry, "1.1", requires="numpy<1")
    build = make_wheel(tmp_path / "build", "1.0")
    for words, told in (
        (["--release", f"{PACKAGE}==1.7"], "no release fits ==1.7 on this platform; the nearest is 1.1"),
        (["--release", f"{PACKAGE}>=1"], f"--release '{PACKAGE}>=1': must be one release"),
        (["--release", f"{PACKAGE}==1.0", "--wheel", str(build)], f"name the package alone, {PACKAGE}"),
        (["--release", "wheelmil==1.0"], "did you mean 'wheelmill'?"),
        (["--release", f"{PACKAGE}==1.0", "--engine", "exudyn"], "engine 'exudyn' is not of the package 'wheelmill'"),
        (["--release", f"{PACKAGE}==1.1"], f"--release: {PACKAGE} 1.1 cannot be installed here: wheelmill needs numpy"),
        (["--wheel", str(build)], "--wheel: it belongs to --release"),
        (["--release", f"{PACKAGE}==1.0", "--set", "simulation.duration=-1"], "simulation.duration"),
    ):
        found = velodrome("run", "circle.toml", *words)
        assert (found.status, found.stdout) == (2, ""), words
        assert told in found.stderr, found.stderr
        assert len(found.stderr.splitlines()) == 1, found.stderr
    assert not (tmp_path / "runs").exists()


def test_without_a_registry_a_release_that_is_not_cached_is_one_line(velodrome, registry: Path) -> None:
    found = velodrome(*RUN, f"{PACKAGE}==1.0")
    assert (found.status, found.stdout) == (2, "")
    assert f"--release: {PACKAGE} 1.0 cannot be installed here: No matching distribution" in found.stderr
    assert len(found.stderr.splitlines()) == 1, found.stderr


@pytest.mark.slow
def test_a_release_that_refuses_crashes_or_loads_from_elsewhere(velodrome, registry: Path, tmp_path: Path) -> None:
    make_wheel(registry, "1.1", checking='raise UnsuitableProblem("it rides no circles")')
    make_wheel(registry, "1.2", before="os.abort()")
    make_wheel(registry, "1.3", before="1 / 0")
    stray = tmp_path / "stray.py"
    stray.write_text("")
    replaced = (
        "import sys, importlib.util as u; s = u.spec_from_file_location('wheelmill.stray', "
        f"{str(stray)!r}); sys.modules['wheelmill.stray'] = u.module_from_spec(s)"
    )
    make_wheel(registry, "1.4", before=replaced)
    for named in ((), ("--engine", PACKAGE)):
        refused = velodrome(*RUN, f"{PACKAGE}==1.1", *named)
        assert (refused.status, refused.stdout) == (2, "")
        assert f"circle.toml: --release {PACKAGE} 1.1: " in refused.stderr
        assert refused.stderr.endswith("it rides no circles\n")
        assert len(refused.stderr.splitlines()) == 1
    crashed = velodrome(*RUN, f"{PACKAGE}==1.2")
    assert (crashed.status, crashed.stdout) == (1, "")
    assert "the process of the run ended by SIGABRT before it was done" in crashed.stderr
    failed = velodrome(*RUN, f"{PACKAGE}==1.3", "--traceback")
    assert failed.status == 1
    assert "ZeroDivisionError" in failed.json()["runs"][0]["failures"][PACKAGE]
    assert "Traceback (most recent call last)" in failed.stderr
    wrong = velodrome(*RUN, f"{PACKAGE}==1.4")
    assert wrong.status == 1
    (run,) = wrong.json()["runs"]
    assert "wheelmill.stray was loaded from" in run["failures"][PACKAGE]
    assert [*run["engines"]] == ["reference"]


@pytest.mark.slow
def test_ctrl_c_ends_the_engine_that_runs_and_keeps_the_others(registry: Path, tmp_path: Path) -> None:
    make_wheel(registry, "1.1", before="time.sleep(1000)")
    code = "from velodrome.scenarios.cli import main; main()"
    process = subprocess.Popen(
        [sys.executable, "-c", code, *RUN, f"{PACKAGE}==1.1"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    give_up = time.monotonic() + 120
    while not [*tmp_path.glob("runs/*/reference.parquet")] and process.poll() is None:
        assert time.monotonic() < give_up
        time.sleep(0.1)
    time.sleep(1.0)  # the engine's turn
    process.send_signal(signal.SIGINT)
    output, errors = process.communicate(timeout=120)
    assert process.returncode == 130, errors
    assert "interrupted: finished engines are kept" in errors
    (run,) = json.loads(output)["runs"]
    assert (run["complete"], [*run["engines"]], run["failures"]) == (False, ["reference"], {})
    assert (tmp_path / run["folder"] / "comparison.rrd").is_file()
