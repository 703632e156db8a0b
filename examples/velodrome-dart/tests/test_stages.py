"""DART against the reference stage by stage, so that a difference is found where it is born."""

# DART is an optional library, and its compiled bindings carry no types.
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from velodrome.engines.engine import Problem, Trajectory, UnsuitableProblem
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.dae import consistent_state, dynamics
from velodrome.reference.families import find_motion
from velodrome.reference.kernels.dynamics import energies, mass_and_bias
from velodrome.reference.kinematics import YAW, constants
from velodrome.reference.simulate import simulate
from velodrome.reference.surface import Paraboloid, Plane

pytest.importorskip("dartpy", reason="DART is not installed; make test-packages installs it")

from velodrome_dart.engine import ENGINE
from velodrome_dart.ride import Rig
from velodrome_dart.settings import CONDITION
from velodrome_dart.tree import HINGES, build_tree

BICYCLE = Bicycle()
EPSILON = np.finfo(float).eps


def random_states(n: int) -> list[tuple[np.ndarray, np.ndarray]]:
    rng = np.random.default_rng(5)
    states = []
    for _ in range(n):
        angles = [rng.uniform(-9, 9), rng.uniform(-1.4, 1.4), *rng.uniform(-9, 9, 4)]
        states.append((np.concatenate([rng.uniform(-3, 3, 3), angles]), rng.uniform(-5, 5, 9)))
    return states


def circle(duration: float = 0.1, interval: float = 0.01) -> Problem:
    """The stable circle of the scenario plane-circle."""
    q, qd = find_motion(BICYCLE, Plane(), 18.0, 2, (0.73, 2.84))[1].state()
    return Problem(BICYCLE, Plane(), q, qd, interval * np.arange(round(duration / interval) + 1))


def disturbed(duration: float, interval: float = 0.1) -> Problem:
    """A bicycle that leans, steers and turns on the level plane."""
    q, qd = consistent_state(BICYCLE, Plane(), (1.4, -0.6), 0.2, -0.1, (0.4, -0.3, 15.0), yaw=0.4)
    return Problem(BICYCLE, Plane(), q, qd, interval * np.arange(round(duration / interval) + 1))


def run(problem: Problem, **settings: Any) -> Trajectory:
    return ENGINE.simulate(problem, ENGINE.settings(**settings), lambda _time: None)


def exact(problem: Problem) -> Any:
    return simulate(problem.bicycle, problem.surface, problem.q, problem.qd, problem.times)


# ----------------------------------------------------------------------------------------------- the tree


def test_mass_matrix_of_the_tree() -> None:
    """M of DART's speeds v = S q' as S' M S; the free joint's are a rotation vector's, which costs some digits."""
    tree = build_tree(BICYCLE)
    for q, _ in random_states(50):
        columns = []
        for rates in np.eye(9):
            tree.set_state(BICYCLE, q, rates)
            columns.append(np.array(tree.skeleton.getVelocities()))
        found = np.array(tree.skeleton.getMassMatrix())
        mass, bias = np.empty((9, 9)), np.empty(9)
        mass_and_bias(q, np.zeros(9), constants(BICYCLE), mass, bias)
        limit = 64 * EPSILON * mass.max()
        np.testing.assert_allclose(columns @ found @ np.transpose(columns), mass, rtol=0, atol=limit)


def test_energies_of_the_tree() -> None:
    tree = build_tree(BICYCLE)
    for q, qd in random_states(50):
        kinetic, potential = energies(q, qd, constants(BICYCLE))
        tree.set_state(BICYCLE, q, qd)
        # Sums of some dozen terms; the potential passes zero: relative to the weight lifted by a metre.
        assert tree.skeleton.computeKineticEnergy() == pytest.approx(kinetic, rel=256 * EPSILON)
        lifted = pytest.approx(potential, rel=64 * EPSILON, abs=64 * EPSILON * 94 * 9.81)
        assert tree.skeleton.computePotentialEnergy() == lifted


def test_accelerations_of_the_tree_without_contacts() -> None:
    """M q'' + h = 0 of the hinges, whose speeds are the suite's rates: the bias forces."""
    tree = build_tree(BICYCLE)
    for q, qd in random_states(50):
        mass, bias = np.empty((9, 9)), np.empty(9)
        mass_and_bias(q, qd, constants(BICYCLE), mass, bias)
        tree.set_state(BICYCLE, q, qd)
        tree.skeleton.computeForwardDynamics()
        expected = np.linalg.solve(mass, -bias)
        found = np.array(tree.skeleton.getAccelerations())[6:]
        np.testing.assert_allclose(found, expected[HINGES], rtol=0, atol=1e3 * EPSILON * np.abs(expected).max())


# ------------------------------------------------------------------------------------------- contacts


@pytest.mark.parametrize("settings", [{}, {"solver": "nsgs", "friction": 1.1}], ids=["boxed-lcp", "nsgs"])
def test_forces_approach_the_reference_s_with_the_step(settings: dict[str, Any]) -> None:
    """In the third step, after the wheels have taken up their creep, which changes the forces by the step over time."""
    problem = circle()
    there = dynamics(BICYCLE, Plane(), problem.q, problem.qd).force
    errors = []
    for step in (1e-3, 5e-4, 2.5e-4):
        rig = Rig(problem, ENGINE.settings(step=step, **settings))
        for _ in range(3):
            rig.advance()
        errors.append(np.abs(rig.read_forces() - there).max() / np.abs(there).max())
    # The creep of h v^2 / R = 0.012 m/s at 1 ms is 0.2 % of the speed of 5.4 m/s.
    assert errors[0] < 0.02
    np.testing.assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 1, atol=0.3)


def test_wheels_creep_by_the_step_times_the_centripetal_acceleration() -> None:
    """slip = h v^2 / R, with v the speed of the rear contact on its path of radius R."""
    for step in (1e-3, 5e-4):
        problem = circle(1.0)
        found = run(problem, step=step)
        assert found.slip is not None
        speed, yaw_rate = 18.0 * BICYCLE.rear_wheel_radius, abs(problem.qd[YAW])
        creep = np.median(np.abs(found.slip[20:, 0]).max(axis=1))
        # In a second the creep itself turns the bicycle, by a tenth of the circle's rates.
        assert creep == pytest.approx(step * speed * yaw_rate, rel=0.1)


@pytest.mark.parametrize(("friction", "slides"), [(2.0, True), (6.7, False)])
def test_friction_that_the_default_solver_needs(friction: float, slides: bool) -> None:
    """Between them, where the forces need 0.996; see examples/defects/dart_friction_bound.py."""
    found = run(circle(1.0), friction=friction)
    assert found.slip is not None
    # Beyond ten times the creep of 0.012 m/s a wheel slides.
    assert (np.abs(found.slip).max() > 0.12) == slides


def test_a_contact_is_missed_now_and_then() -> None:
    """A wheel above the ground by nanometres has no contact in a step, and twice the force in the next one.

    The mean is right: the sum of the forces is the change of the momentum, whose rate is the reference's.
    """
    problem = circle(1.0, 1e-3)
    found, there = run(problem), exact(problem)
    assert found.contact_force is not None
    missed = (np.abs(found.contact_force).max(axis=2) == 0).sum(axis=0)
    assert np.all(missed <= 0.01 * len(problem.times))
    assert missed.sum() > 0, "no contact is missed any more: forces may be checked sample by sample"
    mean, right = found.contact_force[1:].mean(axis=0), there.force[1:].mean(axis=0)
    np.testing.assert_allclose(mean, right, rtol=0, atol=0.02 * np.abs(right).max())


def test_order_of_a_ride() -> None:
    problem = disturbed(1.0)
    there, errors = exact(problem), []
    for step in (2e-3, 1e-3, 5e-4):
        found = run(problem, step=step)
        assert found.ended is None
        errors.append(np.linalg.norm(found.q[:, :3] - there.q[:, :3], axis=1).max())
    np.testing.assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 1, atol=0.2)


def test_width_of_the_wheels_leads_an_upright_bicycle_astray() -> None:
    """It stands on one of two edges."""
    q, qd = consistent_state(BICYCLE, Plane(), (0.0, 0.0), 0.0, 0.0, (0.5, 0.0, 4.6 / 0.3))
    problem = Problem(BICYCLE, Plane(), q, qd, 0.1 * np.arange(101))
    there = exact(problem)
    thin, wide = (
        np.linalg.norm(run(problem, half_thickness=half).q[:, :3] - there.q[:, :3], axis=1).max()
        for half in (1e-6, 1e-3)
    )
    assert wide > 10 * thin


# ----------------------------------------------------------------------------------------------- refusals


def test_other_ground_is_refused() -> None:
    q, qd = consistent_state(BICYCLE, Paraboloid(0.1), (1.4, -0.6), 0.2, -0.1, (0.4, -0.3, 15.0))
    with pytest.raises(UnsuitableProblem, match="plane"):
        ENGINE.check(Problem(BICYCLE, Paraboloid(0.1), q, qd, np.array([0.0, 0.1])), ENGINE.settings())


def test_a_body_without_inertia_is_refused() -> None:
    problem = disturbed(0.1)
    hollow = Problem(replace(BICYCLE, rear_wheel_Iyy=0.0), Plane(), problem.q, problem.qd, problem.times)
    with pytest.raises(UnsuitableProblem, match="wheel's are not"):
        ENGINE.check(hollow, ENGINE.settings())


def test_noise_is_the_accuracy_of_the_iteration() -> None:
    assert ENGINE.step_noise(ENGINE.settings()) == CONDITION * EPSILON
    assert ENGINE.step_noise(ENGINE.settings(solver="nsgs", accuracy=1e-6)) == 1e-6
