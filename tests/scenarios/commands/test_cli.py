"""The command: documents for programs, one line for bad input, the right exit status."""

from __future__ import annotations

import io
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from altered import Altered, pressing_ctrl_c, raising
from rich.console import Console
from stored_documents import stored

from tests.literature import published, rounds_to
from tests.sealing import contents
from velodrome.engines import registry
from velodrome.engines.engine import Engine, EngineError, Settings, Trajectory
from velodrome.engines.registry import engine_names, load_engine, uninstalled_engines
from velodrome.engines.releases import LibraryReach
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.families import find_motion
from velodrome.reference.surface import Paraboloid
from velodrome.scenarios import cli, gate
from velodrome.scenarios.commands.present_motions import show_circular, show_families
from velodrome.scenarios.gate.verdict import Verdict, missing_verdict
from velodrome.scenarios.run import runner
from velodrome.scenarios.scenario.schema import library_names

COMMAND = Path(sys.executable).with_name("velodrome")
XIONG = published("xiong2020")
Q2 = ("--alpha", "0.005", "--rear-rate", "18")


def test_list_names_every_scenario_and_engine(velodrome) -> None:
    result = velodrome("list", "--json")
    assert (result.status, result.stderr) == (0, "")
    found = result.json()
    assert [entry["name"] for entry in found["scenarios"]] == library_names()
    assert all(entry["title"] and entry["tags"] for entry in found["scenarios"])
    there = [entry for entry in found["engines"] if "install" not in entry]
    assert [entry["name"] for entry in there] == engine_names()
    absent = {entry["name"]: entry["install"] for entry in found["engines"] if "install" in entry}
    assert absent == uninstalled_engines()
    for entry in there:
        assert entry["version"] == load_engine(entry["name"]).version
        assert entry["gives"] == list(load_engine(entry["name"]).gives)
    table = velodrome("list")
    assert table.status == 0
    assert all(name in table.stdout for name in [*library_names(), *engine_names()])


def test_list_says_which_engines_do_not_ride_with_the_installed_release(
    velodrome, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(LibraryReach, "version", property(lambda self: "3.2.0" if self.package == "mujoco" else "99"))
    found = {entry["name"]: entry for entry in velodrome("list", "--json").json()["engines"]}
    assert found["mujoco-multipliers"]["error"].startswith("mujoco-multipliers needs MuJoCo 3.3.1 or newer")
    assert "error" not in found["mujoco-native"]
    assert "needs MuJoCo 3.3.1 or newer" in " ".join(velodrome("list").stdout.split())


CIRCULAR_FIELDS = {
    *("alpha", "family", "inputs", "rear_rate", "front_rate", "yaw_rate", "lean", "steer", "pitch", "position"),
    *("contact_point", "contact_force", "normal_force", "energy", "residual", "eigenvalues", "jacobian"),
    *("lyapunov_stable", "stable_within", "no_bound_because", "physical", "unphysical_because", "required_friction"),
}


@pytest.mark.parametrize("name", ["P1", "P2", "P3", "P4"])
def test_circular_rounds_to_the_printed_points(name: str, velodrome) -> None:
    point = XIONG[name]
    where = ("--alpha", str(point["alpha"]), "--rear-rate", str(point["rear_rate"]))
    result = velodrome("circular", *where, "--near", f"{point['lean']},{point['steer']}", "--json")
    assert (result.status, result.stderr) == (0, "")
    found = result.json()
    assert found["family"] == point["family"]
    for field in ("lean", "steer", "front_rate"):
        assert rounds_to(found[field], point[field]), field
    assert found["residual"] <= 1e-12
    assert not found["lyapunov_stable"]


@pytest.mark.parametrize(("name", "stable"), [("Q1", False), ("Q2", True)])
def test_circular_rounds_to_the_printed_eigenvalues(name: str, stable: bool, velodrome) -> None:
    point = XIONG[name]
    result = velodrome("circular", *Q2, "--family", str(point["family"]), "--json")
    assert (result.status, result.stderr) == (0, "")
    found = result.json()
    values = [*found["position"][:2], found["lean"], found["steer"], 0, 0, found["rear_rate"]]
    assert all(rounds_to(value, printed) for value, printed in zip(values, point["v"], strict=True))
    printed = [complex(text.replace("i", "j")) for text in point["eigenvalues"]]
    assert found["eigenvalues"] == sorted(found["eigenvalues"])
    for real, imaginary in found["eigenvalues"]:
        nearest = min(printed, key=lambda value: abs(value - complex(real, imaginary)))
        printed.remove(nearest)
        # Printed to two decimals.
        assert abs(real - nearest.real) <= 0.005
        assert abs(imaginary - nearest.imag) <= 0.005
    assert found["residual"] <= 1e-12
    assert (found["lyapunov_stable"], found["physical"]) == (stable, True)


def test_circular_has_exactly_its_fields_in_full_precision(velodrome) -> None:
    found = velodrome("circular", *Q2, "--family", "2", "--json").json()
    assert set(found) == CIRCULAR_FIELDS | {"schema_version", "bicycle", "warnings"}
    _, motion = find_motion(Bicycle(), Paraboloid(0.005), 18.0, 2)
    for field in ("front_rate", "yaw_rate", "lean", "steer", "pitch", "residual"):
        assert found[field] == getattr(motion, field), field
    assert found["position"] == motion.position.tolist()
    assert found["contact_force"] == {"rear": motion.force[0].tolist(), "front": motion.force[1].tolist()}
    assert {len(row) for row in found["jacobian"]} == {len(found["jacobian"])} == {7}
    assert len(found["eigenvalues"]) == 7
    for wheel in ("rear", "front"):
        x, y, z = found["contact_point"][wheel]
        assert z == pytest.approx(0.005 * (x * x + y * y), abs=1e-14)
        assert found["normal_force"][wheel] > 0
    # Vertical forces carry the weight: 94 kg at 9.81 m/s^2; the residual is in weights.
    assert sum(found["contact_force"][wheel][2] for wheel in ("rear", "front")) == pytest.approx(94 * 9.81, rel=1e-11)


def test_circular_tells_people_the_same(velodrome) -> None:
    result = velodrome("circular", *Q2, "--family", "2")
    assert result.status == 0
    for words in (
        "0.737443",
        "-12.2844",
        "Lyapunov stable: small disturbances die out; --within finds how large they may be",
        "it can be ridden: rolling needs a coefficient of friction of 0.9592",
    ):
        assert words in result.stdout


@pytest.mark.slow
def test_circular_searches_within_what_it_is_stable(velodrome) -> None:
    """A circle of family 4; `tests/reference/bifurcations` compares such with their section's."""
    where = ("--alpha", "0.005", "--rear-rate", "11.103300308685844", "--near", "0.4789,2.6150", "--within")
    found = velodrome("circular", *where, "--json").json()
    assert found["family"] == 4
    assert found["stable_within"] == pytest.approx(0.00397302, rel=1e-6)
    assert found["no_bound_because"] is None


@pytest.mark.parametrize(
    ("bound", "why", "words"),
    [
        (0.00397302, None, "Lyapunov stable, within 0.003973 rad (0.228 deg) of lean"),
        (None, "no orbit", "small disturbances die out; it is not known how large they may be: no orbit"),
    ],
)
def test_circular_says_within_what_it_is_stable(bound: float | None, why: str | None, words: str) -> None:
    file = io.StringIO()
    show_circular(Console(file=file, width=120), stored("circular") | {"stable_within": bound, "no_bound_because": why})
    assert words in file.getvalue()


def test_an_unstable_circle_has_no_bound(velodrome) -> None:
    found = velodrome("circular", *Q2, "--family", "1", "--within", "--json").json()
    assert (found["stable_within"], found["no_bound_because"]) == (None, "the motion is not Lyapunov stable")


SHORT = ("--duration", "0.1", "--engine", "mujoco-native", "--out", "out")


def test_run_as_json_is_one_document_and_the_rest_goes_to_stderr(velodrome, tmp_path: Path) -> None:
    result = velodrome("run", "q2", "iftomm-2", "q2", *SHORT, "--set", "perturbation.lean_rate=0.2", "--json")
    found = result.json()
    assert [entry["scenario"] for entry in found["runs"]] == ["q2", "iftomm-2"]  # each once
    for entry in found["runs"]:
        assert set(entry) == {
            "scenario",
            "release",
            "folder",
            "complete",
            "engines",
            "failures",
            "left_out",
            "verdicts",
        }
        folder = tmp_path / entry["folder"]
        assert entry["engines"] == contents(folder / "metrics.json")
        assert "lean_rate = 0.2" in (folder / "scenario.toml").read_text()
    assert "reference" in result.stderr
    # Status 1 if and only if a verdict falls short.
    holds = all(verdict["holds"] for entry in found["runs"] for verdict in entry["verdicts"])
    assert result.status == (0 if holds else 1)


def test_run_shows_a_table_and_where_things_are(velodrome, tmp_path: Path) -> None:
    result = velodrome("run", "q2", *SHORT)
    assert (result.status, result.stderr) == (0, "")
    (folder,) = (tmp_path / "out").iterdir()
    for words in (
        "q2: Q2, a stable circular motion",
        "mujoco-native",
        f"out/{folder.name}",
        "velodrome view",
        "report.html",
    ):
        assert words in result.stdout


def test_run_by_tag_takes_all_that_have_it(velodrome) -> None:
    result = velodrome("run", "--tag", "stable", "--engine", "mujoco-native", *SHORT, "--json")
    names = ["edge", "other-bicycle", "plane-circle", "q2", "q2-minus", "q2-plus", "sphere"]
    assert [entry["scenario"] for entry in result.json()["runs"]] == names
    assert result.status == 0


def breaking(after: Callable[[Trajectory], Trajectory], monkeypatch: pytest.MonkeyPatch) -> None:
    """Make mujoco-native break in every run."""

    def configure(name: str, values: Any, any_release: bool = False) -> tuple[Engine, Settings]:
        engine, settings = original(name, values, any_release=any_release)
        return (Altered(engine, after=after) if name == "mujoco-native" else engine), settings

    original = runner.configure_engine
    monkeypatch.setattr(runner, "configure_engine", configure)


def test_an_engine_that_breaks_is_status_1(velodrome, monkeypatch: pytest.MonkeyPatch) -> None:
    breaking(raising(EngineError("the solver diverged")), monkeypatch)
    result = velodrome("run", "q2", *SHORT, "--json")
    (entry,) = result.json()["runs"]
    assert (result.status, entry["complete"]) == (1, True)
    assert entry["failures"] == {"mujoco-native": "the solver diverged"}
    assert "the solver diverged" in result.stderr


def test_ctrl_c_is_status_130_and_ends_all_runs(velodrome, monkeypatch: pytest.MonkeyPatch) -> None:
    breaking(pressing_ctrl_c, monkeypatch)
    result = velodrome("run", "q2", "q2-plus", *SHORT, "--json")
    assert result.status == 130
    (entry,) = result.json()["runs"]
    assert entry["complete"] is False
    assert list(entry["engines"]) == ["reference"]
    assert "Traceback" not in result.stderr


RUN = ("run", "q2", "--out", "out")
CIRCULAR = ("circular", "--alpha", "0.005")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("fly",), ["fly"]),
        (("list", "--jason"), ["--jason"]),
        (("list", "q2"), ["q2"]),
        (("run", "--out", "out"), ["nothing to run", "--tag"]),
        (("run", "q3", "--out", "out"), ["'q3'", "q2-plus", ".toml"]),
        (("run", "none.toml", "--out", "out", "--json"), ["none.toml", "No such file"]),
        (("run", "q2", "q3", "--out", "out"), ["'q3'"]),
        (("run", "--tag", "fast", "--out", "out"), ["fast", "gated"]),
        ((*RUN, "--engine", "warp"), ["q2", "'warp'", "exudyn"]),
        ((*RUN, "--duration", "0"), ["duration", "0.0"]),
        ((*RUN, "--duration", "-1"), ["duration", "-1.0"]),
        ((*RUN, "--duration", "nan"), ["duration", "nan"]),
        ((*RUN, "--duration", "soon"), ["--duration"]),
        ((*RUN, "--duration", "0.105"), ["0.105", "0.01 s"]),
        ((*RUN, "--set", "duration"), ["--set duration", "KEY=VALUE"]),
        ((*RUN, "--set", "=5"), ["--set =5", "KEY=VALUE"]),
        ((*RUN, "--set", "simulation..duration=5"), ["KEY=VALUE"]),
        ((*RUN, "--set", "simulation.duration=soon"), ["simulation.duration", "'soon'"]),
        ((*RUN, "--set", "simulation.speed=5"), ["'speed'", "output_rate"]),
        ((*RUN, "--set", "title.x=5"), ["title.x", "no table"]),
        ((*RUN, "--set", "engines.exudyn.step=0.003"), ["q2", "engines.exudyn", "0.0025"]),
        ((*RUN, "--set", "engines.exudyn.stepp=0.001"), ["engines.exudyn", "'stepp'", "step"]),
        ((*RUN, "--set", "surface.alpha=-1"), ["surface.alpha", "-1"]),
        ((*RUN, "--set", "perturbation.lean=3"), ["q2", "below the ground"]),
        (("run", "q2", "--duration", "0.1", "--out", "file"), ["file", "cannot be made"]),
        (("run", "q2", "--duration", "0.1", "--out", ""), ["--out: it is empty; name a folder"]),
        (("bicycle", "--out="), ["--out: it is empty; name a folder"]),
        ((*RUN, "--set", "tags=x"), ["tags: must be a list of texts (it is 'x')"]),
        (("run", "q2", "--duration", "0.1", "--out", "file/x"), ["file/x", "cannot be made"]),
        (CIRCULAR, ["--rear-rate"]),
        ((*CIRCULAR, "--rear-rate", "18"), ["family", "near"]),
        ((*CIRCULAR, "--rear-rate", "0", "--family", "2"), ["rear rate", "0.0", "positive"]),
        ((*CIRCULAR, "--rear-rate", "nan", "--family", "2"), ["--rear-rate", "10000"]),
        ((*CIRCULAR, "--rear-rate", "1e300", "--family", "2"), ["--rear-rate", "10000"]),
        ((*CIRCULAR, "--rear-rate", "18", "--family", "5"), ["family", "5", "1, 2, 3 or 4"]),
        ((*CIRCULAR, "--rear-rate", "18", "--near", "0.7"), ["--near 0.7", "LEAN,STEER"]),
        ((*CIRCULAR, "--rear-rate", "18", "--near", "a,b"), ["--near a,b", "LEAN,STEER"]),
        ((*CIRCULAR, "--rear-rate", "18", "--near", "nan,1"), ["near", "finite"]),
        (("circular", "--alpha", "nan", "--rear-rate", "18", "--family", "2"), ["alpha", "nan"]),
        (("circular", "--alpha", "-1", "--rear-rate", "18", "--family", "2"), ["alpha", "-1.0"]),
        (("circular", "--alpha", "flat", "--rear-rate", "18", "--family", "2"), ["--alpha"]),
    ],
    ids=" ".join,
)
def test_bad_input_is_one_line_and_leaves_nothing(
    arguments: tuple[str, ...], words: list[str], velodrome, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("in the way")
    result = velodrome(*arguments)
    assert (result.status, result.stdout) == (2, "")
    assert result.stderr.startswith("velodrome: ")
    assert result.stderr.count("\n") == 1
    assert result.stderr.endswith("\n")
    for word in words:
        assert word in result.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_a_folder_is_no_scenario_file(velodrome, tmp_path: Path) -> None:
    (tmp_path / "dir.toml").mkdir()
    result = velodrome("run", "dir.toml")
    assert (result.status, result.stderr) == (2, "velodrome: dir.toml: cannot be read: it is a folder\n")


def test_no_arguments_show_the_commands(velodrome) -> None:
    result = velodrome()
    assert result.status == 0
    assert all(command in result.stdout for command in ("list", "run", "circular", "check"))


def judged(monkeypatch: pytest.MonkeyPatch, *verdicts: Verdict) -> None:
    """Make the gate come to these verdicts."""
    monkeypatch.setattr(gate, "check_gate", lambda *_: ([("q2", verdict) for verdict in verdicts], {"q2": {}}))


WORSE = Verdict("exudyn", "short_error", 2e-5, 1e-5, 1e-7, "worse", "1e-05 -> 2e-05")


@pytest.mark.parametrize(
    ("status", "passes"),
    [("holds", True), ("better", True), ("new", False), ("changed", False), ("worse", False), ("missing", False)],
)
def test_check_is_status_1_when_a_verdict_fails(
    status: str, passes: bool, velodrome, monkeypatch: pytest.MonkeyPatch
) -> None:
    verdict = Verdict("exudyn", "short_error", 2e-5, 1e-5, 1e-7, status, "1e-05 -> 2e-05")
    judged(monkeypatch, verdict)
    result = velodrome("check", "--json")
    found = result.json()
    assert (result.status, found["passes"], found["updated"]) == (0 if passes else 1, passes, [])
    assert found["verdicts"] == [{"scenario": "q2"} | verdict.as_json()]
    table = velodrome("check")
    assert table.status == result.status
    assert ("the gate holds" in table.stdout) == passes
    if not passes:
        assert "q2: exudyn: short_error: " in table.stdout


def test_update_writes_no_baseline_of_an_engine_that_did_not_run(velodrome, monkeypatch: pytest.MonkeyPatch) -> None:
    judged(monkeypatch, missing_verdict("exudyn", "did not run: no licence"))
    monkeypatch.setattr(gate, "update_baselines", lambda *_: pytest.fail("written"))
    result = velodrome("check", "--update")
    assert (result.status, result.stdout) == (2, "")
    assert "exudyn did not run: no licence" in result.stderr


def test_update_accepts_what_has_become_worse(velodrome, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    judged(monkeypatch, WORSE)
    monkeypatch.setattr(gate, "update_baselines", lambda fresh, *_: [tmp_path / f"{name}.json" for name in fresh])
    result = velodrome("check", "--update", "--json")
    assert result.status == 0
    assert result.json()["updated"] == [str(tmp_path / "q2.json")]


def test_check_writes_its_verdicts_for_a_ci_service(velodrome, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    judged(monkeypatch, WORSE)
    junit, markdown, page = tmp_path / "gate.xml", tmp_path / "gate.md", tmp_path / "gate.html"
    files = ["--junit", str(junit), "--markdown", str(markdown), "--page", str(page)]
    assert velodrome("check", *files).status == 1
    assert "Drift gate: fails" in page.read_text(encoding="utf-8")
    assert 'failures="1"' in junit.read_text(encoding="utf-8")
    assert markdown.read_text(encoding="utf-8").startswith("# Drift gate: fails")
    result = velodrome("check", "--junit", str(tmp_path / "nowhere" / "gate.xml"))
    assert (result.status, result.stdout) == (2, "")


@pytest.mark.parametrize("option", ["--junit", "--markdown", "--page"])
def test_check_refuses_a_file_without_a_folder_before_its_work(
    velodrome, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, option: str
) -> None:
    monkeypatch.setattr(gate, "check_gate", lambda *_: pytest.fail("the gate ran"))
    for path, words in (("absent/x.xml", "there is no folder absent"), (str(tmp_path), "it is a folder; name a file")):
        result = velodrome("check", option, path)
        assert (result.status, result.stderr) == (2, f"velodrome: {option} {path}: {words}\n")


def test_check_refuses_an_absent_folder_of_baselines_before_its_work(
    velodrome, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(gate, "check_gate", lambda *_: pytest.fail("the gate ran"))
    result = velodrome("check", "--baselines", "nope")
    words = "--baselines nope: there is no such folder; with --update it is made"
    assert (result.status, result.stdout, result.stderr) == (2, "", f"velodrome: {words}\n")
    judged(monkeypatch, WORSE)
    monkeypatch.setattr(gate, "update_baselines", lambda fresh, *_: [tmp_path / f"{name}.json" for name in fresh])
    assert velodrome("check", "--baselines", "nope", "--update").status == 0


def test_two_engines_of_one_name_get_one_line(velodrome, monkeypatch: pytest.MonkeyPatch) -> None:
    words = "engine 'aaa' is announced by two packages, one and other; uninstall one of them"

    def refuse() -> None:
        raise ValueError(words)

    monkeypatch.setattr(registry, "_find_entry_points", refuse)
    for command in (("list",), ("run", "q2"), ("check",), ("precision", "q2"), ("diff", "a", "b")):
        result = velodrome(*command)
        assert (result.status, result.stderr) == (2, f"velodrome: {words}\n"), command


def test_check_judges_what_it_is_asked_for(velodrome, tmp_path: Path) -> None:
    arguments = ("check", "q2", "--engine", "mujoco-multipliers", "--baselines", str(tmp_path / "own"))
    (tmp_path / "own").mkdir()
    first = velodrome(*arguments)
    assert first.status == 1
    assert "mujoco-multipliers: run: new: no baseline yet" in first.stdout
    assert first.stdout.endswith("no verdict, without a baseline yet: mujoco-multipliers\n")
    result = velodrome(*arguments, "--update", "--reason", "the first of its kind", "--json")
    assert (result.status, result.json()["updated"]) == (0, [str(tmp_path / "own" / "q2.json")])
    assert json.loads((tmp_path / "own" / "q2.json").read_text())["reason"] == "the first of its kind"
    assert re.search(r"mujoco-multipliers +18 of 18 +0\.96 +[\d.]+  nothing moved", velodrome(*arguments).stdout)
    again = velodrome(*arguments, "--update")
    assert again.status == 0
    assert again.stdout.endswith("no baseline written: nothing moved beyond its limit\n")
    for wrong, words in (
        (("q2", "--engine", "warp"), "engine 'warp' is not installed"),
        (("--reason", "none"), "--reason: it belongs to --update"),
    ):
        result = velodrome("check", *wrong)
        assert (result.status, words in result.stderr) == (2, True), wrong


def test_an_engine_that_is_not_made_for_a_ground_is_left_out_or_refused(velodrome) -> None:
    everything = ("--duration", "0.1", "--out", "out")
    found = velodrome("run", "q2", *everything, "--json").json()["runs"][0]
    assert "exudyn-builtin" not in found["engines"]
    assert found["left_out"] == {"exudyn-builtin": "it rolls on the level plane only; exudyn rides on any surface"}
    assert found["failures"] == {}
    result = velodrome("run", "q2", *everything, "--engine", "exudyn-builtin")
    assert (result.status, "rolls on the level plane only" in result.stderr) == (2, True)
    assert "exudyn-builtin" in velodrome("run", "plane-circle", *everything, "--json").json()["runs"][0]["engines"]


def test_the_installed_command_starts_and_minds_a_closed_pipe() -> None:
    for arguments in (["list"], ["list", "--json"]):
        with subprocess.Popen([COMMAND, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
            assert process.stdout is not None
            assert process.stderr is not None
            process.stdout.close()
            assert process.stderr.read() == b""
        assert process.returncode == 0


def test_a_real_interrupt_ends_a_real_run_in_order(tmp_path: Path) -> None:
    # 60 s of exudyn are 15 s of work: it is under way when the reference's file is there.
    arguments = ["run", "q2", "--duration", "60", "--engine", "exudyn", "--out", str(tmp_path), "--json"]
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    # A background job inherits SIGINT ignored, and so would the command.
    listening = "import os, signal, sys; signal.signal(2, signal.SIG_DFL); os.execv(sys.argv[1], sys.argv[1:])"
    words = [sys.executable, "-c", listening]
    with subprocess.Popen(
        [*words, COMMAND, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
    ) as process:
        give_up = time.monotonic() + 60
        while not list(tmp_path.glob("*/reference.parquet")):
            assert process.poll() is None
            assert time.monotonic() < give_up
            time.sleep(0.05)
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
        stdout, stderr = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Traceback" not in stderr
    (entry,) = json.loads(stdout)["runs"]
    assert entry["complete"] is False
    assert list(entry["engines"]) == ["reference"]
    files = {"scenario.toml", "manifest.json", "metrics.json", "comparison.rrd", "report.html", "reference.parquet"}
    assert {path.name for path in Path(entry["folder"]).iterdir()} == files


def test_families_is_one_document_with_every_family(velodrome, tmp_path: Path) -> None:
    result = velodrome("families", "--alpha", "0.005", "--out", "found", "--json")
    assert (result.status, result.stderr) == (0, "")
    document = result.json()
    assert document == json.loads((tmp_path / "found" / "families.json").read_text())
    assert (tmp_path / "found" / "families.png").stat().st_size > 10_000
    assert [family["family"] for family in document["families"]] == [1, 2, 3, 4]
    for family in document["families"]:
        lengths = {name: len(values) for name, values in family["points"].items()}
        assert len(set(lengths.values())) == 1, lengths
        assert {"rear_rate", "radius", "energy", "lyapunov_stable", "normal_force_front"} <= set(lengths)
        assert any(family["points"]["lyapunov_stable"]) == bool(family["stable_sections"])
    assert document["families"][1]["special_points"]["D"]["kind"] == "cusp"
    console = Console(file=io.StringIO(), width=120)
    show_families(console, document)
    assert isinstance(console.file, io.StringIO)
    table = console.file.getvalue()
    assert all(f"family {number}: " in table for number in (1, 2, 3, 4))
    assert "Lyapunov stable: rear rate 15.276263732 rad/s (hopf) to 19.314284863 rad/s (hopf)" in table


@pytest.mark.slow
def test_families_say_within_what_their_circles_are_stable(velodrome) -> None:
    families = velodrome("families", "--alpha", "0.005", "--within", "--json").json()["families"]
    bifurcations = velodrome("bifurcations", "--alpha", "0.005", "--json").json()["stable_sections"]
    known = {section.pop("family"): section for section in bifurcations}
    assert set(known) == {2, 4}
    for family in families:
        for section in family["stable_sections"]:
            for name, values in section["within"].items():
                assert values == pytest.approx(known[family["family"]][name], abs=1e-9), name
    assert [len(family["stable_sections"]) for family in families] == [0, 1, 0, 1]


def test_families_refuses_a_shape_that_is_none(velodrome, tmp_path: Path) -> None:
    result = velodrome("families", "--alpha", "-1", "--out", "found")
    assert (result.status, result.stdout) == (2, "")
    assert "alpha is -1.0" in result.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("arguments", "unwanted"),
    [
        (["--help"], ("numpy", "numba", "scipy", "pyarrow", "matplotlib", "mujoco", "exudyn", "rerun")),
        (
            ["circular", *Q2, "--family", "2", "--json"],
            (
                *("pyarrow", "matplotlib", "mujoco", "exudyn", "rerun", "scipy.optimize", "scipy.integrate"),
                *("velodrome.reference.atlas", "velodrome.reference.critical", "velodrome.scenarios.motions.families"),
                *("velodrome.scenarios.commands.present_motions", "scipy.linalg", "numba.np.linalg"),
            ),
        ),
    ],
)
def test_a_command_imports_only_what_it_needs(arguments: list[str], unwanted: tuple[str, ...]) -> None:
    """What a command waits for before it starts: counted in imports, since a machine's seconds vary."""
    script = "import sys\nfrom velodrome.scenarios import cli\n"
    script += f"sys.argv[1:] = {arguments!r}\ntry:\n    cli.main()\nfinally:\n"
    script += f"    print([name for name in {unwanted!r} if name in sys.modules], file=sys.stderr)"
    command = [sys.executable, "-c", script]
    # The first time it may compile kernels, for which numba needs more.
    subprocess.run(command, capture_output=True, check=True)
    result = subprocess.run(command, capture_output=True, text=True, check=True)
    assert result.stderr.strip() == "[]"


def test_the_parameters_of_the_command_that_runs_are_inspected_only() -> None:
    assert [command.name for command in cli._choose_app(["circular", "--help"]).registered_commands] == ["circular"]
    for arguments in (["--help"], ["circles"], ["--version"]):
        assert cli._choose_app(arguments) is cli.app


def test_bifurcations_of_a_family(velodrome, tmp_path: Path) -> None:
    result = velodrome("bifurcations", "--alpha", "0.02", "--family", "2", "--out", "found", "--json")
    assert result.status == 0
    document = result.json()
    assert document == json.loads((tmp_path / "found" / "bifurcations.json").read_text())
    for name in ("bifurcations.png", "orbit-tracks.png"):
        assert (tmp_path / "found" / name).stat().st_size > 10_000
    ends = [point for point in document["hopf"] if point["ends_stable_section"]]
    assert [point["criticality"] for point in ends] == ["subcritical", "supercritical"]
    assert document["hopf"][:2] == ends
    for point in ends:
        sizes = [orbit["lean_amplitude"] for orbit in point["orbits"]]
        assert sizes[:2] == pytest.approx([0.001, 0.005])
        for orbit in point["orbits"]:
            assert len(orbit["multipliers"]) == len(orbit["state"]) == 7
            assert orbit["multipliers"][:2] == [pytest.approx([1, 0], abs=1e-8)] * 2
    (section,) = document["stable_sections"]
    assert len(section["rear_rate"]) == len(section["stable_within"])
    assert all(bound > 0 for bound in section["stable_within"])


def test_bifurcations_on_the_plane_say_why_they_are_undefined(velodrome) -> None:
    result = velodrome("bifurcations", "--alpha", "0", "--family", "2", "--json")
    assert result.status == 0
    first = result.json()["hopf"][0]
    assert first["ends_stable_section"]
    assert first["criticality"] is first["amplitude_slope"] is first["amplitude_slope_error"] is None
    assert "circle's centre is free" in first["undefined_because"]
    assert first["orbits"] == []


def test_bifurcations_refuse_a_step_of_no_engine(velodrome) -> None:
    result = velodrome("bifurcations", "--alpha", "0.005", "--step", "0.01")
    assert (result.status, result.stdout) == (2, "")
    assert "--engine" in result.stderr


def test_bifurcations_of_a_family_that_is_not_there(velodrome) -> None:
    result = velodrome("bifurcations", "--alpha", "0.005", "--family", "7")
    assert (result.status, result.stdout) == (2, "")
    assert "--family" in result.stderr
