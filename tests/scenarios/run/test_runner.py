"""A run folder: whole, reproducible, and kept whatever an engine does."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable
from dataclasses import asdict, replace
from datetime import date
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from altered import RAISED_AT, Altered, pressing_ctrl_c, raising

from tests.sealing import contents
from velodrome.engines.engine import REFERENCE, EngineError, Trajectory
from velodrome.engines.storage import read_trajectory
from velodrome.scenarios.error import ScenarioError
from velodrome.scenarios.run.folder import LIBRARIES, RunPlan, resolve_plan
from velodrome.scenarios.run.machine import describe_machine, find_commit
from velodrome.scenarios.run.runner import RunOutcome, configure_engine, plan_run, run_plan
from velodrome.scenarios.scenario.schema import Perturbation, load_scenario

NATIVE = "mujoco-native"
METRICS = {
    *(
        "position_error",
        "orientation_error",
        "rate_error",
        "rear_rate_error",
        "contact_force_error",
        "contact_force_error_at",
    ),
    *("radius_drift_rate", "phase_drift_rate", "rear_rate_drift_rate"),
    *("energy_drift", "energy_drift_rate", "energy_variation", "max_gap", "max_slip", "mean_slip"),
    *(
        "settled_force_error",
        "adaptations",
        "not_finite",
        "inconsistent_reports",
        "required_friction",
        "friction",
        "friction_left_at",
        "steps",
        "unconverged_steps",
        "largest_residual",
        "cpu_time",
        "real_time_factor",
        "min_normal_force",
        "fell_at",
        "ended",
        "horizon",
    ),
}


@cache
def plain() -> RunPlan:
    return plan(changes={})


def plan(name: str = "q2", changes: dict[str, Any] | None = None, engine: str = NATIVE) -> RunPlan:
    return plan_run(*load_scenario(name, {"simulation.duration": 0.1} | (changes or {})), wanted=[engine])


def with_engine(base: RunPlan, name: str, after: Callable[[Trajectory], Trajectory]) -> RunPlan:
    """The plan with one engine's result altered."""
    inner, settings = base.engines[name]
    return replace(base, engines=base.engines | {name: (Altered(inner, after=after), settings)})


def ridden(what: RunPlan, out: Path) -> tuple[RunOutcome, list[str]]:
    notes: list[str] = []
    return run_plan(what, out, lambda *_: None, notes.append), notes


def read(outcome: RunOutcome, name: str) -> Any:
    def refuse(constant: str) -> None:
        raise AssertionError(f"{name} holds {constant}")

    return json.loads((outcome.folder / name).read_text(), parse_constant=refuse)


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_a_run_folder_has_all_its_files(tmp_path: Path) -> None:
    outcome, notes = ridden(plain(), tmp_path)
    files = {"scenario.toml", "manifest.json", "metrics.json", "report.html", "comparison.rrd"}
    assert names(outcome.folder) == files | {"reference.parquet", "mujoco-native.parquet"}
    assert outcome.folder.parent == tmp_path
    assert notes == []
    assert (outcome.failures, outcome.verdicts, outcome.interrupted) == ({}, [], False)


def test_metrics_have_every_quantity_and_are_those_of_the_outcome(tmp_path: Path) -> None:
    outcome, _ = ridden(plain(), tmp_path)
    measured = contents(outcome.folder / "metrics.json")
    assert measured == outcome.metrics
    assert list(measured) == [REFERENCE, NATIVE]
    assert set(measured[REFERENCE]) == set(measured[NATIVE]) == METRICS
    assert measured[REFERENCE]["position_error"] is None
    assert measured[NATIVE]["position_error"]["max"] > 0


def test_the_manifest_says_what_ran_where_and_from_what(tmp_path: Path) -> None:
    what = plain()
    outcome, _ = ridden(what, tmp_path)
    manifest = read(outcome, "manifest.json")
    assert (manifest["scenario"], manifest["title"], manifest["complete"]) == ("q2", what.scenario.title, True)
    assert list(manifest["engines"]) == [REFERENCE, NATIVE]
    for name, entry in manifest["engines"].items():
        engine, settings = what.engines[name]
        assert entry["version"] == engine.version
        assert type(settings).model_validate(entry["settings"]) == settings
        assert entry["cpu_time"] == outcome.metrics[name]["cpu_time"]
    assert set(manifest["libraries"]) == set(LIBRARIES)
    assert manifest["suite"] == find_commit()
    assert manifest["platform"] == describe_machine()
    assert manifest["start"]["family"] == 2
    # Full precision: the state comes back to the bit.
    assert np.array_equal(manifest["start"]["q"], what.start.problem.q)
    assert np.array_equal(manifest["start"]["qd"], what.start.problem.qd)


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        (
            "q2-plus",
            {"engines.mujoco-native.step": 0.005, "engines.mujoco-native.impedance": [0.9, 0.95, 0.002, 0.5, 2.0]},
        ),
        ("other-bicycle", {}),
        ("waves-pushed", {"bicycle.trail": 0.07, "perturbation.x": 1 / 3}),
        ("iftomm-2", {"engines.exudyn.step": 0.002}),
    ],
)
def test_the_stored_scenario_is_resolved_and_the_same_problem_to_the_bit(
    name: str, changes: dict[str, Any], tmp_path: Path
) -> None:
    first = plan(name, changes)
    path = tmp_path / f"{name}.toml"
    path.write_text(tomli_w.dumps(resolve_plan(first).model_dump(exclude_none=True)))
    stated = tomllib.loads(path.read_text())
    assert stated["bicycle"] == asdict(first.start.problem.bicycle)
    assert set(stated["perturbation"]) == set(Perturbation.model_fields)
    again = plan_run(*load_scenario(str(path)), [NATIVE])
    a, b = first.start.problem, again.start.problem
    assert (a.bicycle, a.surface) == (b.bicycle, b.surface)
    for x, y in ((a.q, b.q), (a.qd, b.qd), (a.times, b.times)):
        assert x.tobytes() == y.tobytes()
    assert {engine: settings for engine, (_, settings) in again.engines.items()} == {
        engine: settings for engine, (_, settings) in first.engines.items()
    }
    for engine, (_, settings) in first.engines.items():
        given = settings.model_dump(mode="json", exclude_none=True)
        assert stated["engines"][engine] == given
    # Settings of an engine that does not ride stay as they are.
    assert stated["engines"].get("exudyn", {}) == first.scenario.engines.get("exudyn", {})


def test_the_stored_scenario_runs_again_to_the_same_bits(tmp_path: Path) -> None:
    first, _ = ridden(plan("q2-plus", {"engines.mujoco-native.step": 0.005}), tmp_path)
    name, scenario = load_scenario(str(first.folder / "scenario.toml"))
    again, _ = ridden(plan_run(name, scenario, [NATIVE]), tmp_path)
    for engine in (REFERENCE, NATIVE):
        a, b = (read_trajectory(outcome.folder / f"{engine}.parquet") for outcome in (first, again))
        assert np.array_equal(a.q, b.q)
        assert a.settings == b.settings


def test_an_older_run_is_never_touched(tmp_path: Path) -> None:
    what = plain()
    folders = [ridden(what, tmp_path)[0].folder for _ in range(3)]
    assert len(set(folders)) == 3
    assert all(len(names(folder)) == 7 for folder in folders)


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (EngineError("no contact at the start"), "no contact at the start"),
        (ZeroDivisionError("division by\nzero"), f"ZeroDivisionError: division by zero ({RAISED_AT})"),
        (MemoryError(), f"MemoryError: ({RAISED_AT})"),
    ],
)
def test_an_engine_that_breaks_costs_only_itself(error: Exception, words: str, tmp_path: Path) -> None:
    outcome, notes = ridden(with_engine(plain(), NATIVE, raising(error)), tmp_path)
    assert outcome.failures == {NATIVE: words}
    assert notes == [f"{NATIVE}: {words}"]
    assert set(outcome.metrics) == {REFERENCE}
    assert not outcome.interrupted
    manifest = read(outcome, "manifest.json")
    assert manifest["complete"]
    assert manifest["engines"][NATIVE]["failed"] == words
    assert "failed" not in manifest["engines"][REFERENCE]
    assert "mujoco-native.parquet" not in names(outcome.folder)
    assert {"reference.parquet", "comparison.rrd"} <= names(outcome.folder)


def test_without_a_reference_the_others_are_measured_by_themselves(tmp_path: Path) -> None:
    outcome, _ = ridden(with_engine(plain(), REFERENCE, raising(EngineError("broken"))), tmp_path)
    assert set(outcome.metrics) == {NATIVE}
    assert outcome.metrics[NATIVE]["position_error"] is None
    assert outcome.metrics[NATIVE]["max_slip"] > 0
    assert "comparison.rrd" in names(outcome.folder)


def test_when_all_break_the_folder_says_why(tmp_path: Path) -> None:
    broken = with_engine(plain(), REFERENCE, raising(EngineError("one")))
    outcome, _ = ridden(with_engine(broken, NATIVE, raising(EngineError("two"))), tmp_path)
    assert outcome.failures == {REFERENCE: "one", NATIVE: "two"}
    assert names(outcome.folder) == {"scenario.toml", "manifest.json", "metrics.json", "report.html"}
    assert contents(outcome.folder / "metrics.json") == {}


def test_ctrl_c_keeps_the_finished_engines_whole(tmp_path: Path) -> None:
    outcome, notes = ridden(with_engine(plain(), NATIVE, pressing_ctrl_c), tmp_path)
    assert outcome.interrupted
    assert notes == ["interrupted: finished engines are kept"]
    assert names(outcome.folder) == {
        *("scenario.toml", "manifest.json", "metrics.json", "report.html", "comparison.rrd", "reference.parquet")
    }
    assert len(read_trajectory(outcome.folder / "reference.parquet").time) == 11
    assert set(contents(outcome.folder / "metrics.json")) == {REFERENCE}
    manifest = read(outcome, "manifest.json")
    assert not manifest["complete"]
    assert "cpu_time" in manifest["engines"][REFERENCE]
    assert set(manifest["engines"][NATIVE]) == {"version", "settings"}


def test_ctrl_c_in_the_first_engine_leaves_a_folder_that_says_so(tmp_path: Path) -> None:
    outcome, _ = ridden(with_engine(plain(), REFERENCE, pressing_ctrl_c), tmp_path)
    assert outcome.interrupted
    assert names(outcome.folder) == {"scenario.toml", "manifest.json", "metrics.json", "report.html"}
    assert not read(outcome, "manifest.json")["complete"]


def cut(trajectory: Trajectory) -> Trajectory:
    """The trajectory's first half, ended early."""
    arrays = {k: v[:5] for k, v in vars(trajectory).items() if isinstance(v, np.ndarray)}
    return replace(trajectory, ended="Newton failed at 0.05 s", **arrays)


def test_an_engine_whose_clock_is_late_by_a_step_did_not_run(tmp_path: Path) -> None:
    def late(trajectory: Trajectory) -> Trajectory:
        skipped = np.arange(len(trajectory.time)) > 5
        return replace(trajectory, time=trajectory.time + 1e-3 * skipped)

    outcome, _ = ridden(with_engine(plain(), NATIVE, late), tmp_path)
    assert NATIVE not in outcome.metrics
    assert outcome.failures[NATIVE].startswith("its sample 6 is at 0.061 s by its own clock, not at the 0.06 s asked")


def test_steps_that_did_not_converge_are_told(tmp_path: Path) -> None:
    def unconverged(trajectory: Trajectory) -> Trajectory:
        return replace(trajectory, unconverged_steps=3, largest_residual=0.5)

    outcome, _ = ridden(with_engine(plain(), NATIVE, unconverged), tmp_path)
    assert outcome.metrics[NATIVE]["unconverged_steps"] == 3
    page = (outcome.folder / "report.html").read_text()
    told = "iterations that did not converge, so that figures are not those of the engine"
    assert re.search(rf"{told}\S+ equations: {NATIVE} in 3 of ", page)  # the apostrophe is escaped


def test_an_engine_that_ended_early_is_compared_as_far_as_it_came(tmp_path: Path) -> None:
    what = with_engine(plan("iftomm-2"), NATIVE, cut)
    outcome, _ = ridden(what, tmp_path)
    assert outcome.metrics[NATIVE]["ended"] == "Newton failed at 0.05 s"
    assert set(outcome.metrics[NATIVE]) == METRICS
    assert read(outcome, "manifest.json")["engines"][NATIVE]["ended"] == "Newton failed at 0.05 s"


def test_a_reference_that_ended_early_is_compared_with_as_far_as_it_came(tmp_path: Path) -> None:
    outcome, _ = ridden(with_engine(plain(), REFERENCE, cut), tmp_path)
    whole, _ = ridden(with_engine(plain(), NATIVE, cut), tmp_path)
    assert outcome.metrics[NATIVE]["position_error"] == whole.metrics[NATIVE]["position_error"]


def test_a_manoeuvre_that_ended_early_holds_no_verdict(tmp_path: Path) -> None:
    whole, _ = ridden(plan("iftomm-2"), tmp_path)
    short, _ = ridden(with_engine(plan("iftomm-2"), REFERENCE, cut), tmp_path)
    verdicts = [outcome.verdicts[0] for outcome in (whole, short)]
    # The energy is as good as far as it came, but the manoeuvre is not done.
    assert all(verdict["engine"] == REFERENCE and verdict["value"] < verdict["limit"] for verdict in verdicts)
    assert [verdict["holds"] for verdict in verdicts] == [True, False]


def test_a_bicycle_that_falls_is_said_to_and_holds_no_verdict(tmp_path: Path) -> None:
    # Nearly lying at a walking pace: it is down within the second, in the reference too.
    changes = {"motion.speed": 1.0, "perturbation.lean": 1.2, "simulation.duration": 0.6}
    outcome, _ = ridden(plan("iftomm-2", changes), tmp_path)
    assert set(outcome.metrics) == {REFERENCE, NATIVE}
    for name in outcome.metrics:
        assert 0 < outcome.metrics[name]["fell_at"] <= 0.6
    assert [verdict["holds"] for verdict in outcome.verdicts] == [False, False]


def test_the_criterion_is_the_energys_variation(tmp_path: Path) -> None:
    outcome, _ = ridden(plan("iftomm-2"), tmp_path)
    verdicts = {verdict["engine"]: verdict for verdict in outcome.verdicts}
    assert set(verdicts) == {REFERENCE, NATIVE}
    for name, verdict in verdicts.items():
        assert verdict["value"] == outcome.metrics[name]["energy_variation"]
        assert verdict["holds"] == (verdict["value"] < verdict["limit"] == 1e-3)
    assert verdicts[REFERENCE]["holds"]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"engines.warp.step": 0.1}, r"engine 'warp' is not installed \(there are reference"),
        ({"engines.mujoco-native.speed": 1}, r"engines.mujoco-native: unknown key 'speed' \(there are step"),
        ({"engines.mujoco-native.step": "0.002"}, "engines.mujoco-native.step: .* number"),
        ({"engines.mujoco-native.step": True}, "engines.mujoco-native.step: .* number"),
        ({"engines.mujoco-native.step": 0.003}, "engines.mujoco-native: step is 0.003; .* 0.0025"),
    ],
)
def test_a_bad_engine_table_never_reaches_the_engine(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(ScenarioError, match=words):
        plan(changes=changes)


def test_all_that_is_wrong_with_engines_is_said_whether_they_ride_or_not() -> None:
    changes = {
        "engines.mujoco-default.stepp": 0.1,
        "engines.exudyn.step": -1.0,
        "engines.exudyn.solvr": "x",
        "engines.reference.tolerance": 2,
    }
    with pytest.raises(ScenarioError) as caught:
        plan_run(*load_scenario("q2", changes), ["exudin", NATIVE])
    line = str(caught.value)
    for words in (
        "engine 'exudin' is not installed (did you mean 'exudyn'?)",
        "engines.reference.tolerance: Input should be less",
        "engines.mujoco-default: unknown key 'stepp' (did you mean 'step'?)",
        "engines.exudyn.step: Input should be greater",
        "engines.exudyn: unknown key 'solvr' (did you mean 'solver'?)",
    ):
        assert words in line
    assert line.count("; ") == 4


def test_only_wanted_engines_run_beside_the_reference() -> None:
    assert list(plan(engine=NATIVE).engines) == [REFERENCE, NATIVE]
    assert list(plan(engine=REFERENCE).engines) == [REFERENCE]
    with pytest.raises(ScenarioError, match="'warp' is not installed"):
        plan(engine="warp")


def test_arrays_and_dates_of_a_scenario_file_reach_an_engines_settings() -> None:
    impedance = [0.9, 0.95, 0.001, 0.5, 2.0]
    settings: Any = configure_engine(NATIVE, {"impedance": impedance})[1]
    assert settings.impedance == tuple(impedance)
    with pytest.raises(ScenarioError, match=r"engines\.mujoco-native\.step: .*2024-01-01"):
        configure_engine(NATIVE, {"step": date(2024, 1, 1)})
