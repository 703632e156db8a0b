"""Seeded faults: each must close the gate, with the engine and the quantity named."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from altered import Altered, raising

from engines.engine import Engine, EngineError, Problem, Settings, Trajectory, engine_names
from reports.drift import Verdict
from scenarios import gate
from scenarios.error import ScenarioError
from scenarios.runner import configure
from scenarios.scenario import Scenario
from scenarios.start import Start, make_start

NAMES = engine_names()
FIXED_STEP = {"exudyn": 0.002, "mujoco-native": 0.004}  # twice their baselines'
Chosen = Callable[[str, Mapping[str, Any]], tuple[Engine, Settings]]


@cache
def starting(scenario: str) -> Start:
    return make_start(Scenario.model_validate_json(scenario))


@pytest.fixture(autouse=True)
def one_start(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compute the gated motion once: it is the engines that are altered."""
    monkeypatch.setattr(gate, "make_start", lambda scenario: starting(scenario.model_dump_json()))


def verdicts_on(wanted: str, chosen: Chosen = configure) -> list[Verdict]:
    """The gate's verdicts on one engine; the others are not run."""

    def only(name: str, values: Mapping[str, Any]) -> tuple[Engine, Settings]:
        if name != wanted:
            raise EngineError("not asked for")
        return chosen(name, values)

    verdicts, _ = gate.check(lambda *_: None, only)
    assert {verdict.reason for _, verdict in verdicts if verdict.engine != wanted} <= {"did not run: not asked for"}
    assert {scenario for scenario, _ in verdicts} == set(gate.gated_names())
    return [verdict for _, verdict in verdicts if verdict.engine == wanted]


def altered(
    before: Callable[[Problem], Problem] = lambda problem: problem,
    after: Callable[[Trajectory], Trajectory] = lambda trajectory: trajectory,
) -> Chosen:
    def chosen(name: str, values: Mapping[str, Any]) -> tuple[Engine, Settings]:
        engine, settings = configure(name, values)
        return Altered(engine, before, after), settings

    return chosen


def failing(verdicts: list[Verdict]) -> set[str]:
    return {verdict.quantity for verdict in verdicts if not verdict.passes}


@pytest.mark.parametrize("name", NAMES)
def test_a_clean_repeat_passes_in_every_quantity(name: str) -> None:
    verdicts = verdicts_on(name)
    assert len(verdicts) == 7
    assert {verdict.status for verdict in verdicts} == {"holds"}


@pytest.mark.parametrize("name", NAMES)
def test_round_off_of_the_start_stays_far_inside_the_limits(name: str) -> None:
    # What another processor's last digits do: a thousandth of the limit where iterations set it, and in the
    # reference, whose limit is the tolerance of its own steps, half of it.
    rng = np.random.default_rng(3)

    def shaken(problem: Problem) -> Problem:
        noise = 1 + 2.0**-52 * rng.uniform(-4, 4, (2, 9))
        return replace(problem, q=problem.q * noise[0], qd=problem.qd * noise[1])

    for verdict in verdicts_on(name, altered(before=shaken)):
        assert verdict.value is not None
        assert verdict.baseline is not None
        assert verdict.limit is not None
        share = abs(verdict.value - verdict.baseline) / verdict.limit
        assert share < (0.5 if name == "reference" else 1e-3), verdict.quantity


# Both directions where the fault may cancel part of the engine's own error.
@pytest.mark.parametrize(
    ("name", "factor"), [("reference", 1.01), ("exudyn", 1.01), ("mujoco-native", 0.99), ("mujoco-native", 1.01)]
)
def test_one_percent_of_the_front_wheels_spin_inertia_fails(name: str, factor: float) -> None:
    def heavier(problem: Problem) -> Problem:
        wheel = problem.bicycle
        # Both moments, or the wheel would be no rigid body: a thin ring's spin inertia is the sum of the others.
        changed = replace(
            wheel, front_wheel_Iyy=factor * wheel.front_wheel_Iyy, front_wheel_Ixx=factor * wheel.front_wheel_Ixx
        )
        return replace(problem, bicycle=changed)

    fails = failing(verdicts_on(name, altered(before=heavier)))
    # The exact circle is another one, so most of what is gated moves.
    assert len(fails & {"short_error", "radius_drift_rate", "phase_drift_rate", "rear_rate_drift_rate"}) >= 3


@pytest.mark.parametrize("name", FIXED_STEP)
def test_a_coarser_step_fails_and_is_named(name: str) -> None:
    verdicts = verdicts_on(name, lambda engine, values: configure(engine, {**values, "step": FIXED_STEP[name]}))
    assert {"short_error", "radius_drift_rate", "phase_drift_rate", "rear_rate_drift_rate"} <= failing(verdicts)
    short = next(verdict for verdict in verdicts if verdict.quantity == "short_error")
    assert f"-> {FIXED_STEP[name]!r}" in short.reason


@pytest.mark.parametrize("name", ["reference", "mujoco-native"])
def test_a_trajectory_late_by_a_sample_fails(name: str) -> None:
    def late(trajectory: Trajectory) -> Trajectory:
        return replace(trajectory, q=np.vstack([trajectory.q[:1], trajectory.q[:-1]]))

    assert "short_error" in failing(verdicts_on(name, altered(after=late)))


def test_numbers_that_are_none_fail() -> None:
    def blown_up(trajectory: Trajectory) -> Trajectory:
        q = trajectory.q.copy()
        q[50:] = np.nan
        return replace(trajectory, q=q)

    fails = failing(verdicts_on("reference", altered(after=blown_up)))
    assert {"short_error", "radius_drift_rate", "phase_drift_rate"} <= fails


@pytest.mark.parametrize(
    ("after", "words"),
    [
        (raising(EngineError("no contact at the start")), "did not run: no contact at the start"),
        (raising(ZeroDivisionError("by zero")), "did not run: by zero"),
        (lambda trajectory: replace(trajectory, ended="Newton failed at 0.5 s"), "did not run: Newton failed at 0.5 s"),
    ],
)
def test_an_engine_that_does_not_get_through_fails(after: Callable[[Trajectory], Trajectory], words: str) -> None:
    (verdict,) = verdicts_on("reference", altered(after=after))
    assert (verdict.quantity, verdict.status, verdict.reason) == ("run", "missing", words)


def stored(entries: dict[str, Any], folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Put other baselines in the committed ones' place."""
    monkeypatch.setattr(gate, "BASELINES", folder)
    for name in gate.gated_names():
        (folder / f"{name}.json").write_text(json.dumps({"engines": entries}))


def test_an_engine_of_the_baseline_that_is_gone_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stored({"warp": {}}, tmp_path, monkeypatch)
    verdicts = verdicts_on("warp")
    assert [(verdict.status, verdict.quantity) for verdict in verdicts] == [("missing", "run")] * len(verdicts)
    assert "did not run: engine 'warp' is not installed" in verdicts[0].reason


def test_an_engine_without_a_baseline_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stored({}, tmp_path, monkeypatch)
    (verdict,) = verdicts_on("reference")
    assert (verdict.engine, verdict.status) == ("reference", "missing")
    assert "no baseline" in verdict.reason


@pytest.mark.parametrize("content", ["", "{", "{}", "[]", "3"])
def test_a_damaged_baseline_is_refused_by_name(content: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gate, "BASELINES", tmp_path)
    (tmp_path / "q2.json").write_text(content)
    with pytest.raises(ScenarioError, match=r"q2\.json: not a baseline"):
        gate.read_baseline("q2")


def test_updated_baselines_hold_the_next_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gate, "BASELINES", tmp_path / "baselines")

    def coarser(name: str, values: Mapping[str, Any]) -> tuple[Engine, Settings]:
        if name != "mujoco-native":
            raise EngineError("not asked for")
        return configure(name, {**values, "step": 0.004})

    _, fresh = gate.check(lambda *_: None, coarser)
    paths = gate.update(fresh)
    assert [path.stem for path in paths] == gate.gated_names()
    assert json.loads(paths[0].read_text())["engines"]["mujoco-native"]["settings"]["step"] == 0.004
    assert failing(verdicts_on("mujoco-native", coarser)) == set()
    # And the step that was right before is a change now, as large as the other way round.
    statuses = {verdict.status for verdict in verdicts_on("mujoco-native")}
    assert "holds" not in statuses


def test_progress_names_the_engine_and_stays_within_the_run() -> None:
    seen: list[tuple[str, float, float]] = []

    def only(name: str, values: Mapping[str, Any]) -> tuple[Engine, Settings]:
        if name != "mujoco-native":
            raise EngineError("not asked for")
        return configure(name, values)

    gate.check(lambda *report: seen.append(report), only)
    assert {engine for engine, _, _ in seen} == {"mujoco-native"}
    assert {duration for _, _, duration in seen} == {gate.DURATION}
    assert max(time for _, time, _ in seen) <= gate.DURATION
