"""MJX stage by stage: the ground, the contacts, the tree, the first forces, rides, batches, and what is refused.

Compiling takes most of the time, so that the tests share few rides: level ground and paraboloid, in either precision.
"""

# JAX is an extra, without which its types are not known.
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

pytest.importorskip("mujoco.mjx", reason="needs the extra mjx")

import jax
import jax.numpy as jnp
from mujoco import mjx

from velodrome.engines.engine import EngineError, Problem, Trajectory, UnsuitableProblem
from velodrome.engines.lagrange import ENGINE as REFERENCE
from velodrome.engines.mjx.contact import find_rim_contact
from velodrome.engines.mjx.engine import ENGINE, MULTIPLIERS
from velodrome.engines.mjx.ground import choose_height
from velodrome.engines.mjx.ride import build_setup
from velodrome.engines.mujoco.native import ENGINE as NATIVE
from velodrome.engines.mujoco.state import HINGES, spin_matrix, to_mujoco
from velodrome.engines.rolling import observe_wheel
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.bowls import Cone, Sphere, Torus
from velodrome.reference.dae import consistent_state
from velodrome.reference.height_field import HeightField
from velodrome.reference.inputs import Inputs
from velodrome.reference.kernels.dynamics import mass_and_bias
from velodrome.reference.kinematics import constants
from velodrome.reference.profile import PolynomialProfile
from velodrome.reference.surface import InclinedPlane, Paraboloid, Plane, Surface, evaluate
from velodrome.scenarios.scenario import load_scenario
from velodrome.scenarios.scenario.start import make_start
from velodrome.testing import check_engine

pytestmark = pytest.mark.engines

ROUND_OFF = 2.0**-52
SINGLE = 2.0**-23
TIGHT = {"tolerance": 1e-14}  # of the contact solver, at which MuJoCo and MJX find the same forces
SURFACES = [
    InclinedPlane(0.1, 0.7),
    Paraboloid(0.02),
    PolynomialProfile([0.02, -1e-4, 1e-6]),
    Sphere(12.0),
    Cone(0.4, 0.8),
    Torus(9.0, 6.0),
]


@cache
def problem_of(scenario: str, duration: float) -> Problem:
    problem = make_start(load_scenario(scenario)[1]).problem
    return replace(problem, times=problem.times[problem.times <= duration + 1e-9])


def run(engine: Any, problem: Problem, **settings: Any) -> Trajectory:
    chosen = engine.settings(**settings)
    engine.check(problem, chosen)
    return engine.simulate(problem, chosen, lambda time: None)


@cache
def exact(scenario: str, duration: float) -> Trajectory:
    return run(REFERENCE, problem_of(scenario, duration))


def apart(one: Trajectory, other: Trajectory) -> float:
    """Largest distance of D in two rides [m]."""
    assert len(one.time) == len(other.time)
    return float(np.linalg.norm(one.q[:, :3] - other.q[:, :3], axis=1).max())


def force_error(one: Trajectory, other: Trajectory, sample: int) -> float:
    return float(np.abs(np.asarray(one.contact_force)[sample] - np.asarray(other.contact_force)[sample]).max())


# ------------------------------------------------------------------------------------- the engine and its ground


def test_library_is_loaded_when_something_runs() -> None:
    code = "import sys, velodrome.engines.mjx.engine; print(sorted({'jax', 'mujoco'} & set(sys.modules)))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"


@pytest.mark.parametrize("surface", SURFACES, ids=lambda surface: type(surface).__name__)
def test_heights_are_those_of_the_surfaces(surface: Surface) -> None:
    height = choose_height(surface)
    assert height is not None
    x, y = np.random.default_rng(1).uniform(3, 7, (2, 100))
    expected = evaluate(surface, x, y)[:, 0]
    # Every height is a few roundings of numbers of its own size and of the radii's, some 10 m.
    np.testing.assert_allclose(height(x, y, surface.parameters), expected, rtol=0, atol=100 * ROUND_OFF)


def test_level_ground_needs_no_height() -> None:
    assert [choose_height(surface) for surface in (Plane(), Paraboloid(0.0), InclinedPlane(0.0))] == [None] * 3


def test_ground_without_a_closed_form_is_refused_by_name() -> None:
    waves = HeightField([[0.0, 0.1] * 4] * 8, 1.0, (0.0, 0.0))
    for engine in (ENGINE, MULTIPLIERS):
        with pytest.raises(UnsuitableProblem, match=r"HeightField.*one of Plane, InclinedPlane, .*Torus"):
            run(engine, replace(problem_of("q2", 0.1), surface=waves))


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"batch_size": 4, "batch_place": 4}, "batch_place is 4; in a batch of 4 it must be at most 3"),
        ({"precision": "float32", "step": 5e-5}, "with precision float32 it must be at least 0.0001 s"),
        ({"integrator": "implicit"}, "integrator"),
        ({"noslip_iterations": 1}, "noslip_iterations"),
        ({"precision": "float16"}, "precision"),
    ],
)
def test_settings_are_refused(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        ENGINE.settings(**settings)


def test_output_times_between_steps_are_refused() -> None:
    with pytest.raises(ValueError, match="must divide the output interval"):
        run(ENGINE, problem_of("q2", 0.1), step=0.003)


def test_noise_is_that_of_the_precision() -> None:
    for engine in (ENGINE, MULTIPLIERS):
        assert engine.step_noise(engine.settings(precision="float32")) == 4 * SINGLE
    assert MULTIPLIERS.step_noise(MULTIPLIERS.settings()) == 4 * ROUND_OFF
    assert ENGINE.step_noise(ENGINE.settings()) == 1e-8  # what its solver may leave


# ------------------------------------------------------------------------------------------------- the contact


@pytest.mark.parametrize("surface", [Plane(), *SURFACES], ids=lambda surface: type(surface).__name__)
def test_contact_and_its_run_are_those_of_the_kit(surface: Surface) -> None:
    """The derivative of the arm along a motion is w x d + the velocity of the contact along the rim."""
    rng, radius, count = np.random.default_rng(3), 0.35, 20
    angle, lean = rng.uniform(0, 2 * np.pi, count), rng.uniform(-0.9, 0.9, count)
    axle = np.stack([-np.sin(angle) * np.cos(lean), np.cos(angle) * np.cos(lean), np.sin(lean)], axis=-1)
    at = np.stack([rng.uniform(4, 7, count), rng.uniform(-3, 3, count)], axis=-1)
    centre = np.concatenate([at, evaluate(surface, *at.T)[:, :1] + radius * np.cos(lean)[:, None]], axis=1)
    velocity, spin = rng.uniform(-3, 3, (2, count, 3))
    kit = observe_wheel(surface, radius, centre, axle, velocity, spin)
    with jax.enable_x64(True):
        height, parameters = choose_height(surface), jnp.asarray(surface.parameters)

        def find(centre: Any, axle: Any) -> Any:
            return find_rim_contact(height, parameters, centre, axle, jnp.asarray(radius))

        def move(centre: Any, axle: Any, velocity: Any, spin: Any) -> Any:
            return jax.jvp(find, (centre, axle), (velocity, jnp.cross(spin, axle)))

        found, rate = jax.jit(jax.vmap(move))(centre, axle, velocity, spin)
    assert np.all(np.asarray(found.standing))
    # Newton's method ends some roundings of positions of 10 m away from the solution.
    for name, expected in (("normal", kit.normal), ("gap", kit.gap)):
        np.testing.assert_allclose(np.asarray(getattr(found, name)), expected, rtol=0, atol=1e-13)
    np.testing.assert_allclose(centre + np.asarray(found.arm), kit.point, rtol=0, atol=1e-13)
    turning = np.cross(spin, np.asarray(found.arm))
    run_along = kit.point_velocity - kit.velocity
    np.testing.assert_allclose(np.asarray(rate.arm) - turning, run_along, rtol=0, atol=1e-11)


# ---------------------------------------------------------------------------------------------------- the tree


def test_mass_matrix_bias_and_energy_are_those_of_the_reference() -> None:
    """M = T^T M' T and h = T^T (h' + M' T' q') with qvel = T q', at random states."""
    rng, problem = np.random.default_rng(2), problem_of("q2", 0.1)
    with jax.enable_x64(True):
        _, model, _, data = build_setup(problem, MULTIPLIERS.settings())
        evaluate_tree = jax.jit(lambda qpos, qvel: mjx.forward(model, data.replace(qpos=qpos, qvel=qvel)))
        for _ in range(10):
            q = np.concatenate([rng.uniform(-3, 3, 3), [rng.uniform(-9, 9), rng.uniform(-1.4, 1.4)]])
            q, qd = np.concatenate([q, rng.uniform(-9, 9, 4)]), rng.uniform(-5, 5, 9)
            found = evaluate_tree(*(jnp.asarray(values) for values in to_mujoco(q, qd)))
            theirs = np.asarray(mjx.full_m(model, found))
            transformation = np.zeros((9, 9))
            transformation[:3, :3], transformation[3:6, 3:6] = np.eye(3), spin_matrix(q)
            transformation[range(6, 9), HINGES] = 1
            step = 1e-30j
            drift = np.zeros(9)
            drift[3:6] = (spin_matrix(q + step * qd) @ qd[3:6]).imag / 1e-30
            mass, bias = np.empty((9, 9)), np.empty(9)
            mass_and_bias(q, qd, constants(problem.bicycle), mass, bias)
            ours = transformation.T @ theirs @ transformation
            np.testing.assert_allclose(ours, mass, rtol=0, atol=1e-12 * np.abs(mass).max())
            force = transformation.T @ (np.asarray(found.qfrc_bias) + theirs @ drift)
            np.testing.assert_allclose(force, bias, rtol=0, atol=1e-12 * np.abs(bias).max())
            kinetic = 0.5 * np.asarray(found.qvel) @ theirs @ np.asarray(found.qvel)
            np.testing.assert_allclose(kinetic, 0.5 * qd @ mass @ qd, rtol=1e-12)


# --------------------------------------------------------------------------------------------- exact multipliers


@pytest.mark.parametrize("scenario", ["plane-circle", "q2-plus"])
def test_first_forces_are_the_reference_s(scenario: str) -> None:
    """With a right tree the forces are right only if the accelerations are: 3e-13 of the weight, some roundings."""
    problem = problem_of(scenario, 0.1)
    weight = sum(problem.bicycle.body_mass(body) for body in ("rear_frame", "front_frame")) * problem.bicycle.gravity
    assert force_error(run(MULTIPLIERS, problem), exact(scenario, 0.1), 0) < 3e-13 * weight


def test_multipliers_follow_the_reference() -> None:
    reference, trajectory = exact("q2", 20.0), run(MULTIPLIERS, problem_of("q2", 20.0))
    assert trajectory.ended is None
    assert apart(trajectory, reference) < 1e-8
    assert trajectory.unconverged_steps == 0


def test_multipliers_have_order_four() -> None:
    problem, reference = problem_of("q2-plus", 2.0), exact("q2-plus", 2.0)
    coarse, fine = (apart(run(MULTIPLIERS, problem, step=step), reference) for step in (0.01, 0.005))
    assert 3.5 < np.log2(coarse / fine) < 4.8


def test_multipliers_in_single_precision() -> None:
    """D, 2.4 m from the origin, and its angles are rounded 10 000 times: a walk of 100 half units, at a right angle."""
    reference, trajectory = exact("q2", 20.0), run(MULTIPLIERS, problem_of("q2", 20.0), precision="float32")
    assert trajectory.ended is None
    assert 1e-6 < apart(trajectory, reference) < 1e-3
    assert np.array_equal(trajectory.q[:, 0], trajectory.q[:, 0].astype(np.float32))


# ------------------------------------------------------------------------------------------- contacts as in C


@pytest.mark.parametrize("scenario", ["iftomm-2", "q2-plus"])
def test_mjx_is_mujoco(scenario: str) -> None:
    """20 s on the plane and in the bowl: apart by the round-off of 10 000 steps at up to 92 m, which nothing amplifies.

    A rounding is 7e-15 m there; a walk of 10 000 is 7e-13 m.
    """
    problem = problem_of(scenario, 20.0)
    ours, theirs = run(ENGINE, problem, **TIGHT), run(NATIVE, problem, **TIGHT)
    assert ours.ended is theirs.ended is None
    assert apart(ours, theirs) < 1e-11
    assert ours.unconverged_steps == 0
    assert ours.largest_residual is not None
    assert ours.largest_residual < 1e-12
    # Rows are 190 times as stiff as the bicycle, and gaps stay those of positions of 92 m.
    assert force_error(ours, theirs, 0) < 1e-9
    assert force_error(ours, theirs, -1) < 1e-7
    for name in ("gap", "slip", "kinetic_energy", "body_position", "body_quaternion"):
        np.testing.assert_allclose(getattr(ours, name), getattr(theirs, name), rtol=1e-10, atol=1e-11)


def test_torques_and_steer_damping_are_applied() -> None:
    problem = replace(problem_of("iftomm-2", 1.0), inputs=Inputs(1.0, 2.0, 3.0))
    ours, theirs = run(ENGINE, problem, **TIGHT), run(NATIVE, problem, **TIGHT)
    assert apart(ours, theirs) < 1e-11
    assert apart(ours, run(NATIVE, problem_of("iftomm-2", 1.0), **TIGHT)) > 1e-3


def test_samples_do_not_depend_on_the_output_times() -> None:
    problem = problem_of("q2-plus", 1.0)
    often, seldom = run(ENGINE, problem), run(ENGINE, replace(problem, times=problem.times[::25]))
    # Coordinates are converted by numpy, whose last bits depend on the length of an array.
    for name in ("body_position", "body_quaternion", "contact_force", "kinetic_energy"):
        np.testing.assert_array_equal(getattr(often, name)[::25], getattr(seldom, name))
    assert often.steps == seldom.steps == 500


def test_jax_is_left_as_it_was() -> None:
    for before in (False, True):
        with jax.enable_x64(before):
            run(ENGINE, problem_of("iftomm-2", 0.1))
            assert jnp.zeros(1).dtype == (jnp.float64 if before else jnp.float32)


def test_ride_ends_where_a_wheel_lies_flat() -> None:
    """At walking pace the bicycle falls over; MuJoCo looks at its wheels every 10 ms, MJX in every step."""
    start = consistent_state(Bicycle(), Plane(), (0.0, 0.0), 0.3, 0.0, (0.5, 0.0, 1.0))
    problem = Problem(Bicycle(), Plane(), *start, np.arange(151) * 0.01, beyond_fall=True)
    ours, theirs = (run(engine, problem) for engine in (ENGINE, NATIVE))
    assert theirs.ended is not None
    assert ours.ended is not None
    assert "a wheel lies flat or has no contact point" in ours.ended
    assert abs(len(ours.time) - len(theirs.time)) <= 1


def test_solver_that_stops_unconverged_ends_the_ride() -> None:
    with pytest.raises(EngineError, match="MJX's contact solver stopped unconverged at 0 s"):
        run(ENGINE, problem_of("iftomm-2", 0.1), solver="CG", iterations=1)


# ------------------------------------------------------------------------------------------- batches, precisions


def test_places_of_a_batch_differ_by_round_off_alone() -> None:
    """Whatever the place and the size: round-off of 500 steps, as between MJX and MuJoCo; the same place repeats."""
    problem = problem_of("iftomm-2", 1.0)
    alone = run(ENGINE, problem, **TIGHT)
    first, last, again = (run(ENGINE, problem, batch_size=3, batch_place=place, **TIGHT) for place in (0, 2, 2))
    assert max(apart(alone, first), apart(alone, last)) < 1e-12
    np.testing.assert_array_equal(last.q, again.q)
    np.testing.assert_array_equal(last.contact_force, again.contact_force)
    assert last.steps == alone.steps == 500


def test_single_precision_costs_what_its_roundings_do() -> None:
    """D is some metres from the origin, and every step rounds it to 2^-24 of that."""
    problem = problem_of("iftomm-2", 1.0)
    rough, fine = run(ENGINE, problem, precision="float32"), run(ENGINE, problem, **TIGHT)
    assert rough.ended is None
    assert SINGLE < apart(rough, fine) < 500 * 5.0 * SINGLE
    assert rough.unconverged_steps == 0


# --------------------------------------------------------------------------------------------------- conformance


def check(engine: Any, **settings: Any) -> None:
    report = check_engine(engine, settings)
    skipped = {check.name for check in report.checks if check.outcome == "skipped"}
    assert skipped == {"order on waves"}  # no closed form
    assert len(report.checks) == 29


@pytest.mark.parametrize("engine", [ENGINE, MULTIPLIERS], ids=lambda engine: engine.name)
def test_an_engine_conforms(engine: Any) -> None:
    check(engine)


@pytest.mark.slow
@pytest.mark.parametrize("engine", [ENGINE, MULTIPLIERS], ids=lambda engine: engine.name)
def test_an_engine_conforms_in_single_precision(engine: Any) -> None:
    check(engine, precision="float32")


@pytest.mark.slow
@pytest.mark.parametrize(
    "settings", [{"integrator": "RK4"}, {"integrator": "Euler", "cone": "pyramidal"}, {"solver": "CG"}]
)
def test_mjx_is_mujoco_with_other_settings(settings: dict[str, Any]) -> None:
    problem = problem_of("iftomm-2", 1.0)
    same = {name: value for name, value in settings.items() if name != "solver"}
    ours, theirs = run(ENGINE, problem, **settings, **TIGHT), run(NATIVE, problem, **same, **TIGHT)
    # CG stops at its tolerance, the others at round-off; MJX's RK4 is of order 2, and C's of order 4.
    limits = {"CG": 1e-6, "RK4": 1e-4}
    limit = max([1e-11, *(limits[value] for value in settings.values() if value in limits)])
    assert apart(ours, theirs) < limit
    assert (ours.unconverged_steps is None) == (settings.get("integrator") == "RK4")


@pytest.mark.slow
@pytest.mark.parametrize("surface", SURFACES, ids=lambda surface: type(surface).__name__)
def test_multipliers_ride_on_every_ground(surface: Surface) -> None:
    q, qd = consistent_state(Bicycle(), surface, (6.0, 0.5), 0.1, 0.05, (0.1, 0.0, 15.0), yaw=1.7)
    problem = Problem(Bicycle(), surface, q, qd, np.arange(101) * 0.01)
    assert apart(run(MULTIPLIERS, problem), run(REFERENCE, problem)) < 1e-6
