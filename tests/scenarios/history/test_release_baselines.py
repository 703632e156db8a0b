"""`velodrome check --baseline-of`: a release as the baseline, and the release that history says moved something."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest
from mill import CIRCLE, FAULT, PACKAGE, install_mill, make_wheel, use_registry

pytestmark = pytest.mark.once  # pip and folders; `test_history_command` rides in environments

CHECK = ("check", "circle.toml", "--json", "--baseline-of")


@pytest.fixture
def registry(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A registry without any release yet, release 1.3 of the engine with a fault installed, and a short scenario."""
    install_mill(tmp_path / "installed", monkeypatch, "1.3", FAULT)
    # The module of the test before may be loaded still.
    monkeypatch.delitem(sys.modules, PACKAGE, raising=False)
    folder = tmp_path / "registry"
    use_registry(folder, monkeypatch)
    monkeypatch.setenv("VELODROME_CACHE", str(tmp_path / "cache"))
    (tmp_path / "circle.toml").write_text(CIRCLE, encoding="utf-8")
    return folder


def by_quantity(document: dict[str, Any]) -> dict[str, dict[str, Any]]:
    return {verdict["quantity"]: verdict for verdict in document["verdicts"]}


def test_a_release_is_the_baseline(velodrome, registry: Path, tmp_path: Path) -> None:
    make_wheel(registry, "1.0")
    there = {path.name for path in tmp_path.iterdir()}
    found = velodrome(*CHECK, f"{PACKAGE}==1.0")
    assert found.status == 1, found.stderr
    document = found.json()
    assert (document["baseline_of"], document["updated"]) == (f"{PACKAGE} 1.0", [])
    assert "exudyn" in document["of_other_packages"]
    assert PACKAGE not in document["of_other_packages"]
    verdicts = by_quantity(document)
    assert {verdict["engine"] for verdict in verdicts.values()} == {PACKAGE}
    moved = verdicts["position_error"]
    assert moved["status"] == "worse"
    # The fault turns the start's rates by 1e-4 of 18 rad/s for a second; the release's own error is far smaller.
    assert moved["value"] > moved["baseline"] + moved["limit"]
    assert moved["reason"].endswith(f"; since {PACKAGE} 1.0: version 1.0 -> 1.3")
    assert verdicts["settings"]["reason"] == f"since {PACKAGE} 1.0: version 1.0 -> 1.3"
    assert {path.name for path in tmp_path.iterdir()} == there | {"cache"}


@pytest.mark.slow
def test_builds_the_same_release_and_better_ones(velodrome, registry: Path, tmp_path: Path) -> None:
    make_wheel(registry, "1.3", FAULT)
    same = velodrome(*CHECK, f"{PACKAGE}==1.3")
    assert same.status == 0, same.stdout
    assert {verdict["status"] for verdict in same.json()["verdicts"]} <= {"holds", "shown"}
    assert "settings" not in by_quantity(same.json())
    # A build has the version of the installed release, and is another all the same: improvements pass.
    build = make_wheel(tmp_path / "build", "1.3", 1.0 + 1e-3)
    better = velodrome(*CHECK, PACKAGE, "--wheel", str(build))
    verdicts = by_quantity(better.json())
    assert verdicts["position_error"]["status"] == "better"
    assert f"version 1.3 of {PACKAGE} 1.3 wheel " in verdicts["settings"]["reason"]
    assert verdicts["settings"]["reason"].endswith(" -> 1.3")


@pytest.mark.slow
def test_history_knows_the_release_that_moved_it(velodrome, registry: Path, tmp_path: Path) -> None:
    for version, stretch in (("1.0", 1.0), ("1.1", 1.0), ("1.2", FAULT), ("1.3", FAULT)):
        make_wheel(registry, version, stretch)
    assert velodrome("history", f"{PACKAGE}>=1.0", "circle.toml").status == 0
    told = "; moved with wheelmill 1.2 (after 1.1), by the history of 1.0 to 1.3"
    for options in ((), ("--history", "history"), ("--history", f"history/{PACKAGE}")):
        verdicts = by_quantity(velodrome(*CHECK, f"{PACKAGE}==1.0", *options).json())
        assert verdicts["position_error"]["reason"].endswith(told), options
        assert all(told not in verdict["reason"] for verdict in verdicts.values() if verdict["status"] == "holds")
    # The text says the same, in words.
    shown = velodrome("check", "circle.toml", "--baseline-of", f"{PACKAGE}==1.0").stdout
    assert "the gate fails: " in shown
    assert f"circle: {PACKAGE}: since {PACKAGE} 1.0: version 1.0 -> 1.3\n" in shown
    # Another ride, or other settings, is none that the history knows.
    for change in (("duration = 1.0", "duration = 0.8"), ("[gate]", f"[engines.{PACKAGE}]\nstep = 0.002\n\n[gate]")):
        (tmp_path / "circle.toml").write_text(CIRCLE.replace(*change), encoding="utf-8")
        verdicts = by_quantity(velodrome(*CHECK, f"{PACKAGE}==1.0").json())
        assert verdicts["position_error"]["status"] == "worse"
        assert not any("moved with" in verdict["reason"] for verdict in verdicts.values())


@pytest.mark.slow
def test_a_release_without_a_ride_is_refused(velodrome, registry: Path) -> None:
    make_wheel(registry, "1.0", requires="numpy<1")
    make_wheel(registry, "1.1", before='raise UnsuitableProblem("it rides no circles")')
    for version, words in (
        ("1.0", "wheelmill 1.0 cannot be installed here: wheelmill needs numpy<1"),
        (
            "1.1",
            "1.1 gives no baseline: wheelmill on circle: with wheelmill 1.1 it did not ride (refused): it rides no",
        ),
    ):
        found = velodrome(*CHECK, f"{PACKAGE}=={version}")
        assert (found.status, found.stdout) == (2, "")
        assert words in found.stderr
        assert len(found.stderr.splitlines()) == 1


@pytest.mark.slow
def test_where_only_some_rides_fail_the_engine_has_no_baseline_there(velodrome, registry: Path, tmp_path: Path) -> None:
    make_wheel(registry, "1.0", before="if len(problem.times) == 41: 1 / 0")
    (tmp_path / "other.toml").write_text(CIRCLE.replace("duration = 1.0", "duration = 0.8"), encoding="utf-8")
    document = velodrome(*CHECK, f"{PACKAGE}==1.0", "other.toml").json()
    (verdict,) = [one for one in document["verdicts"] if one["scenario"] == "other"]
    assert (verdict["quantity"], verdict["status"], verdict["passes"]) == ("run", "missing", False)
    assert verdict["reason"].startswith("no baseline: with wheelmill 1.0 it did not ride (failed): ")
    assert "ZeroDivisionError" in verdict["reason"]


def test_options_that_do_not_go_together_are_one_line(velodrome, registry: Path, tmp_path: Path) -> None:
    make_wheel(registry, "1.0")
    build = make_wheel(tmp_path / "build", "1.0")
    (tmp_path / "empty").mkdir()
    release = f"{PACKAGE}==1.0"
    for words, told in (
        (["--baseline-of", release, "--update"], "it writes no baselines; give it without --update"),
        (["--baseline-of", release, "--baselines", "own"], "give it without --baselines"),
        (["--baseline-of", release, "--hold-cpu"], "give it without --hold-cpu"),
        (["--baseline-of", f"{PACKAGE}>=1.0"], "must be one release, such as 'wheelmill==1.0'"),
        (["--baseline-of", f"{PACKAGE}==1.0,1.1"], "must be one release"),
        (["--baseline-of", PACKAGE], "must be one release"),
        (["--baseline-of", f"{PACKAGE}==1.7"], "no release fits ==1.7 on this platform; the nearest is 1.0"),
        (["--baseline-of", release, "--wheel", str(build)], "name the package alone, wheelmill"),
        (["--baseline-of", release, "--engine", "exudyn"], "engine 'exudyn' is not of the package 'wheelmill'"),
        (["--baseline-of", "wheelmil==1.0"], "did you mean 'wheelmill'?"),
        (["--wheel", str(build)], "it belongs to --baseline-of"),
        (["--history", "empty"], "--history empty: holds no history"),
        (["--history", "absent"], "--history absent: holds no history"),
    ):
        if "--baselines" in words:
            (tmp_path / "own").mkdir()
        found = velodrome("check", "circle.toml", *words)
        assert (found.status, found.stdout) == (2, ""), words
        assert told in found.stderr, found.stderr
        assert len(found.stderr.splitlines()) == 1, found.stderr
