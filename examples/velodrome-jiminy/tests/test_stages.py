"""Jiminy against the reference stage by stage, so that a difference is found where it is born."""

# Jiminy is an optional library, and its compiled bindings carry no types.
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from velodrome.engines.engine import EngineError, Problem, Trajectory, UnsuitableProblem
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.dae import consistent_state, dynamics
from velodrome.reference.inputs import NO_INPUTS, Inputs
from velodrome.reference.kernels.dynamics import energies, mass_and_bias
from velodrome.reference.kernels.kinematics import angular_velocities, frames
from velodrome.reference.kinematics import LEAN, PITCH, YAW, constants, rotations
from velodrome.reference.simulate import simulate
from velodrome.reference.surface import Paraboloid, Plane

pytest.importorskip("jiminy_py", reason="Jiminy is not installed; make test-packages installs it")

from jiminy_py.core import pinocchio as pin
from velodrome_jiminy.engine import ENGINE
from velodrome_jiminy.ride import Rig
from velodrome_jiminy.settings import LEAST_REGULARISATION
from velodrome_jiminy.tree import HINGES, build_model, to_jiminy

BICYCLE = Bicycle()
EPSILON = np.finfo(float).eps
# Mass matrices have conditions of some 1e3.
ROUND_OFF = 1e3 * EPSILON


def random_states(n: int) -> list[tuple[np.ndarray, np.ndarray]]:
    rng = np.random.default_rng(5)
    states = []
    for _ in range(n):
        angles = [rng.uniform(-9, 9), rng.uniform(-1.4, 1.4), *rng.uniform(-9, 9, 4)]
        states.append((np.concatenate([rng.uniform(-3, 3, 3), angles]), rng.uniform(-5, 5, 9)))
    return states


def differentiate_velocity(q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
    """Derivative of Jiminy's velocity (R' D', R' w, rates of the hinges) for accelerations of the coordinates."""
    a_lean, _, y_r, _, s, *_ = frames(q[3], q[4], q[5], q[6], constants(BICYCLE))
    spin, _, bias, _ = angular_velocities(a_lean, y_r, s, qd[3], qd[4], qd[5], qd[6])
    turning = np.array(bias) + qdd[YAW] * np.array([0, 0, 1.0])
    turning += qdd[LEAN] * np.array(a_lean) + qdd[PITCH] * np.array(y_r)
    rear = rotations(BICYCLE, q)[0]
    return np.concatenate([rear.T @ (qdd[:3] - np.cross(spin, qd[:3])), rear.T @ turning, qdd[HINGES]])


def disturbed(duration: float, interval: float = 0.1, inputs: Inputs = NO_INPUTS) -> Problem:
    """A bicycle that leans, steers and turns on the level plane."""
    q, qd = consistent_state(BICYCLE, Plane(), (1.4, -0.6), 0.2, -0.1, (0.4, -0.3, 15.0), yaw=0.4)
    return Problem(BICYCLE, Plane(), q, qd, interval * np.arange(round(duration / interval) + 1), inputs)


def run(problem: Problem, **settings: Any) -> Trajectory:
    return ENGINE.simulate(problem, ENGINE.settings(**settings), lambda _time: None)


def exact(problem: Problem) -> Any:
    return simulate(problem.bicycle, problem.surface, problem.q, problem.qd, problem.times, tolerance=1e-14)


# ----------------------------------------------------------------------------------------------- the tree


def test_mass_matrix_of_the_tree() -> None:
    """M of Jiminy's velocity v = S q' as S' M S."""
    model = build_model(BICYCLE)
    data = model.createData()
    for q, _ in random_states(50):
        columns = [to_jiminy(BICYCLE, q, rates)[1] for rates in np.eye(9)]
        found = pin.crba(model, data, to_jiminy(BICYCLE, q, np.zeros(9))[0])
        found = np.triu(found) + np.triu(found, 1).T
        mass, bias = np.empty((9, 9)), np.empty(9)
        mass_and_bias(q, np.zeros(9), constants(BICYCLE), mass, bias)
        limit = 16 * EPSILON * mass.max()
        np.testing.assert_allclose(columns @ found @ np.transpose(columns), mass, rtol=0, atol=limit)


def test_accelerations_of_the_tree_without_contacts() -> None:
    """M q'' + h = 0: the bias forces."""
    model = build_model(BICYCLE)
    data = model.createData()
    for q, qd in random_states(50):
        mass, bias = np.empty((9, 9)), np.empty(9)
        mass_and_bias(q, qd, constants(BICYCLE), mass, bias)
        expected = differentiate_velocity(q, qd, np.linalg.solve(mass, -bias))
        found = pin.aba(model, data, *to_jiminy(BICYCLE, q, qd), np.zeros(9))
        np.testing.assert_allclose(found, expected, rtol=0, atol=ROUND_OFF * np.abs(expected).max())


def test_energies_of_the_tree() -> None:
    model = build_model(BICYCLE)
    data = model.createData()
    for q, qd in random_states(50):
        kinetic, potential = energies(q, qd, constants(BICYCLE))
        state = to_jiminy(BICYCLE, q, qd)
        # Sums of some dozen terms; the potential passes zero: relative to the weight lifted by a metre.
        assert pin.computeKineticEnergy(model, data, *state) == pytest.approx(kinetic, rel=64 * EPSILON)
        lifted = pytest.approx(potential, rel=64 * EPSILON, abs=64 * EPSILON * 94 * 9.81)
        assert pin.computePotentialEnergy(model, data, state[0]) == lifted


# ------------------------------------------------------------------------------------------- rolling wheels


@pytest.mark.parametrize("stabilisation", [0.0, 20.0])
@pytest.mark.parametrize("inputs", [NO_INPUTS, Inputs(3.0, -5.0, 0.7)], ids=["hands-free", "inputs"])
def test_first_accelerations_and_forces(inputs: Inputs, stabilisation: float) -> None:
    """To what Jiminy adds to the constraints' diagonal, whatever the stabilisation: nothing is off at the start."""
    problem = disturbed(0.1, inputs=inputs)
    there = dynamics(BICYCLE, Plane(), problem.q, problem.qd, inputs)
    _, _, found, force = Rig(problem, ENGINE.settings(stabilisation=stabilisation)).read_state()
    expected = differentiate_velocity(problem.q, problem.qd, there.acceleration)
    # The conditions of M and J M^-1 J' are some 1e3; the forces' errors are that much larger than the softness at most.
    np.testing.assert_allclose(force, there.force, rtol=0, atol=10 * LEAST_REGULARISATION * np.abs(there.force).max())
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e3 * LEAST_REGULARISATION * np.abs(expected).max())


@pytest.mark.parametrize(("integrator", "order"), [("runge_kutta_4", 2), ("euler_explicit", 1)])
def test_error_of_one_step(integrator: str, order: int) -> None:
    """It is of one order more than the ride's; C h^(p+1) (1 + k h) shows it up to k h over ln 2.

    Jiminy's first step is 1 us, whatever is asked for, so that the first interval has two.
    """
    errors = []
    for step in (8e-3, 4e-3):
        problem = disturbed(step, step)
        found = run(problem, step=step, integrator=integrator, stabilisation=0.0)
        assert found.steps == 2
        errors.append(np.abs(found.q[1] - exact(problem).q[1]).max())
    fastest = 15.0  # of the rear wheel [rad/s]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order + 1, abs=fastest * 8e-3 / np.log(2))


@pytest.mark.parametrize(("integrator", "order"), [("runge_kutta_4", 2), ("euler_explicit", 1)])
def test_order_of_a_ride(integrator: str, order: int) -> None:
    problem = disturbed(2.0)
    there, errors = exact(problem), []
    for step in (2e-3, 1e-3, 5e-4):
        found = run(problem, step=step, integrator=integrator)
        assert found.ended is None
        errors.append(np.linalg.norm(found.q[:, :3] - there.q[:, :3], axis=1).max())
    # The next term of the error is smaller by a rate times the step, 15 rad/s and 2 ms.
    np.testing.assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), order, atol=2 * 15 * 2e-3 / np.log(2))


def test_wheels_stay_on_the_ground_with_the_stabilisation() -> None:
    """Without it gaps grow with the method's error; with it they stay as small as an error decays within 1 / k."""
    problem = disturbed(2.0)
    free, held = run(problem, stabilisation=0.0), run(problem)
    assert free.gap is not None
    assert held.gap is not None
    assert np.abs(held.gap).max() < np.abs(free.gap).max() / 10


# ----------------------------------------------------------------------------------------------- refusals


def test_other_ground_is_refused() -> None:
    q, qd = consistent_state(BICYCLE, Paraboloid(0.1), (1.4, -0.6), 0.2, -0.1, (0.4, -0.3, 15.0))
    with pytest.raises(UnsuitableProblem, match="plane"):
        ENGINE.check(Problem(BICYCLE, Paraboloid(0.1), q, qd, np.array([0.0, 0.1])), ENGINE.settings())


def test_a_stabilisation_that_diverges_is_refused() -> None:
    problem = disturbed(0.1)
    ENGINE.check(problem, ENGINE.settings(step=0.02, stabilisation=22.0))
    with pytest.raises(ValueError, match=r"at most 22\.2 Hz"):
        ENGINE.check(problem, ENGINE.settings(step=0.02, stabilisation=23.0))


def test_a_bicycle_without_inertia_is_refused() -> None:
    bicycle = replace(BICYCLE, rear_wheel_Iyy=0.0)
    problem = disturbed(0.1)
    with pytest.raises(EngineError, match="zero inertia"):
        run(Problem(bicycle, Plane(), problem.q, problem.qd, problem.times))
