"""Exudyn against the reference stage by stage, so that a difference is found where it is born."""

from __future__ import annotations

from functools import cache
from typing import Any

import exudyn as exu
import numpy as np
import pytest

from velodrome.engines.engine import Problem, Trajectory
from velodrome.engines.exudyn.engine import ENGINE
from velodrome.engines.exudyn.model import Model, build_model, read_motion
from velodrome.engines.exudyn.solve import Integration, integrate, no_progress
from velodrome.engines.exudyn.wheels import constrain
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.circular import CircularMotion
from velodrome.reference.dae import consistent_state, dynamics
from velodrome.reference.families import find_motion
from velodrome.reference.kinematics import angular_velocities, body_positions, body_velocities, rotations
from velodrome.reference.simulate import PreciseMotion, simulate
from velodrome.reference.surface import Paraboloid
from velodrome.reports.measure.convergence import extrapolate
from velodrome.reports.measure.steady import steady_trajectory

BICYCLE, BOWL = Bicycle(), Paraboloid(0.005)
RATE = 18.0  # rear wheel of Q2 [rad/s], its fastest rate
EPSILON = np.finfo(float).eps


@cache
def q2() -> CircularMotion:
    """The paper's point Q2 (Xiong et al. 2020, section 4.2), stable."""
    return find_motion(BICYCLE, BOWL, RATE, 2)[1]


@cache
def disturbed(duration: float, interval: float = 0.1) -> Problem:
    """Q2 with 0.1 rad/s of lean rate added."""
    q, _ = q2().state()
    q, qd = consistent_state(
        BICYCLE, BOWL, (q[0], q[1]), q[4], q[6], (0.1, 0.0, RATE), guess=(float(q[2]), float(q[5]))
    )
    return Problem(BICYCLE, BOWL, q, qd, interval * np.arange(round(duration / interval) + 1))


@cache
def exact(duration: float, interval: float = 0.1) -> PreciseMotion:
    task = disturbed(duration, interval)
    return simulate(task.bicycle, task.surface, task.q, task.qd, task.times, tolerance=1e-14)


def run(task: Problem, step: float, **settings: Any) -> Trajectory:
    chosen = ENGINE.settings.model_validate({"step": step, **settings})
    result = ENGINE.simulate(task, chosen, lambda _time: None)
    assert result.ended is None
    return result


def furthest(q: np.ndarray, other: np.ndarray) -> float:
    return float(np.linalg.norm(q[:, :3] - other[:, :3], axis=1).max())


def model_of(task: Problem) -> Model:
    with no_progress():
        return build_model(task, ENGINE.settings(), constrain)


def test_poses_and_velocities_at_the_start() -> None:
    task = disturbed(0.01, 0.01)
    model = model_of(task)
    with no_progress():
        integrate(model.system, Integration(0.01, 10, 1, ENGINE.settings()), lambda _time: None)
    motion, q, qd = read_motion(model), task.q[None], task.qd[None]
    # Some dozen operations on positions of 2.4 m and velocities of 5.4 m/s and 18 rad/s.
    limit = {"rtol": 0, "atol": 12 * EPSILON * RATE}
    np.testing.assert_allclose(motion.position[0], body_positions(task.bicycle, q)[0], **limit)
    np.testing.assert_allclose(motion.rotation[0], rotations(task.bicycle, q)[0], **limit)
    np.testing.assert_allclose(motion.velocity[0], body_velocities(task.bicycle, q, qd)[0], **limit)
    np.testing.assert_allclose(motion.spin[0], angular_velocities(task.bicycle, q, qd)[0], **limit)


def test_accelerations_at_the_start() -> None:
    """Of the four mass centres, and the angular ones, 2 vec(theta'' conj(theta)) of the Euler parameters."""
    task = disturbed(1.0)
    model, solver = model_of(task), exu.MainSolverImplicitSecondOrder()
    with no_progress():
        settings: Any = exu.SimulationSettings()
        settings.solution.file.write = False  # or a folder appears wherever the tests are run
        assert solver.InitializeSolver(model.system, settings)  # pyright: ignore[reportCallIssue]
    found = np.array(model.system.systemData.GetODE2Coordinates_tt()).reshape(4, 7)
    theta = np.array(model.system.systemData.GetODE2CoordinatesTotal()).reshape(4, 7)[:, 3:]
    qdd = dynamics(task.bicycle, task.surface, task.q, task.qd).acceleration

    def rates(e: float) -> tuple[np.ndarray, np.ndarray]:
        state = (task.q + e * task.qd)[None], (task.qd + e * qdd)[None]
        return body_velocities(task.bicycle, *state)[0], angular_velocities(task.bicycle, *state)[0]

    e = 1e-5  # leaves e^2 of the third derivatives and round-off over e
    linear, angular = ((b - a) / (2 * e) for a, b in zip(rates(-e), rates(e), strict=True))
    turned = np.array([_angular_acceleration(*pair) for pair in zip(theta, found[:, 3:], strict=True)])
    # The engine differentiates the rows' velocities, round-off and all, by forward differences of 1e-9 at the
    # least, and multiplies by the rates of four Euler parameters.
    limit = 4 * EPSILON * RATE / 1e-9 * RATE
    np.testing.assert_allclose(found[:, :3], linear, rtol=0, atol=limit)
    np.testing.assert_allclose(turned, angular, rtol=0, atol=limit)


def _angular_acceleration(theta: np.ndarray, second: np.ndarray) -> np.ndarray:
    return 2 * (theta[0] * second[1:] - second[0] * theta[1:] - np.cross(second[1:], theta[1:]))


def test_contact_forces_at_the_start() -> None:
    task = disturbed(1.0)
    multipliers = dynamics(task.bicycle, task.surface, task.q, task.qd).force
    force = run(disturbed(0.01, 0.01), 1e-3).contact_force
    assert force is not None
    # The engine differentiates its constraints by forward differences of 1e-7 of each coordinate.
    assert np.linalg.norm(force[0] - multipliers, axis=1).max() < 1e-6 * np.linalg.norm(multipliers, axis=1).max()


def test_the_first_tenth_of_a_second() -> None:
    """Every step of it: positions to the method's (k h)^2 / 12 of the way, forces to (k h)^2 of themselves."""
    step = 1e-3
    result, there = run(disturbed(0.1, step), step), exact(0.1, step)
    assert result.contact_force is not None
    way = 0.1 * float(np.linalg.norm(there.qd[:, :3], axis=1).max())
    assert furthest(result.q, there.q) < (RATE * step) ** 2 / 12 * way
    apart = np.linalg.norm(result.contact_force - there.force, axis=2)
    assert (apart / np.linalg.norm(there.force, axis=2)).max() < (RATE * step) ** 2


def test_engine_s_own_start_is_of_first_order() -> None:
    """What the corrected start is for: without it, forces are wrong by k h in the first steps."""
    step = 1e-3
    there = exact(0.1, step).force
    worst = []
    for size in (step, step / 2):
        force = run(disturbed(0.1, step), size, start="engine").contact_force
        assert force is not None
        worst.append((np.linalg.norm(force - there, axis=2) / np.linalg.norm(there, axis=2)).max())
    assert worst[0] / worst[1] < 4 * (1 - RATE * step)
    assert (RATE * step) ** 2 < worst[0] < RATE * step


@pytest.mark.slow
def test_twenty_seconds() -> None:
    result, there = run(disturbed(20.0), 1e-3), exact(20.0)
    way = 20 * float(np.linalg.norm(there.qd[:, :3], axis=1).max())
    assert furthest(result.q, there.q) < (RATE * 1e-3) ** 2 / 12 * way


@pytest.mark.slow
def test_limit_of_ten_seconds() -> None:
    """Observed order over three halvings, and Richardson's limit."""
    there = exact(10.0).q
    runs = [run(disturbed(10.0), step, newton_relative_tolerance=1e-12).q for step in (4e-3, 2e-3, 1e-3, 5e-4)]
    errors = [furthest(q, there) for q in runs]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    # The error C h^2 (1 + k h + ...) shows the order 2 up to k h over ln 2.
    for order, step in zip(orders, (4e-3, 2e-3, 1e-3), strict=True):
        assert order == pytest.approx(2, abs=RATE * step / 2 / np.log(2))
    assert orders[1:] == pytest.approx(2, abs=0.05)
    # Three extrapolations leave (k h)^3 of the finest error; the reference's own is 1e-11.
    assert furthest(extrapolate([q[:, :3] for q in runs]).value, there) < (RATE * 4e-3) ** 3 * errors[-1] < 1e-7


@pytest.mark.slow
def test_drift_of_two_minutes() -> None:
    """Q2 undisturbed: nothing drifts but the phase; the energy as generalized alpha dissipates, with h^3."""
    q, qd = q2().state()
    task = Problem(BICYCLE, BOWL, q, qd, np.arange(1201) / 10)
    steady = steady_trajectory(BICYCLE, q2(), task.times)
    loss, wobble = [], []
    for step in (2e-3, 1e-3):
        result = run(task, step)
        assert result.kinetic_energy is not None
        assert result.potential_energy is not None
        energy = result.kinetic_energy + result.potential_energy
        loss.append(1 - energy[-1] / energy[0])
        radius = np.hypot(result.q[:, 0], result.q[:, 1])
        wobble.append(np.abs(radius - radius[0]).max())
        way = 120 * float(np.linalg.norm(qd[:3]))
        assert furthest(result.q, steady.q) < (RATE * step) ** 2 / 12 * way
    assert loss[0] / loss[1] == pytest.approx(8, rel=RATE * 2e-3)
    assert wobble[0] / wobble[1] == pytest.approx(4, rel=RATE * 2e-3)
