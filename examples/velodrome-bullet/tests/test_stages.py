"""Bullet against the reference stage by stage, so that a difference is found where it is born."""

# PyBullet is an optional library, and its compiled bindings carry no types.
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from velodrome.engines.coordinates import BODIES, angular_velocities, body_positions, body_velocities, rotations
from velodrome.engines.engine import Problem, Trajectory, UnsuitableProblem
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.dae import consistent_state, dynamics
from velodrome.reference.families import find_motion
from velodrome.reference.kernels.dynamics import mass_and_bias
from velodrome.reference.kinematics import YAW, constants
from velodrome.reference.simulate import simulate
from velodrome.reference.surface import Paraboloid, Plane

pytest.importorskip("pybullet", reason="PyBullet is not installed; make test-packages installs it")

from velodrome_bullet.engine import ENGINE
from velodrome_bullet.ride import Rig, State, open_world
from velodrome_bullet.tree import COLUMNS, describe_bicycle

BICYCLE = Bicycle()
EPSILON = np.finfo(float).eps


def random_states(n: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """High above the ground."""
    rng = np.random.default_rng(5)
    states = []
    for _ in range(n):
        angles = [rng.uniform(-3, 3), rng.uniform(-1.4, 1.4), *rng.uniform(-3, 3, 4)]
        position = [*rng.uniform(-3, 3, 2), 10.0]
        states.append((np.concatenate([position, angles]), rng.uniform(-5, 5, 9)))
    return states


def circle(duration: float = 0.1, interval: float = 0.01) -> Problem:
    """The stable circle of the scenario plane-circle."""
    q, qd = find_motion(BICYCLE, Plane(), 18.0, 2, (0.73, 2.84))[1].state()
    return Problem(BICYCLE, Plane(), q, qd, interval * np.arange(round(duration / interval) + 1))


def run(problem: Problem, **settings: Any) -> Trajectory:
    return ENGINE.simulate(problem, ENGINE.settings(**settings), lambda _time: None)


# ----------------------------------------------------------------------------------------------- the tree


def test_inertia_of_the_described_bodies() -> None:
    """Principal moments turned back by the angles of the description."""
    for link in ElementTree.fromstring(describe_bicycle(BICYCLE, 1e-3)).iter("link"):
        inertial = link.find("inertial")
        assert inertial is not None
        origin, mass, tensor = (inertial.find(name) for name in ("origin", "mass", "inertia"))
        assert origin is not None
        assert mass is not None
        assert tensor is not None
        axes = Rotation.from_euler("xyz", [float(angle) for angle in origin.attrib["rpy"].split()]).as_matrix()
        moments = [float(tensor.attrib[name]) for name in ("ixx", "iyy", "izz")]
        expected = BICYCLE.inertia(link.attrib["name"])
        np.testing.assert_allclose(
            axes @ np.diag(moments) @ axes.T, expected, rtol=0, atol=32 * EPSILON * expected.max()
        )
        assert float(mass.attrib["value"]) == BICYCLE.body_mass(link.attrib["name"])


def test_state_is_read_as_it_was_set() -> None:
    problem = circle()
    with open_world() as client:
        rig = Rig(problem, ENGINE.settings(), client)
        for q, qd in random_states(20):
            rig.set_state(q, qd)
            found = rig.read_state()
            right = State(
                body_positions(BICYCLE, q)[0],
                body_velocities(BICYCLE, q, qd)[0],
                rotations(BICYCLE, q),
                angular_velocities(BICYCLE, q, qd),
                q[COLUMNS],
                qd[COLUMNS],
            )
            for name in State.__dataclass_fields__:
                # Some roundings of positions and speeds of some tens.
                np.testing.assert_allclose(getattr(found, name), getattr(right, name), rtol=0, atol=1e3 * EPSILON)


def test_accelerations_of_the_tree_without_contacts() -> None:
    """M q'' + h = 0 of the hinges: a step changes the velocities by it, to the round-off of the mass matrix."""
    settings = ENGINE.settings()
    with open_world() as client:
        rig = Rig(circle(), settings, client)
        for q, qd in random_states(20):
            mass, bias = np.empty((9, 9)), np.empty(9)
            mass_and_bias(q, qd, constants(BICYCLE), mass, bias)
            expected = np.linalg.solve(mass, -bias)
            rig.set_state(q, qd)
            rig.advance()
            found = (rig.read_state().rates - qd[COLUMNS]) / settings.step
            np.testing.assert_allclose(found, expected[COLUMNS], rtol=0, atol=1e3 * EPSILON * np.abs(expected).max())


# ------------------------------------------------------------------------------------------- contacts


def test_forces_are_near_the_reference_s() -> None:
    """In the third step, after the wheels have taken up their creep."""
    problem = circle()
    there = dynamics(BICYCLE, Plane(), problem.q, problem.qd).force
    with open_world() as client:
        rig = Rig(problem, ENGINE.settings(), client)
        for _ in range(3):
            rig.advance()
        found = rig.read_forces()
    # A creep of 0.01 m/s is 0.2 % of the speed, and the rounded rim moves the contact by 1 mm, 0.3 % of the radius.
    np.testing.assert_allclose(found, there, rtol=0, atol=0.02 * np.abs(there).max())


def test_creep_is_of_the_size_of_the_step_times_the_centripetal_acceleration() -> None:
    for step in (1e-3, 5e-4):
        problem = circle(1.0)
        found = run(problem, step=step)
        assert found.slip is not None
        creep = np.median(np.abs(found.slip[20:, 0]).max(axis=1))
        law = step * 18.0 * BICYCLE.rear_wheel_radius * abs(problem.qd[YAW])
        assert 0.5 * law < creep < 1.1 * law


def test_the_default_erp_fells_a_stable_circle() -> None:
    problem = circle(3.0)
    for erp, falls in ((0.0, False), (0.2, True)):
        lean = run(problem, contact_erp=erp).q[:, 4]
        assert (np.abs(lean - problem.q[4]).max() > 0.5) == falls


def test_rides_converge_to_another_limit_than_the_reference() -> None:
    """By differences between steps, order 1; the rounded rim is another wheel, so the error itself does not vanish."""
    problem = circle(1.0)
    there = simulate(BICYCLE, Plane(), problem.q, problem.qd, problem.times)
    rides = [run(problem, step=step).q[:, :3] for step in (1e-3, 5e-4, 2.5e-4)]
    apart = [np.linalg.norm(fine - coarse, axis=1).max() for coarse, fine in pairwise(rides)]
    assert np.log2(apart[0] / apart[1]) == pytest.approx(1, abs=0.5)
    assert np.linalg.norm(rides[-1] - there.q[:, :3], axis=1).max() > apart[1]


# ----------------------------------------------------------------------------------------------- refusals


def test_other_ground_is_refused() -> None:
    q, qd = consistent_state(BICYCLE, Paraboloid(0.1), (1.4, -0.6), 0.2, -0.1, (0.4, -0.3, 15.0))
    with pytest.raises(UnsuitableProblem, match="plane"):
        ENGINE.check(Problem(BICYCLE, Paraboloid(0.1), q, qd, np.array([0.0, 0.1])), ENGINE.settings())


def test_a_body_without_inertia_is_refused() -> None:
    problem = circle()
    hollow = Problem(replace(BICYCLE, rear_wheel_Iyy=0.0), Plane(), problem.q, problem.qd, problem.times)
    with pytest.raises(UnsuitableProblem, match="wheel's are not"):
        ENGINE.check(hollow, ENGINE.settings())


def test_bodies_are_all_there() -> None:
    assert [link.attrib["name"] for link in ElementTree.fromstring(describe_bicycle(BICYCLE, 1e-3)).iter("link")] == [
        *BODIES
    ]
