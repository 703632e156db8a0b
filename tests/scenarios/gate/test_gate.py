"""Seeded faults: each must close the gate, with the engine and the quantity named."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from altered import RAISED_AT, Altered, raising
from gating import (
    Chosen,
    altered,
    compute_starts_once,
    failing,
    measure_rides_only,
    set_to,
    verdicts_of,
    verdicts_on,
)
from numba import cfunc

from velodrome.engines.admission import ride_engine
from velodrome.engines.engine import REFERENCE, Engine, EngineError, Problem, Settings, Trajectory
from velodrome.engines.exudyn import joint
from velodrome.engines.lagrange import LagrangeSettings
from velodrome.engines.mujoco import compiled
from velodrome.engines.registry import default_engines, load_engine
from velodrome.reference.kinematics import LEAN, PITCH, STEER
from velodrome.reports.measure.inspection import relative_differences
from velodrome.scenarios.error import ScenarioError
from velodrome.scenarios.gate import checks as gate
from velodrome.scenarios.gate import sample as gate_sample
from velodrome.scenarios.gate.exact import find_exact, scale_of
from velodrome.scenarios.gate.verdict import ABSOLUTE, HELD_CPU, RIDE_QUANTITIES, SHOWN, Verdict
from velodrome.scenarios.run.runner import configure_engine
from velodrome.scenarios.scenario import EngineChoice, engine_settings
from velodrome.scenarios.scenario.schema import LIBRARY, Gate, Perturbation, Scenario, load_scenario
from velodrome.scenarios.scenario.start import make_start

NAMES = default_engines()  # those of extras: test_gate_extras
# Exudyn's rides take the longest: by default one of its engines stands for all, on a plane, in a bowl and over waves.
LONG = ("exudyn", "exudyn-plane-normal", "exudyn-builtin")
FEW = ("plane-circle", "q2-plus", "waves-pushed")
REPEATED = [
    *((name, None) for name in NAMES if name not in LONG),
    ("exudyn", FEW),
    *(pytest.param(name, None, marks=pytest.mark.slow) for name in NAMES if name in LONG),
]
FALLS = "mujoco-default"
FIXED_STEP = {
    "exudyn": 0.002,
    "exudyn-plane-normal": 0.002,
    "mujoco-exact-contact": 0.004,
    "mujoco-multipliers": 0.004,
    "mujoco-native": 0.004,
}  # twice their baselines'


@pytest.fixture(autouse=True)
def one_start(monkeypatch: pytest.MonkeyPatch) -> None:
    compute_starts_once(monkeypatch)


@pytest.fixture
def rides_only(monkeypatch: pytest.MonkeyPatch) -> None:
    measure_rides_only(monkeypatch)


def gated_with(engine: str, few: tuple[str, ...] | None = None) -> list[str]:
    """Gated scenarios that have a baseline of an engine; only those named, if some are, which must have one."""
    found = [name for name in gate.gated_names() if engine in gate.read_baseline(name)]
    assert few is None or set(few) <= set(found)
    return found if few is None else list(few)


def expected_quantities(scenario: str, engine: str, verdicts: list[Verdict]) -> set[str]:
    """What must be judged of an engine on a scenario."""
    _, loaded = load_scenario(scenario)
    plan = loaded.gate or Gate()
    circles = loaded.motion.kind == "circular"
    expected = {*RIDE_QUANTITIES} - (set() if circles else {"radius_drift_rate", "phase_drift_rate"})
    if any(verdict.quantity == "fell_at" for verdict in verdicts):
        assert engine == FALLS
        return expected
    expected -= {"fell_at"}
    # On a disturbed ride the errors of the reference's steps are below the start's, and those of the exact contact may
    # be below what its solver leaves; then its baseline has none either.
    known = gate.read_baseline(scenario)[engine]["quantities"]["observed_order"] if plan.order else None
    unseen = disturbed(loaded) if engine == REFERENCE else engine == "mujoco-exact-contact" and known is None
    if plan.order and not unseen:
        expected |= {"observed_order"}
    if plan.eigenvalues and circles:
        expected |= {"eigenvalue_error", "growth_rate_error"}
    return expected


def disturbed(scenario: Scenario) -> bool:
    return scenario.perturbation != Perturbation()


@pytest.mark.parametrize(("name", "few"), REPEATED)
def test_a_clean_repeat_passes_in_every_quantity(name: str, few: tuple[str, ...] | None) -> None:
    for scenario, verdicts in verdicts_of(name, scenarios=gated_with(name, few)).items():
        judged = [verdict for verdict in verdicts if verdict.status != "shown"]
        assert {verdict.status for verdict in judged} == {"holds"}, scenario
        assert {verdict.quantity for verdict in judged} == expected_quantities(scenario, name, judged), scenario
        assert {verdict.quantity for verdict in verdicts} - {verdict.quantity for verdict in judged} <= set(SHOWN)
        assert any(verdict.quantity == "cpu_ratio" for verdict in verdicts)


@pytest.mark.usefixtures("rides_only")
def test_an_engine_that_no_gated_motion_suits_fails_only_if_it_was_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    ((_, verdict),) = gate.check_gate(lambda *_: None, ["q2"], ["exudyn-builtin"])[0]
    assert (verdict.status, "rolls on the level plane only" in verdict.reason) == ("missing", True)
    monkeypatch.setattr(engine_settings, "default_engines", lambda: ["reference", "exudyn-builtin"])
    monkeypatch.setattr(gate, "read_baseline", lambda *_: {})
    assert {verdict.engine for _, verdict in gate.check_gate(lambda *_: None, ["q2"])[0]} == {"reference"}
    monkeypatch.setattr(engine_settings, "default_engines", lambda: ["exudyn-builtin"])
    with pytest.raises(ScenarioError, match="nothing was judged"):
        gate.check_gate(lambda *_: None, ["q2"])


def test_engines_with_long_rides_ride_what_is_declared_and_what_has_a_baseline() -> None:
    declared = gate.gate_scenarios()
    assert {scenario for names in declared.values() for scenario in names} <= {*gate.gated_names()}
    choice = EngineChoice(("reference", "mjx"), frozenset())
    riding = {name: gate._choose_for_scenario(choice, name, {}).names for name in ("iftomm-2", "p1")}
    assert riding == {"iftomm-2": ("reference", "mjx"), "p1": ("reference",)}
    assert gate._choose_for_scenario(choice, "p1", {"mjx": {}}).names == choice.names


def test_engines_with_a_baseline_and_without_their_library_are_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    missing = {"drake-native": "pip install drake", "mjx": "pip install mjx", "other": "pip install other"}
    monkeypatch.setattr(gate, "uninstalled_engines", lambda: missing)
    assert gate.list_left_out() == {name: missing[name] for name in ("drake-native", "mjx")}
    assert list(gate.list_left_out(sources=["p1"])) == ["drake-native"]
    known = {"p1": gate.read_baseline("p1")}
    assert "drake-native" not in gate._engines_to_judge(None, known).names


@pytest.mark.usefixtures("rides_only")
@pytest.mark.parametrize(("name", "few"), REPEATED)
def test_round_off_of_the_start_stays_far_inside_the_limits(name: str, few: tuple[str, ...] | None) -> None:
    # What another processor's last digits do: a tenth of the limits where they are what iterations leave, half where
    # they are round-off themselves.
    rng = np.random.default_rng(3)

    def shaken(problem: Problem) -> Problem:
        noise = 1 + 2.0**-52 * rng.uniform(-4, 4, (2, 9))
        return replace(problem, q=problem.q * noise[0], qd=problem.qd * noise[1])

    for scenario, verdicts in verdicts_of(name, altered(before=shaken), gated_with(name, few)).items():
        for verdict in verdicts:
            # What is held absolutely does not move, and a step may be accepted or not at the very tolerance.
            if verdict.quantity in (*ABSOLUTE, "steps", *SHOWN):
                assert verdict.passes
                continue
            assert verdict.share is not None
            most = 0.5 if scenario != "q2" or name in ("reference", "mujoco-multipliers") else 0.1
            assert verdict.share < most, (scenario, verdict.quantity)


def with_front_wheel(factor: float) -> Chosen:
    """An engine whose front wheel has another inertia."""

    def heavier(problem: Problem) -> Problem:
        wheel = problem.bicycle
        # Both moments, or the wheel would be no rigid body: a thin ring's spin inertia is the sum of the others.
        changed = replace(
            wheel, front_wheel_Iyy=factor * wheel.front_wheel_Iyy, front_wheel_Ixx=factor * wheel.front_wheel_Ixx
        )
        return replace(problem, bicycle=changed)

    return altered(before=heavier)


# Both directions where the fault may cancel part of the engine's own error.
@pytest.mark.usefixtures("rides_only")
@pytest.mark.parametrize(
    ("name", "factor"),
    [(name, factor) for name in ("reference", *FIXED_STEP) for factor in (0.999, 1.001)],
)
def test_a_thousandth_of_the_front_wheels_inertia_fails(name: str, factor: float) -> None:
    fails = failing(verdicts_on(name, with_front_wheel(factor)))
    # The exact circle is another one; MuJoCo's creep hides the change of the drifts of radius and wheel.
    assert {"short_error", "phase_drift_rate"} <= fails


@pytest.mark.usefixtures("rides_only")
@pytest.mark.parametrize("name", FIXED_STEP)
def test_a_coarser_step_fails_and_is_named(name: str) -> None:
    verdicts = verdicts_on(name, set_to(step=FIXED_STEP[name]))
    moved = {verdict.quantity: verdict for verdict in verdicts if not verdict.passes}
    # The exact contact's ride is right to 1e-9 m at either step, which round-off in its solver may cost as well.
    expected = {"steps"} if name == "mujoco-exact-contact" else {"steps", "short_error", "radius_drift_rate"}
    assert expected <= set(moved)
    for quantity in expected:
        assert f"-> {FIXED_STEP[name]!r}" in moved[quantity].reason


@pytest.mark.usefixtures("rides_only")
@pytest.mark.parametrize("name", ["reference", "mujoco-native"])
def test_a_trajectory_late_by_a_sample_fails(name: str) -> None:
    def late(trajectory: Trajectory) -> Trajectory:
        return replace(trajectory, q=np.vstack([trajectory.q[:1], trajectory.q[:-1]]))

    assert "short_error" in failing(verdicts_on(name, altered(after=late)))


@pytest.mark.usefixtures("rides_only")
def test_a_flipped_sign_in_one_row_of_a_jacobian_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    original = joint.make_constraint_functions

    def flipped(*arguments: Any) -> Any:
        constraint, jacobian = original(*arguments)

        def wrong(*inputs: Any) -> np.ndarray:
            rows = np.array(jacobian(*inputs))
            rows[1] *= -1  # the lateral slip of the first wheel
            return rows

        return constraint, wrong

    monkeypatch.setattr(joint, "make_constraint_functions", flipped)
    assert failing(verdicts_on("exudyn"))


@pytest.mark.usefixtures("rides_only")
def test_a_dropped_acceleration_of_the_contacts_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    # Exudyn's own start leaves out (W q')_q q', and the contact forces of the first steps with it.
    fails = failing(verdicts_on("exudyn", set_to(start="engine")))
    assert "contact_force_error" in fails
    # MuJoCo's rows leave out J' q' unless they are corrected, and the wheels creep.
    monkeypatch.setattr(compiled, "control", uncorrected)
    assert {"max_slip", "mean_slip", "short_error"} <= failing(verdicts_on("mujoco-exact-contact"))


@cfunc(compiled.CONTROL, error_model="numpy")
def uncorrected(_model, _data) -> None:
    """A control callback that does nothing."""


@pytest.mark.usefixtures("rides_only")
@pytest.mark.parametrize("name", ["mujoco-native", "mujoco-exact-contact"])
def test_less_friction_fails(name: str) -> None:
    # Below the 0.96 that the circle needs, so that the wheels slide.
    fails = failing(verdicts_on(name, set_to(friction=0.9)))
    assert {"max_slip", "energy_drift"} & fails


@pytest.mark.usefixtures("rides_only")
def test_another_fall_fails() -> None:
    verdicts = {verdict.quantity: verdict for verdict in verdicts_on(FALLS, set_to(friction=0.99))}
    assert not verdicts["fell_at"].passes
    assert "friction 1.0 -> 0.99" in verdicts["fell_at"].reason


@pytest.mark.usefixtures("rides_only")
def test_numbers_that_are_none_fail() -> None:
    def blown_up(trajectory: Trajectory) -> Trajectory:
        q = trajectory.q.copy()
        q[50:] = np.nan
        return replace(trajectory, q=q)

    (verdict,) = verdicts_on("reference", altered(after=blown_up))
    assert (verdict.quantity, verdict.reason) == ("run", "did not run: its state is not finite at 1 s")


@pytest.mark.usefixtures("rides_only")
@pytest.mark.parametrize(
    ("after", "words"),
    [
        (raising(EngineError("no contact at the start")), "did not run: no contact at the start"),
        (raising(ZeroDivisionError("by zero")), f"did not run: ZeroDivisionError: by zero ({RAISED_AT})"),
        (lambda trajectory: replace(trajectory, ended="Newton failed at 0.5 s"), "did not run: Newton failed at 0.5 s"),
    ],
)
def test_an_engine_that_does_not_get_through_fails(after: Callable[[Trajectory], Trajectory], words: str) -> None:
    (verdict,) = verdicts_on("reference", altered(after=after))
    assert (verdict.quantity, verdict.status, verdict.reason) == ("run", "missing", words)


def with_state(change: Callable[[np.ndarray, np.ndarray, np.ndarray], None]) -> Chosen:
    """An engine whose coordinates and rates are changed in place, given the times."""

    def after(trajectory: Trajectory) -> Trajectory:
        q, qd = trajectory.q.copy(), trajectory.qd.copy()
        change(trajectory.time, q, qd)
        return replace(trajectory, q=q, qd=qd)

    return altered(after=after)


def later(since: float, part: str, column: int, by: float, turning: float = 0.0) -> Chosen:
    """A coordinate or rate off by so much from a time on, or by so much of a sine."""

    def change(time: np.ndarray, q: np.ndarray, qd: np.ndarray) -> None:
        shape = np.sin(turning * time) if turning else 1.0
        (q if part == "q" else qd)[:, column] += np.where(time > since, by * shape, 0.0)

    return with_state(change)


LATE = {
    "lean": later(0.7, "q", LEAN, 1e-4),
    "pitch": later(1.7, "q", PITCH, 1e-4),
    "height": later(1.01, "q", 2, 1e-4),
    "steer rate": later(0.7, "qd", STEER, 1e-3),
    "a wobble after the first second": later(1.01, "q", 0, 1e-3, turning=12.0),
}


@pytest.mark.usefixtures("rides_only")
@pytest.mark.parametrize("what", LATE)
@pytest.mark.parametrize("name", ["reference", "exudyn", "mujoco-multipliers", "mujoco-native"])
def test_no_coordinate_can_leave_the_motion_unseen(name: str, what: str) -> None:
    assert {"state_error", "position_error"} & failing(verdicts_on(name, LATE[what]))


@pytest.mark.usefixtures("rides_only")
@pytest.mark.parametrize("name", ["reference", "exudyn", "mujoco-native"])
def test_what_an_engine_reports_must_follow_from_its_state(name: str) -> None:
    def field(name: str, change: Callable[[np.ndarray], np.ndarray]) -> Chosen:
        return altered(after=lambda run: replace(run, **{name: change(getattr(run, name))}))

    for wrong in (
        field("gap", lambda gap: gap + 0.05),
        field("slip", lambda slip: slip + 1e-3),
        field("contact_point", lambda point: point + 0.05),
        field("body_position", lambda position: position + 0.1),
        field("body_quaternion", lambda quaternion: quaternion * [1, -1, -1, -1]),
        field("kinetic_energy", lambda energy: 3 * energy),
    ):
        assert "report_mismatch" in failing(verdicts_on(name, wrong))


@pytest.mark.usefixtures("rides_only")
@pytest.mark.parametrize("name", ["exudyn-plane-normal", "mujoco-native"])
def test_a_wrong_first_force_hides_no_other(name: str) -> None:
    def weaker(trajectory: Trajectory) -> Trajectory:
        assert trajectory.contact_force is not None
        force = trajectory.contact_force.copy()
        force[1:] *= 0.99
        return replace(trajectory, contact_force=force)

    assert "settled_force_error" in failing(verdicts_on(name, altered(after=weaker)))


@pytest.mark.usefixtures("rides_only")
def test_what_is_not_finite_fails_and_is_no_baseline() -> None:
    def holed(trajectory: Trajectory) -> Trajectory:
        assert trajectory.contact_force is not None
        late = trajectory.time[:, None, None] > 2
        return replace(trajectory, contact_force=np.where(late, np.nan, trajectory.contact_force))

    (verdict,) = verdicts_on("reference", altered(after=holed))
    assert verdict.reason == "did not run: not finite in some samples: contact_force"


@pytest.mark.usefixtures("rides_only")
def test_looser_iterations_get_no_more_room() -> None:
    # The gravity's fault is 5e-5 m after a second: within what a tolerance of 1e-6 a step could leave.
    def heavier(problem: Problem) -> Problem:
        return replace(problem, bicycle=replace(problem.bicycle, gravity=1.0001 * problem.bicycle.gravity))

    def chosen(name: str, values: Mapping[str, Any]) -> tuple[Engine, Settings]:
        engine, settings = configure_engine(name, {**values, "tolerance": 1e-6})
        return Altered(engine, heavier), settings

    verdicts = verdicts_on("mujoco-exact-contact", chosen)
    assert "short_error" in failing(verdicts)
    assert "-> 1e-06" in verdicts[0].reason


def test_another_motion_of_the_same_name_is_not_held_against_the_baseline(tmp_path: Path) -> None:
    text = (LIBRARY / "q2.toml").read_text(encoding="utf-8").replace("rear_rate = 18.0", "rear_rate = 17.5")
    (tmp_path / "q2.toml").write_text(text, encoding="utf-8")
    with pytest.raises(ScenarioError, match=r"q2\.json: not the baseline of this q2: its motion"):
        gate.check_gate(lambda *_: None, [str(tmp_path / "q2.toml")])


def stored(entries: dict[str, Any], folder: Path) -> None:
    (folder / "q2.json").write_text(json.dumps({"engines": entries}))


def test_an_engine_of_the_baseline_that_is_gone_fails(tmp_path: Path) -> None:
    stored({"warp": {"version": "1", "settings": {}, "quantities": {}}}, tmp_path)
    ((scenario, verdict),) = gate.check_gate(lambda *_: None, ["q2"], ["warp"], tmp_path)[0]
    assert (scenario, verdict.status, verdict.quantity) == ("q2", "missing", "run")
    assert "did not run: engine 'warp' is not installed" in verdict.reason


def test_an_engine_that_is_nowhere_is_refused() -> None:
    with pytest.raises(ScenarioError, match=r"'warp' is not installed \(there are reference"):
        gate.check_gate(lambda *_: None, ["q2"], ["warp"])


def test_a_scenario_that_the_reference_does_not_ride_to_its_end_is_refused(tmp_path: Path) -> None:
    text = (LIBRARY / "waves-pushed.toml").read_text(encoding="utf-8").replace("duration = 1.6", "duration = 9.6")
    (tmp_path / "further.toml").write_text(text, encoding="utf-8")
    with pytest.raises(ScenarioError, match=r"further: the reference ends at \d\.\d+ s: .* the ground ends"):
        gate.check_gate(lambda *_: None, [str(tmp_path / "further.toml")], ["reference"])


def test_a_disturbed_ride_is_held_against_the_references_with_its_known_error() -> None:
    start = make_start(load_scenario("q2-plus", {"simulation.duration": 2.0})[1])
    exact = find_exact(start)
    # At a tolerance of 1e-13 a step, and some 70 of them.
    assert 1e-14 < exact.error < 70 * 1e-13
    finest = ride_engine(load_engine(REFERENCE), start.problem, LagrangeSettings(tolerance=1e-15), lambda _: None)
    apart = relative_differences(exact.trajectory, finest, scale_of(start))
    assert np.abs(apart).max() < exact.error
    # An undisturbed circle is known in closed form.
    circle = find_exact(make_start(load_scenario("q2", {"simulation.duration": 2.0})[1]))
    assert (circle.error, circle.trajectory.steps) == (0.0, 0)


def test_an_engine_that_cannot_any_more_fails_where_it_could(tmp_path: Path) -> None:
    stored({"exudyn-builtin": {"version": "1", "settings": {}, "quantities": {}}}, tmp_path)
    ((_, verdict),) = gate.check_gate(lambda *_: None, ["q2"], ["exudyn-builtin"], tmp_path)[0]
    assert (verdict.status, verdict.passes) == ("missing", False)
    assert "rolls on the level plane only" in verdict.reason


def test_an_engine_without_a_baseline_is_new(tmp_path: Path) -> None:
    stored({}, tmp_path)
    ((_, verdict),) = gate.check_gate(lambda *_: None, ["q2"], ["reference"], tmp_path)[0]
    assert (verdict.engine, verdict.status) == ("reference", "new")
    assert not verdict.passes
    assert "no baseline" in verdict.reason


@pytest.mark.parametrize("content", ["", "{", "{}", "[]", "3", '{"engines": 3}', '{"engines": {"exudyn": {}}}'])
def test_a_damaged_baseline_is_refused_by_name(content: str, tmp_path: Path) -> None:
    (tmp_path / "q2.json").write_text(content)
    with pytest.raises(ScenarioError, match=r"q2\.json: not a baseline"):
        gate.read_baseline("q2", tmp_path)


@pytest.mark.usefixtures("rides_only")
def test_updated_baselines_hold_the_next_run(tmp_path: Path) -> None:
    folder = tmp_path / "baselines"

    def check(chosen: Chosen, engine: str = "mujoco-native") -> tuple[list[tuple[str, Verdict]], dict[str, Any]]:
        return gate.check_gate(lambda *_: None, ["q2"], [engine], folder, chosen)

    verdicts, fresh = check(set_to(step=0.004))
    (path,) = gate.update_baselines(fresh, verdicts, None, folder)
    document = json.loads(path.read_text())
    assert path == folder / "q2.json"
    assert document["reason"] == "mujoco-native: new"
    assert document["libraries"]["mujoco"] == document["engines"]["mujoco-native"]["version"]
    assert document["engines"]["mujoco-native"]["settings"]["step"] == 0.004
    assert {verdict.status for _, verdict in check(set_to(step=0.004))[0]} == {"holds", "shown"}
    # And the step that was right before is a change now; an error that it halves is an improvement.
    statuses = {verdict.quantity: verdict.status for _, verdict in check(configure_engine)[0]}
    assert (statuses["short_error"], statuses["energy_drift"], statuses["steps"]) == ("better", "better", "changed")
    assert statuses["settings"] == "holds"
    # Another engine's update leaves this one alone, and somebody's words stand as they are.
    verdicts, fresh = check(configure_engine, "mujoco-multipliers")
    gate.update_baselines(fresh, verdicts, "a second engine", folder)
    document = json.loads(path.read_text())
    assert (document["reason"], set(document["engines"])) == (
        "a second engine",
        {"mujoco-multipliers", "mujoco-native"},
    )


@pytest.mark.usefixtures("rides_only")
def test_an_update_writes_only_entries_that_changed(tmp_path: Path) -> None:
    engines, path = ["mujoco-native", "mujoco-multipliers"], tmp_path / "q2.json"

    def update(step: float, wanted: list[str]) -> list[Path]:
        verdicts, fresh = gate.check_gate(lambda *_: None, ["q2"], wanted, tmp_path, set_to(step=step))
        # Other CPU times and another day: of a run that is otherwise the same.
        for entry in fresh["q2"]["engines"].values():
            entry["quantities"]["cpu_ratio"] *= 1.5
            entry["created"] = "2000-01-01"
        return gate.update_baselines(fresh, verdicts, None, tmp_path)

    assert update(0.004, engines) == [path]
    first = path.read_text()
    assert update(0.004, engines) == []
    assert path.read_text() == first
    # Another step moves what is held; the entry that was not run, or did not move, stays to the letter.
    entries = json.loads(first)["engines"]
    changed = entries | {"mujoco-multipliers": entries["mujoco-multipliers"] | {"created": "1999-01-01"}}
    path.write_text(json.dumps(json.loads(first) | {"engines": changed}))
    assert update(0.002, ["mujoco-native"]) == [path]
    document = json.loads(path.read_text())
    assert document["engines"]["mujoco-multipliers"] == changed["mujoco-multipliers"]
    assert document["engines"]["mujoco-native"]["settings"]["step"] == 0.002
    assert "mujoco-native: since the baseline of 2000-01-01: step 0.004 -> 0.002" in document["reason"]


@pytest.mark.usefixtures("rides_only")
def test_an_update_tells_entries_that_moved_from_those_that_did_not(tmp_path: Path) -> None:
    engines, path = ["mujoco-native", "mujoco-multipliers"], tmp_path / "q2.json"
    verdicts, fresh = gate.check_gate(lambda *_: None, ["q2"], engines, tmp_path)
    gate.update_baselines(fresh, verdicts, None, tmp_path)
    document = json.loads(path.read_text())
    document["engines"]["mujoco-native"]["quantities"]["energy_drift"] *= 1.1
    for entry in document["engines"].values():
        entry["created"] = "2000-01-01"
    path.write_text(json.dumps(document))
    verdicts, fresh = gate.check_gate(lambda *_: None, ["q2"], engines, tmp_path)
    assert gate.update_baselines(fresh, verdicts, None, tmp_path) == [path]
    after = json.loads(path.read_text())
    assert after["reason"] == "mujoco-native: energy_drift: changed"
    assert after["engines"]["mujoco-multipliers"] == document["engines"]["mujoco-multipliers"]
    assert after["engines"]["mujoco-native"] == fresh["q2"]["engines"]["mujoco-native"]


@pytest.mark.usefixtures("rides_only")
def test_progress_names_the_engine_and_stays_within_the_run() -> None:
    seen: list[tuple[str, float, float]] = []
    gate.check_gate(lambda *report: seen.append(report), ["q2"], ["mujoco-native"])
    assert {engine for engine, _, _ in seen} == {"mujoco-native"}
    assert {duration for _, _, duration in seen} == {Gate().duration}
    assert max(time for _, time, _ in seen) <= Gate().duration


@pytest.mark.usefixtures("rides_only")
@pytest.mark.parametrize(("ratio", "status"), [(1.9, "holds"), (2.1, "worse"), (0.1, "holds")])
def test_cpu_time_is_judged_if_asked_for(
    ratio: float, status: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def check(ratio: float, hold_cpu: bool = True) -> dict[str, Verdict]:
        monkeypatch.setattr(gate_sample, "_measure_cpu_ratio", lambda *_: ratio)
        verdicts, fresh = gate.check_gate(lambda *_: None, ["q2"], [REFERENCE], tmp_path, hold_cpu=hold_cpu)
        if not (tmp_path / "q2.json").exists():
            gate.update_baselines(fresh, verdicts, None, tmp_path)
        return {verdict.quantity: verdict for _, verdict in verdicts}

    check(1.0)
    held = check(ratio)
    assert held[HELD_CPU].status == status
    assert held["cpu_ratio"].status == "shown"
    assert HELD_CPU not in check(5.0, hold_cpu=False)
    assert gate_sample.CPU_FACTOR == 2.0


def test_a_baseline_without_a_held_cpu_time_does_not_hold_it() -> None:
    verdicts, _ = gate.check_gate(lambda *_: None, ["p3"], [REFERENCE], hold_cpu=True)
    (verdict,) = (verdict for _, verdict in verdicts if not verdict.passes)
    assert (verdict.quantity, verdict.status) == (HELD_CPU, "missing")
    assert "not in the baseline" in verdict.reason


@pytest.mark.slow
@pytest.mark.parametrize("machine", range(10))
def test_clean_checks_hold_whatever_the_processor_threads_and_folder(machine: int, tmp_path: Path) -> None:
    kind = (None, "Haswell", "Prescott", "Nehalem", "Zen", "Sandybridge")[machine % 6]
    changes = {} if kind is None else {"OPENBLAS_CORETYPE": kind}
    threads = str(1 + machine % 2)
    changes |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "NUMBA_NUM_THREADS"), threads)
    changes["PYTHONPATH"] = os.pathsep.join(sys.path)
    folder = tmp_path / ("a folder" if machine % 3 else "b" * 60)
    folder.mkdir()
    code = "from velodrome.scenarios.cli import main; import sys; sys.argv[0] = 'velodrome'; main()"
    command = [sys.executable, "-c", code, "check", "--json"]
    inherited = {name: value for name, value in os.environ.items() if name != "OPENBLAS_CORETYPE" or kind is not None}
    done = subprocess.run(command, env=inherited | changes, cwd=folder, capture_output=True, text=True)
    verdicts = json.loads(done.stdout)["verdicts"]
    assert {verdict["status"] for verdict in verdicts} == {"holds", "shown"}, [
        verdict for verdict in verdicts if not verdict["passes"]
    ]
    assert done.returncode == 0
