"""Pinocchio against the reference stage by stage, so that a difference is found where it is born."""

# pinocchio is an optional library whose compiled bindings carry no types.
# pyright: reportMissingImports=false

from __future__ import annotations

import tomllib
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ripples import Ripples

from velodrome.engines.engine import EngineError, Problem, Trajectory, UnsuitableProblem
from velodrome.engines.pinocchio.engine import CONSTRAINT
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.bowls import Torus
from velodrome.reference.dae import consistent_state, dynamics
from velodrome.reference.families import find_motion
from velodrome.reference.height_field import HeightField
from velodrome.reference.inputs import NO_INPUTS, Inputs
from velodrome.reference.kernels.dynamics import energies, mass_and_bias
from velodrome.reference.kernels.kinematics import angular_velocities, frames
from velodrome.reference.kinematics import LEAN, PITCH, YAW, constants, rotations
from velodrome.reference.simulate import PreciseMotion, simulate
from velodrome.reference.surface import Paraboloid, Plane, Surface
from velodrome.testing import check_engine

pin = pytest.importorskip("pinocchio", reason="the extra pinocchio is not installed")

from velodrome.engines.pinocchio.dynamics import ConstrainedBicycle  # noqa: E402
from velodrome.engines.pinocchio.ride import PinocchioRide  # noqa: E402
from velodrome.engines.pinocchio.tree import HINGES, build_pinocchio_model, to_pinocchio  # noqa: E402

pytestmark = pytest.mark.engines

BICYCLE, BOWL = Bicycle(), Paraboloid(0.005)
EPSILON = np.finfo(float).eps
# Mass matrices and J M^-1 J^T have conditions of some 1e3.
ROUND_OFF = 1e3 * EPSILON
GROUNDS: dict[str, Surface] = {
    "plane": Plane(),
    "bowl": Paraboloid(0.1),
    "torus": Torus(2.0, 3.0),
    "ripples": Ripples(0.15),
}


def random_states(n: int) -> list[tuple[np.ndarray, np.ndarray]]:
    rng = np.random.default_rng(5)
    states = []
    for _ in range(n):
        angles = [rng.uniform(-9, 9), rng.uniform(-1.4, 1.4), *rng.uniform(-9, 9, 4)]
        states.append((np.concatenate([rng.uniform(-3, 3, 3), angles]), rng.uniform(-5, 5, 9)))
    return states


def differentiate_velocity(q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
    """Derivative of Pinocchio's velocity (R' D', R' w, rates of the hinges) for accelerations of the coordinates."""
    a_lean, _, y_r, _, s, *_ = frames(q[3], q[4], q[5], q[6], constants(BICYCLE))
    spin, _, bias, _ = angular_velocities(a_lean, y_r, s, qd[3], qd[4], qd[5], qd[6])
    turning = np.array(bias) + qdd[YAW] * np.array([0, 0, 1.0])
    turning += qdd[LEAN] * np.array(a_lean) + qdd[PITCH] * np.array(y_r)
    rear = rotations(BICYCLE, q)[0]
    return np.concatenate([rear.T @ (qdd[:3] - np.cross(spin, qd[:3])), rear.T @ turning, qdd[HINGES]])


@cache
def disturbed(duration: float, interval: float = 0.1) -> Problem:
    """Q2 (Xiong et al. 2020, section 4.2) with 0.1 rad/s of lean rate added."""
    q, _ = find_motion(BICYCLE, BOWL, 18.0, 2, (0.74, 2.84))[1].state()
    guess = (float(q[2]), float(q[5]))
    q, qd = consistent_state(BICYCLE, BOWL, (q[0], q[1]), q[4], q[6], (0.1, 0.0, 18.0), guess=guess)
    return Problem(BICYCLE, BOWL, q, qd, interval * np.arange(round(duration / interval) + 1))


@cache
def exact(duration: float, interval: float = 0.1, inputs: Inputs = NO_INPUTS) -> PreciseMotion:
    task = disturbed(duration, interval)
    return simulate(task.bicycle, task.surface, task.q, task.qd, task.times, tolerance=1e-14, inputs=inputs)


def run(task: Problem, **settings: Any) -> Trajectory:
    return CONSTRAINT.simulate(task, CONSTRAINT.settings(**settings), lambda _time: None)


def furthest(q: np.ndarray, other: np.ndarray) -> float:
    return float(np.linalg.norm(q[:, :3] - other[: len(q), :3], axis=1).max())


# ----------------------------------------------------------------------------------------------- the tree


def test_mass_matrix_of_the_tree() -> None:
    """M of Pinocchio's velocity v = S q' as S' M S."""
    model = build_pinocchio_model(BICYCLE)
    data = model.createData()
    for q, _ in random_states(50):
        columns = [to_pinocchio(BICYCLE, q, rates)[1] for rates in np.eye(9)]
        found = pin.crba(model, data, to_pinocchio(BICYCLE, q, np.zeros(9))[0])
        found = np.triu(found) + np.triu(found, 1).T
        mass, bias = np.empty((9, 9)), np.empty(9)
        mass_and_bias(q, np.zeros(9), constants(BICYCLE), mass, bias)
        np.testing.assert_allclose(
            columns @ found @ np.transpose(columns), mass, rtol=0, atol=16 * EPSILON * mass.max()
        )


def test_energies_of_the_tree() -> None:
    model = build_pinocchio_model(BICYCLE)
    data = model.createData()
    for q, qd in random_states(50):
        kinetic, potential = energies(q, qd, constants(BICYCLE))
        state = to_pinocchio(BICYCLE, q, qd)
        # Sums of some dozen terms; the potential passes zero: relative to the weight lifted by a metre.
        assert pin.computeKineticEnergy(model, data, *state) == pytest.approx(kinetic, rel=64 * EPSILON)
        lifted = pytest.approx(potential, rel=64 * EPSILON, abs=64 * EPSILON * 94 * 9.81)
        assert pin.computePotentialEnergy(model, data, state[0]) == lifted


def test_accelerations_of_the_tree_without_contacts() -> None:
    """M q'' + h = 0: the bias forces."""
    model = build_pinocchio_model(BICYCLE)
    data = model.createData()
    for q, qd in random_states(50):
        mass, bias = np.empty((9, 9)), np.empty(9)
        mass_and_bias(q, qd, constants(BICYCLE), mass, bias)
        expected = differentiate_velocity(q, qd, np.linalg.solve(mass, -bias))
        found = pin.aba(model, data, *to_pinocchio(BICYCLE, q, qd), np.zeros(9))
        np.testing.assert_allclose(found, expected, rtol=0, atol=ROUND_OFF * np.abs(expected).max())


# ------------------------------------------------------------------------------------------- rolling contacts


@pytest.mark.parametrize("inputs", [NO_INPUTS, Inputs(3.0, -5.0, 0.7)], ids=["hands-free", "inputs"])
@pytest.mark.parametrize("ground", GROUNDS)
def test_first_accelerations_and_forces(ground: str, inputs: Inputs) -> None:
    surface = GROUNDS[ground]
    q, qd = consistent_state(BICYCLE, surface, (1.4, -0.6), 0.1, -0.2, (0.4, -0.3, 9.0), yaw=0.4)
    problem = Problem(BICYCLE, surface, q, qd, np.array([0.0, 0.01]), inputs)
    there = dynamics(BICYCLE, surface, q, qd, inputs)
    bicycle = ConstrainedBicycle(problem, CONSTRAINT.settings())
    found = bicycle.accelerate(*to_pinocchio(BICYCLE, q, qd))
    expected = differentiate_velocity(q, qd, there.acceleration)
    np.testing.assert_allclose(found, expected, rtol=0, atol=ROUND_OFF * np.abs(expected).max())
    np.testing.assert_allclose(bicycle.force, there.force, rtol=0, atol=ROUND_OFF * np.abs(there.force).max())
    assert bicycle.converged


@pytest.mark.parametrize("regularisation", [0.0, 1e-8, 1e-4])
def test_regularisation_does_not_change_the_solution(regularisation: float) -> None:
    """The proximal iteration removes it: the last change of the forces bounds their error."""
    problem, there = disturbed(0.1), exact(0.1)
    settings = CONSTRAINT.settings(regularisation=regularisation)
    bicycle = ConstrainedBicycle(problem, settings)
    bicycle.accelerate(*to_pinocchio(BICYCLE, problem.q, problem.qd))
    assert bicycle.converged
    limit = settings.accuracy + ROUND_OFF * np.abs(there.force[0]).max()
    np.testing.assert_allclose(bicycle.force, there.force[0], rtol=0, atol=limit)


# ------------------------------------------------------------------------------------------------ steps, rides


@pytest.mark.parametrize(("integrator", "order"), [("rk4", 4), ("semi-implicit-euler", 1)])
def test_error_of_one_step(integrator: str, order: int) -> None:
    """It is of one order more than the ride's; C h^(p+1) (1 + k h) shows it up to k h over ln 2."""
    errors = []
    for step in (4e-3, 2e-3):
        task = disturbed(step, step)
        found, there = run(task, step=step, integrator=integrator), exact(step, step)
        errors.append(np.abs(found.qd[1] - there.qd[1]).max())
    fastest = 18.0  # of the rear wheel [rad/s]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order + 1, abs=fastest * 4e-3 / np.log(2))


@pytest.mark.parametrize("duration", [2.0, pytest.param(20.0, marks=pytest.mark.slow)])
def test_a_ride_has_order_four(duration: float) -> None:
    errors = []
    for step in (0.01, 0.005, 0.0025):
        result = run(disturbed(duration), step=step)
        assert result.ended is None
        assert result.unconverged_steps == 0
        errors.append(furthest(result.q, exact(duration).q))
    assert errors[1] < 5e-6
    np.testing.assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 4, atol=0.1)


def test_semi_implicit_euler_has_order_one() -> None:
    errors = [
        furthest(run(disturbed(2.0), step=step, integrator="semi-implicit-euler").q, exact(2.0).q)
        for step in (2e-3, 1e-3, 5e-4)
    ]
    np.testing.assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 1, atol=0.1)


def test_the_baumgarte_corrector_brings_wheels_back() -> None:
    """On the plane a gap g obeys g'' = -Kd g' - Kp g: critically damped at a rate k, it is d (1 + k t) exp(-k t)."""
    lifted, k, step = 1e-4, 10.0, 1e-3
    q, qd = consistent_state(BICYCLE, Plane(), (0.1, 0.2), 0.1, 0.05, (0.1, 0.0, 15.0))
    q[2] += lifted
    task = Problem(BICYCLE, Plane(), q, qd, np.arange(11) / 20)
    free, corrected = run(task, step=step), run(task, step=step, baumgarte_kp=k**2, baumgarte_kd=2 * k)
    expected = lifted * (1 + k * task.times) * np.exp(-k * task.times)
    # The method's (k h)^4 of the gap, and in each of 500 steps (w h)^5 / 120 of a wheel's 0.3 m that turns at 15 rad/s.
    limit = lifted * (k * step) ** 4 + 500 * (15 * step) ** 5 / 120 * 0.3
    for found, right in ((free, np.full(11, lifted)), (corrected, expected)):
        assert found.gap is not None
        np.testing.assert_allclose(found.gap, np.column_stack([right, right]), rtol=0, atol=limit)


def test_inputs_act_as_in_the_reference() -> None:
    inputs = Inputs(0.05, 0.2, 0.03)
    there = exact(5.0, inputs=inputs)
    found = run(replace(disturbed(5.0), inputs=inputs))
    assert furthest(there.q, exact(5.0).q) > 0.1
    assert furthest(found.q, there.q) < 5e-6


def test_samples_do_not_change_the_ride() -> None:
    often, seldom = run(disturbed(1.0, 0.01)), run(disturbed(1.0))
    # Yaw, lean and pitch are continued from sample to sample; the rates are those of the state itself.
    for name in ("qd", "contact_force", "kinetic_energy"):
        np.testing.assert_array_equal(getattr(often, name)[::10], getattr(seldom, name), err_msg=name)


# --------------------------------------------------------------------------------------- refusals and endings


def test_a_bicycle_without_inertia_is_refused() -> None:
    problem = replace(disturbed(0.1), bicycle=replace(BICYCLE, rear_wheel_Iyy=0.0))
    with pytest.raises(UnsuitableProblem, match="mass matrix"):
        CONSTRAINT.check(problem, CONSTRAINT.settings())


def case(name: str) -> Problem:
    """One of the cases of upright rides over a height field."""
    data = tomllib.loads((Path(__file__).parents[1] / "cases" / name).read_text())
    ground = data["surface"]
    surface = HeightField(ground["heights"], ground["spacing"], tuple(ground["origin"]))
    rates = (data.get("perturbation", {}).get("lean_rate", 0.0), 0.0, data["motion"]["speed"] / 0.3)
    start = consistent_state(BICYCLE, surface, (float(BICYCLE.reference_point[0]), 0.0), 0.0, 0.0, rates)
    return Problem(BICYCLE, surface, *start, np.arange(151) / 100)


def test_a_rim_in_the_ground_is_refused() -> None:
    with pytest.raises(EngineError, match=r"the front rim lies 36\.2 mm inside the ground"):
        run(case("ripples-tight.toml"))


def test_a_ride_ends_where_a_rim_touches_a_second_place() -> None:
    """The reference's ride ends at 0.722178 s. Rims are looked at after each step, and the time is interpolated."""
    result = run(case("hollow.toml"), step=1e-3)
    assert result.ended is not None
    assert result.ended.startswith("the front rim touches the ground at a second place at t = 0.722")
    assert result.time[-1] == pytest.approx(0.72)


def test_a_solver_that_does_not_converge_ends_the_ride() -> None:
    """A regularisation as large as the bodies' mobilities leaves a large part of the forces to the second iteration."""
    with pytest.raises(EngineError, match="stopped unconverged at 0 s: the contact forces changed by"):
        run(disturbed(0.1), iterations=2, regularisation=1e-2)
    counted = run(disturbed(0.1), iterations=2, regularisation=1e-4)
    assert counted.ended is None
    assert counted.unconverged_steps == counted.steps == 20
    assert counted.largest_residual is not None
    assert CONSTRAINT.settings().accuracy / 1e3 < counted.largest_residual < 0.01


def test_a_ride_ends_where_a_wheel_loses_the_ground() -> None:
    """Out of the torus's outer edge, where its ground ends."""
    surface = Torus(2.0, 3.0)
    q, qd = consistent_state(BICYCLE, surface, (3.0, 0.0), 0.0, 0.0, (0.0, 0.0, 40.0))
    result = run(Problem(BICYCLE, surface, q, qd, np.arange(101) / 50))
    assert result.ended is not None
    assert 0 < result.time[-1] < 2
    assert np.all(np.isfinite(result.qd))


def test_an_infinite_state_ends_the_ride() -> None:
    ride = PinocchioRide(disturbed(0.1), CONSTRAINT.settings())
    ride.velocity[6:] *= 1e200
    ended = ride.advance()
    assert ended is not None
    assert "became infinite" in ended


@pytest.mark.slow
@pytest.mark.parametrize(
    "settings",
    [{}, {"integrator": "semi-implicit-euler"}, {"baumgarte_kp": 100, "baumgarte_kd": 20}],
    ids=["default", "semi-implicit-euler", "baumgarte"],
)
def test_it_conforms(settings: dict[str, Any]) -> None:
    report = check_engine(CONSTRAINT, settings)
    assert [check.name for check in report.checks if check.outcome == "skipped"] == []
