"""Faults that an engine may have, planted: the gate names each with the engine and the quantity.

Most are planted in the reference, whose rides take milliseconds and whose limits are the narrowest, some in the engines
where they belong, and some in the equations of an engine of the tests' own.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gating import (
    Chosen,
    altered,
    compute_starts_once,
    failing,
    measure_rides_only,
    set_silently,
    simulated,
    verdicts_of,
    with_bicycle,
    with_factors,
)
from plain import PlainEngine, PlainSettings, without_gyroscopic_moment

from velodrome.engines.engine import REFERENCE, SHAPES, Engine, Problem, Progress, Settings, Trajectory
from velodrome.engines.registry import load_engine
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.kinematics import LEAN, STEER, YAW
from velodrome.reference.surface import Paraboloid, Plane
from velodrome.scenarios.gate import checks as gate
from velodrome.scenarios.scenario import engine_settings

pytestmark = pytest.mark.once  # the gate's judgement; `test_gate` rides with every engine

GATED = gate.gated_names()


@pytest.fixture(autouse=True)
def rides_of_known_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Judge rides alone, the starts computed once; clean rides hold, see `test_gate`."""
    compute_starts_once(monkeypatch)
    measure_rides_only(monkeypatch)


# Physics that is wrong under a condition only: 5 % of gravity.


def heavier_if(condition: Callable[[Problem], bool]) -> Chosen:
    def before(problem: Problem) -> Problem:
        return with_bicycle(problem, gravity=1.05) if condition(problem) else problem

    return altered(before=before)


def on_other_ground(problem: Problem) -> bool:
    return not isinstance(problem.surface, Plane | Paraboloid)


def on_a_steep_bowl(problem: Problem) -> bool:
    return isinstance(problem.surface, Paraboloid) and problem.surface.alpha > 0.01


def at_another_rate(problem: Problem) -> bool:
    return not np.isclose(problem.times[1], 0.02)


def changes(problem: Problem) -> bool:
    """Whether the motion is no steady circle."""
    return on_other_ground(problem) or bool(np.any(np.abs(problem.qd[[LEAN, STEER]]) > 1e-9))


def joined(first: Trajectory, second: Trajectory) -> Trajectory:
    """A ride and, from its last sample on, another."""
    parts = {}
    for name in SHAPES:
        before, after = getattr(first, name), getattr(second, name)
        parts[name] = np.concatenate([before, after[1:]])
    return replace(first, steps=first.steps + second.steps, **parts | {"time": first.time})


def heavier_after(since: float) -> Chosen:
    """An engine that rides with another gravity from a time on."""

    def simulate(engine: Engine, problem: Problem, settings: Any, progress: Progress) -> Trajectory:
        late = int(np.searchsorted(problem.times, since))
        if late >= len(problem.times) - 1:
            return engine.simulate(problem, settings, progress)
        first = engine.simulate(replace(problem, times=problem.times[: late + 1]), settings, progress)
        rest = replace(problem, q=first.q[-1], qd=first.qd[-1], times=problem.times[late:] - problem.times[late])
        second = engine.simulate(with_bicycle(rest, gravity=1.05), settings, progress)
        return replace(joined(first, second), time=problem.times)

    return simulated(simulate)


# What is reported wrongly.


def with_force(change: Callable[[Trajectory, np.ndarray], np.ndarray]) -> Chosen:
    def after(trajectory: Trajectory) -> Trajectory:
        assert trajectory.contact_force is not None
        return replace(trajectory, contact_force=change(trajectory, trajectory.contact_force))

    return altered(after=after)


def with_changed(*names: str, change: Callable[[np.ndarray], np.ndarray]) -> Chosen:
    return altered(
        after=lambda trajectory: replace(trajectory, **{name: change(getattr(trajectory, name)) for name in names})
    )


def late(values: np.ndarray) -> np.ndarray:
    return np.concatenate([values[:1], values[:-1]])


def single(values: np.ndarray) -> np.ndarray:
    return values.astype(np.float32).astype(float)


def swapped(values: np.ndarray) -> np.ndarray:
    return values[:, ::-1].copy()


def weaker_while_leaning(trajectory: Trajectory, force: np.ndarray) -> np.ndarray:
    """Forces that are a thousandth too small at a lean rate of 1 rad/s, and right where nothing changes."""
    return force * (1 - 1e-3 * np.abs(trajectory.qd[:, LEAN]))[:, None, None]


# What is computed in another way than is said.


def copy_with(noise: float) -> Chosen:
    """An engine that returns the reference's ride, or one that is shifted by so many units in the last place."""

    def simulate(engine: Engine, problem: Problem, settings: Any, progress: Progress) -> Trajectory:
        reference = load_engine(REFERENCE)
        found = reference.simulate(problem, reference.settings(), progress)
        rng = np.random.default_rng(0)
        return replace(
            found,
            q=found.q + noise * np.spacing(found.q) * rng.choice([-1, 1], found.q.shape),
            qd=found.qd + noise * np.spacing(found.qd) * rng.choice([-1, 1], found.qd.shape),
            **dict.fromkeys(set(SHAPES) - {"time", "q", "qd", "body_position", "body_quaternion", *engine.gives}),
        )

    return simulated(simulate)


def unconverged(trajectory: Trajectory) -> Trajectory:
    return replace(trajectory, unconverged_steps=1, largest_residual=1e-3)


@dataclass(frozen=True)
class Fault:
    """A fault, the engine that it is planted in, and what must be named.

    Attributes
    ----------
    engine : str
    chosen : callable
    named : set of str
        Quantities that must close the gate.
    only : callable or None
        Problems in which it shows, where it must not show in others.
    scenarios : sequence of str or None
        Gated scenarios to ride; all if None.
    everywhere : bool
        Whether all of them must be named in every scenario in which it shows, or each in some.
    reason : str
        What the verdict's reason must say.
    """

    engine: str
    chosen: Chosen
    named: set[str]
    only: Callable[[Problem], bool] | None = None
    scenarios: Sequence[str] | None = None
    everywhere: bool = True
    reason: str = ""


def conditional(condition: Callable[[Problem], bool]) -> Fault:
    return Fault(REFERENCE, heavier_if(condition), {"position_error", "state_error", "settled_force_error"}, condition)


PATH = {"position_error", "state_error"}
CIRCLE, WEAVE = ["plane-circle"], ["iftomm-2"]
FAULTS: dict[str, Fault] = {
    "gravity wrong with the handlebar forward": conditional(lambda problem: abs(problem.q[STEER]) < np.pi / 2),
    "gravity wrong in turns to the left": conditional(lambda problem: bool(problem.qd[YAW] > 1e-9)),
    "gravity wrong in steep bowls": conditional(on_a_steep_bowl),
    "gravity wrong on another ground": conditional(on_other_ground),
    "gravity wrong of another bicycle": conditional(lambda problem: problem.bicycle != Bicycle()),
    "gravity wrong at other output rates": conditional(at_another_rate),
    "gravity wrong where something changes": conditional(changes),
    "gravity wrong after 3 s": Fault(
        REFERENCE, heavier_after(3.0), PATH, only=lambda problem: bool(problem.times[-1] > 3.0)
    ),
    "standard gravity": Fault(REFERENCE, with_factors(gravity=9.80665 / 9.81), PATH),
    "rear wheel's inertia off by 1e-3": Fault(
        REFERENCE, with_factors(rear_wheel_Iyy=1.001, rear_wheel_Ixx=1.001), PATH
    ),
    "front wheel's inertia off by 1e-3": Fault(
        REFERENCE, with_factors(front_wheel_Iyy=0.999, front_wheel_Ixx=0.999), PATH
    ),
    "rear frame's inertia off by 1e-3": Fault(REFERENCE, with_factors(rear_frame_Ixx=1.001), PATH, everywhere=False),
    "front frame's inertia off by 1e-3": Fault(REFERENCE, with_factors(front_frame_Izz=1.001), PATH, everywhere=False),
    "wheel radius off by 0.1 mm": Fault(REFERENCE, with_factors(front_wheel_radius=1 - 1e-4 / 0.35), {"state_error"}),
    "forces wrong while they change": Fault(
        REFERENCE,
        with_force(weaker_while_leaning),
        {"rms_force_error", "contact_force_error"},
        only=changes,
    ),
    "forces in single precision": Fault(
        REFERENCE, with_force(lambda _, force: single(force)), {"rms_force_error"}, everywhere=False
    ),
    "forces of the other wheel": Fault(REFERENCE, with_force(lambda _, force: swapped(force)), {"rms_force_error"}),
    "forces a sample late": Fault(REFERENCE, with_force(lambda _, force: late(force)), {"contact_force_error"}),
    "state in single precision": Fault(REFERENCE, with_changed("q", "qd", change=single), {"max_gap", "state_error"}),
    "everything a sample late": Fault(REFERENCE, with_changed(*set(SHAPES) - {"time"}, change=late), PATH),
    "contact points of the other wheel": Fault(
        REFERENCE, with_changed("contact_point", change=swapped), {"report_mismatch"}
    ),
    "stale energies": Fault(
        REFERENCE,
        with_changed("kinetic_energy", "potential_energy", change=late),
        {"report_mismatch"},
        only=changes,
        everywhere=False,
    ),
    "a copy of the reference": Fault("exudyn", copy_with(0), {"run"}, reason="the reference's own trajectory"),
    "a copy with noise": Fault(
        "mujoco-multipliers", copy_with(2), {"run"}, scenarios=["p3", "q2"], reason="the reference's own trajectory"
    ),
    "steps that did not converge": Fault(
        "mujoco-multipliers", altered(after=unconverged), {"run"}, scenarios=CIRCLE, reason="did not converge in 1 of"
    ),
    "a method of lower order": Fault(REFERENCE, set_silently(integrator="modified-euler"), PATH, scenarios=WEAVE),
    "a doubled step in Exudyn": Fault("exudyn", set_silently(step=0.002), {"steps", *PATH}, scenarios=WEAVE),
    "a doubled step in MuJoCo": Fault(
        "mujoco-multipliers", set_silently(step=0.004), {"steps", *PATH}, everywhere=False
    ),
    "less friction in MuJoCo": Fault(
        "mujoco-native", set_silently(friction=0.9), {"max_slip", "energy_drift"}, scenarios=["q2", "q2-plus"]
    ),
}


def shows(problem: Problem, fault: Fault) -> bool:
    return fault.only is None or fault.only(problem)


@pytest.mark.parametrize("what", FAULTS)
def test_a_planted_fault_closes_the_gate_and_is_named(what: str) -> None:
    fault = FAULTS[what]
    found = verdicts_of(fault.engine, fault.chosen, fault.scenarios)
    problems = {name: gate.make_start(gate.load_gated(name)[1]).problem for name in found}
    failed = {name: failing(verdicts) for name, verdicts in found.items()}
    expected = {name for name in found if shows(problems[name], fault)}
    assert expected, "nothing is gated that shows it"
    assert fault.named <= set().union(*(failed[name] for name in expected))
    for name, quantities in failed.items():
        if name not in expected:
            assert not quantities, name
        elif fault.everywhere:
            assert fault.named <= quantities, name
        for verdict in found[name]:
            assert verdict.passes or fault.reason in verdict.reason


# Faults in the equations of an engine of the tests' own, which is held against its own clean ride.


@pytest.fixture
def plain_baselines(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    monkeypatch.setattr(engine_settings, "installed_engines", lambda: [REFERENCE, "plain"])
    monkeypatch.setattr(gate, "installed_engines", lambda: [REFERENCE, "plain"])
    verdicts, fresh = gate.check_gate(lambda *_: None, WEAVE, ["plain"], tmp_path, plain(PlainEngine()))
    gate.update_baselines(fresh, verdicts, "first", tmp_path)
    assert not failing(verdicts_of("plain", plain(PlainEngine()), WEAVE, tmp_path)["iftomm-2"])
    errors = json.loads((tmp_path / "iftomm-2.json").read_text())["engines"]["plain"]["quantities"]
    # A fourth-order method whose fastest rate is the wheels' 15 rad/s: (h rate)^4 of the way, which is 7 m.
    assert 0 < errors["position_error"] < (4e-3 * 15.3) ** 4 * 7
    return tmp_path


def plain(engine: PlainEngine) -> Chosen:
    def chosen(name: str, values: Mapping[str, Any]) -> tuple[Engine, Settings]:
        return engine, PlainSettings()

    return chosen


def flipped(bicycle: Bicycle, q: np.ndarray, qd: np.ndarray, w: np.ndarray) -> None:
    w[1] *= -1


def damped(bicycle: Bicycle, q: np.ndarray, qd: np.ndarray, h: np.ndarray) -> None:
    h[STEER] += 1e-5 * qd[STEER]


EQUATIONS: dict[str, PlainEngine] = {
    "no gyroscopic moment of the front wheel": PlainEngine(bias=without_gyroscopic_moment),
    "a sign in a row of the Jacobian": PlainEngine(rows=flipped),
    "a steering damper of 1e-5 N m s": PlainEngine(bias=damped),
    "Heun's method for Runge's": PlainEngine(stages=2),
    "a doubled step": PlainEngine(coarser=2),
}


@pytest.mark.parametrize("what", EQUATIONS)
def test_a_fault_in_the_equations_closes_the_gate_and_is_named(what: str, plain_baselines: Path) -> None:
    verdicts = verdicts_of("plain", plain(EQUATIONS[what]), WEAVE, plain_baselines)["iftomm-2"]
    fails = failing(verdicts)
    assert fails >= PATH or fails == {"run"}
