"""Every engine of the suite applies torques and steer damping; one that does not say so never gets any."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from tests.wrapped import WrappedEngine
from velodrome.engines.admission import ride_engine
from velodrome.engines.engine import EngineError, Problem, Progress, Trajectory, UnsuitableProblem
from velodrome.engines.guard import GuardedEngine
from velodrome.engines.registry import load_engine
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.dae import consistent_state
from velodrome.reference.inputs import NO_INPUTS, Inputs
from velodrome.reference.kinematics import LEAN, STEER
from velodrome.reference.surface import Paraboloid, Plane, Surface

BICYCLE = Bicycle()
EACH = {
    "steer torque": Inputs(steer_torque=0.3),
    "rear-wheel torque": Inputs(rear_wheel_torque=5.0),
    "steer damping": Inputs(steer_damping=1.0),
}
# Orders of the methods; the last two have contacts with a softness that does not fall with the step.
ORDERS = {
    "exudyn": 2.0,
    "exudyn-plane-normal": 2.0,
    "exudyn-builtin": 2.0,
    "mujoco-multipliers": 4.0,
    "mujoco-exact-contact": None,
    "mujoco-native": None,
}


def driven(inputs: Inputs, surface: Surface) -> Problem:
    q, qd = consistent_state(BICYCLE, surface, (1.0, 0.0), 0.05, 0.1, (0.2, 0.0, 16.0))
    return Problem(BICYCLE, surface, q, qd, np.arange(26) / 25, inputs)


def ride(name: str, problem: Problem, factor: float = 1.0) -> Trajectory:
    engine = load_engine(name)
    settings: Any = engine.settings()
    return ride_engine(engine, problem, settings if factor == 1 else settings.refined(factor), lambda _: None)


@cache
def exact(what: str, surface: Surface) -> Trajectory:
    return ride("reference", driven(EACH.get(what, NO_INPUTS), surface))


def apart(one: Trajectory, other: Trajectory) -> float:
    return float(np.abs(one.q[:, :7] - other.q[:, :7]).max())


@pytest.mark.parametrize("what", EACH)
@pytest.mark.parametrize("name", ORDERS)
def test_an_engine_rides_with_inputs_as_well_as_without(name: str, what: str) -> None:
    surface = Plane()
    error = apart(ride(name, driven(EACH[what], surface)), exact(what, surface))
    free = apart(ride(name, driven(NO_INPUTS, surface)), exact("none", surface))
    # Errors of one method on two motions of one size; the input changes the ride by far more.
    assert error < 3 * free
    assert error < 0.2 * apart(exact(what, surface), exact("none", surface))


@pytest.mark.parametrize("what", EACH)
@pytest.mark.parametrize("name", [name for name, order in ORDERS.items() if order is not None])
def test_the_order_is_kept_with_inputs(name: str, what: str) -> None:
    problem = driven(EACH[what], Plane())
    # With steps of 10 and 5 ms order 4 stands clear of round-off.
    factors = (5.0, 2.5) if ORDERS[name] == 4 else (2.0, 1.0)
    errors = [apart(ride(name, problem, factor), exact(what, Plane())) for factor in factors]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(ORDERS[name], abs=0.2)


@pytest.mark.parametrize("name", ["exudyn", "exudyn-plane-normal", "mujoco-multipliers", "mujoco-exact-contact"])
def test_inputs_are_applied_on_a_bowl(name: str) -> None:
    inputs, bowl = Inputs(0.05, 2.0, 0.3), Paraboloid(0.02)
    problem = driven(inputs, bowl)
    error = apart(ride(name, problem), ride("reference", problem))
    assert error < 3 * apart(ride(name, driven(NO_INPUTS, bowl)), exact("none", bowl))


@pytest.mark.parametrize("name", ["reference", *ORDERS, "mujoco-default"])
def test_every_engine_of_the_suite_says_that_it_takes_inputs(name: str) -> None:
    assert load_engine(name).takes_inputs


class Silent(WrappedEngine):
    """An engine that does not say whether it takes inputs, and ignores them."""

    def simulate(self, problem: Problem, settings: Any, progress: Progress) -> Trajectory:
        """Ride hands-free."""
        return self.inner.simulate(replace(problem, inputs=NO_INPUTS), settings, progress)


def test_an_engine_that_does_not_declare_inputs_never_rides_with_them() -> None:
    silent = Silent(load_engine("reference"))
    settings = silent.settings()
    problem = driven(Inputs(0.3), Plane())
    said = "it applies no inputs, and the problem has steer_torque 0.3 N m"
    with pytest.raises(EngineError, match=said):
        ride_engine(silent, problem, settings, lambda _: None)
    guarded = GuardedEngine(silent, silent.name, silent.version, silent.gives, silent.settings)
    with pytest.raises(UnsuitableProblem, match=said):
        guarded.check(problem, settings)
    free = replace(problem, inputs=NO_INPUTS)
    guarded.check(free, settings)
    assert apart(ride_engine(silent, free, settings, lambda _: None), ride("reference", free)) == 0


def test_a_problem_refuses_inputs_of_another_type_and_shows_those_it_has() -> None:
    problem = driven(Inputs(0.3), Plane())
    assert "inputs: steer_torque 0.3 N m" in repr(problem)
    assert "inputs" not in repr(replace(problem, inputs=NO_INPUTS))
    wrong: Any = {"steer_torque": 0.3}
    with pytest.raises(ValueError, match=r"inputs is \{'steer_torque': 0.3\}; it must be an Inputs"):
        replace(problem, inputs=wrong)


def test_the_inputs_change_the_ride_by_what_they_are_for() -> None:
    """A steer torque to the left steers to the left, so that the bicycle falls to the right; damping slows steering."""
    free, torque, damped = (exact(what, Plane()) for what in ("none", "steer torque", "steer damping"))
    assert torque.q[2, STEER] > free.q[2, STEER]
    assert torque.q[-1, LEAN] > free.q[-1, LEAN]
    assert np.abs(damped.qd[:, STEER]).max() < np.abs(free.qd[:, STEER]).max()
