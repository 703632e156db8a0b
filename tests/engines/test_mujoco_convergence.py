"""MuJoCo's contact solver: it finds what it looks for, or the ride says that it did not."""

# MuJoCo's compiled bindings carry no types.
# pyright: reportAttributeAccessIssue=false

import re
from functools import cache

import mujoco
import numpy as np
import pytest

from velodrome.engines.engine import EngineError, Problem, Trajectory
from velodrome.engines.lagrange import ENGINE as REFERENCE
from velodrome.engines.mujoco import default, edges, exact_contact, multipliers, native
from velodrome.engines.mujoco import ride as ride_module
from velodrome.engines.mujoco.convergence import watch_solver
from velodrome.engines.mujoco.knife_edge import knife_edges, stiffen
from velodrome.engines.mujoco.ride import set_start
from velodrome.engines.mujoco.settings import (
    WRONG,
    ContactSettings,
    DefaultSettings,
    ExactContactSettings,
    NativeSettings,
)
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.dae import consistent_state
from velodrome.reference.families import find_motion
from velodrome.reference.surface import Paraboloid, Plane

# Straight ahead with a small roll rate: (speed [m/s], lean rate [rad/s]). There a wheel's friction is next to nothing,
# and from where the solver stands sliding and sticking are a hair apart.
STRAIGHT = {"1": (4.0, 0.05), "2": (4.6, 0.5), "3": (8.0, 0.05)}
WHEELS = {"rear": "ground", "front": "ground"}


@cache
def straight(name: str, duration: float) -> Problem:
    speed, lean_rate = STRAIGHT[name]
    rates = (lean_rate, 0.0, speed / Bicycle().rear_wheel_radius)
    q, qd = consistent_state(Bicycle(), Plane(), (float(Bicycle().reference_point[0]), 0.0), 0.0, 0.0, rates)
    return Problem(Bicycle(), Plane(), q, qd, np.arange(round(duration * 100) + 1) / 100)


@cache
def circle(duration: float) -> Problem:
    """The paper's Q2; it needs a coefficient of friction of 0.96."""
    bowl = Paraboloid(1 / 200)
    _, found = find_motion(Bicycle(), bowl, 18.0, 2, (0.74, 2.84))
    return Problem(Bicycle(), bowl, *found.state(), np.arange(round(duration * 100) + 1) / 100)


def run(engine, problem: Problem, **settings) -> Trajectory:
    return engine.ENGINE.simulate(problem, engine.ENGINE.settings(**settings), lambda t: None)


@cache
def exact(name: str, duration: float) -> Trajectory:
    return REFERENCE.simulate(straight(name, duration), REFERENCE.settings(), lambda t: None)


def assert_right(name: str, duration: float, impratio: float) -> None:
    trajectory, reference = run(exact_contact, straight(name, duration), impratio=impratio), exact(name, duration)
    assert trajectory.ended is None
    assert trajectory.unconverged_steps == 0
    assert np.linalg.norm(trajectory.q[:, :3] - reference.q[:, :3], axis=1).max() < 1e-5
    force = np.abs(np.asarray(trajectory.contact_force) - np.asarray(reference.contact_force)).max()
    # What RK4 makes of the ride itself, which the multipliers, without a solver, share.
    assert force < 4e-7 * np.abs(np.asarray(reference.contact_force)).max()


@pytest.mark.parametrize("impratio", [1.0, 10.0, 100.0])
def test_straight_ride_is_right_at_any_impratio(impratio) -> None:
    assert_right("1", 1.0, impratio)


@pytest.mark.slow
@pytest.mark.parametrize("impratio", [1.0, 10.0, 100.0])
@pytest.mark.parametrize("name", STRAIGHT)
def test_straight_rides_are_right_at_any_impratio_for_ten_seconds(name, impratio) -> None:
    assert_right(name, 10.0, impratio)


# ------------------------------------------------------------------------------------------- the residual


def independent_residual(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    rows = data.efc_J.reshape(-1, model.nv)
    left = mass @ data.qacc - data.qfrc_smooth - rows.T @ data.efc_force

    def size(force: np.ndarray) -> float:
        return float(np.sqrt(force @ np.linalg.solve(mass, force)))

    return size(left) / max(size(rows.T @ data.efc_force), size(data.qfrc_smooth))


@pytest.mark.parametrize("iterations", [1, 2, 4, 100])
def test_residual_is_the_gradient_of_the_solver_s_cost(iterations) -> None:
    """A wheel that slides takes the solver some hundred iterations; stopped before, it is where it happens to be."""
    settings = ExactContactSettings(friction=0.5)
    rig = edges.build_contacts(circle(1.0), settings)
    rig.model.opt.iterations = iterations
    with rig.callbacks() as convergence:
        mujoco.mj_forward(rig.model, rig.data)
        convergence.look()
        # Round-off in a force of the rows' stiffness.
        expected = independent_residual(rig.model, rig.data)
        assert expected > 0.01
        assert convergence.largest is not None
        np.testing.assert_allclose(convergence.largest, expected, rtol=1e-6)
        assert convergence.wrong == (0, convergence.largest)


@pytest.mark.parametrize("integrator", ["Euler", "implicit", "implicitfast", "RK4", "discrete"])
def test_watch_sees_every_stage_and_changes_nothing(integrator) -> None:
    problem, settings = circle(1.0), NativeSettings(integrator=integrator)
    model, data = set_start(problem, settings, "plane")
    other = mujoco.MjData(model)
    other.qpos[:], other.qvel[:] = data.qpos, data.qvel
    mujoco.mj_step(model, other, 20)
    with watch_solver(model, data, settings.converged_below) as convergence:
        convergence.begin(0)
        mujoco.mj_step(model, data, 20)
        convergence.look()
        # MuJoCo's Newton ends on the quadratic that it last solved: round-off of a 9 x 9, of condition 1e3 or so.
        assert convergence.largest is not None
        assert convergence.largest < 1e3 * 2.0**-52 * 10
        assert convergence.unconverged == 0
    np.testing.assert_array_equal(data.qpos, other.qpos)


def test_unconverged_steps_are_counted_as_steps() -> None:
    """Whatever the stages: five steps of a solver that may not iterate are five, from where they begin."""
    settings = ExactContactSettings(friction=0.5)
    rig = edges.build_contacts(circle(1.0), settings)
    with rig.callbacks() as convergence:
        convergence.begin(100)
        mujoco.mj_step(rig.model, rig.data, 3)
        convergence.look()
        assert (convergence.unconverged, convergence.wrong) == (0, None)
        rig.model.opt.iterations = 1
        mujoco.mj_step(rig.model, rig.data, 5)
        convergence.look()
        assert convergence.unconverged == 5
        assert convergence.wrong is not None
        assert convergence.wrong[0] == 103


def limit_iterations(monkeypatch: pytest.MonkeyPatch, kind: type[ContactSettings], iterations: int) -> None:
    options = {"iterations": iterations, "ls_iterations": 200}
    monkeypatch.setattr(kind, "solver_options", property(lambda self: options))
    # Settings determine a model, but not those that are replaced here.
    monkeypatch.setattr(ride_module, "_compile_model", ride_module._compile_model.__wrapped__)


def test_ride_ends_where_the_solver_fails(monkeypatch) -> None:
    """Its first sample is no sample; later on what was right before stays."""
    limit_iterations(monkeypatch, ExactContactSettings, 20)
    with pytest.raises(EngineError, match=r"MuJoCo's contact solver stopped unconverged at 0 s: its forces are off"):
        run(exact_contact, circle(1.0), friction=0.5)
    trajectory = run(exact_contact, circle(1.0), friction=0.95)
    assert trajectory.ended is not None
    found = re.match(r"MuJoCo's contact solver stopped unconverged at ([0-9.]+) s", trajectory.ended)
    assert found is not None
    # Up to the sample before, which had nothing wrong with it.
    assert 0 < trajectory.time[-1] <= float(found[1]) < trajectory.time[-1] + 0.01 + 1e-9
    assert trajectory.unconverged_steps is not None
    assert trajectory.unconverged_steps > 0
    assert trajectory.largest_residual is not None
    assert trajectory.largest_residual > WRONG


@pytest.mark.parametrize("engine", [native, default])
def test_own_contacts_are_watched_too(engine, monkeypatch) -> None:
    kind = NativeSettings if engine is native else DefaultSettings
    right = run(engine, circle(0.2))
    assert right.unconverged_steps == 0
    assert right.largest_residual is not None
    # One that slides or falls ends with what the tolerance of 1e-8 allows.
    assert right.largest_residual < kind().converged_below
    limit_iterations(monkeypatch, kind, 1)
    with pytest.raises(EngineError, match="MuJoCo's contact solver stopped unconverged at 0 s"):
        run(engine, circle(0.2), friction=0.5)


def test_what_nobody_can_tell_is_not_said() -> None:
    """After the noslip pass the gradient is zero whatever the forces; the multipliers have no solver."""
    hard = run(native, circle(0.1), noslip_iterations=5)
    assert (hard.unconverged_steps, hard.largest_residual) == (None, None)
    solved = run(multipliers, circle(0.1))
    assert (solved.unconverged_steps, solved.largest_residual) == (0, None)


# ------------------------------------------------------------------------------------ sliding and the start


@pytest.mark.parametrize("impratio", [1.0, 100.0])
@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
def test_wheels_that_slide_converge(cone, impratio) -> None:
    trajectory = run(exact_contact, circle(0.1), friction=0.5, cone=cone, impratio=impratio)
    assert trajectory.ended is None
    assert trajectory.unconverged_steps == 0
    assert trajectory.slip is not None
    assert np.linalg.norm(trajectory.slip[-1], axis=1).max() > 0.1


def test_solver_s_start_changes_nothing_but_its_cost(monkeypatch) -> None:
    """From the accelerations without contacts, MuJoCo's cold start, the solver finds the same to the step's noise."""
    problem = circle(0.5)
    warm = run(exact_contact, problem)
    begin = edges.set_start

    def cold(*arguments):
        model, data = begin(*arguments)
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_WARMSTART
        return model, data

    monkeypatch.setattr(edges, "set_start", cold)
    other = run(exact_contact, problem)
    assert other.unconverged_steps == 0
    change = np.abs(other.q - warm.q).max() / np.abs(warm.q).max()
    # The noise of a step, each carried on by rates of up to 18 1/s for half a second.
    noise = exact_contact.ENGINE.step_noise(exact_contact.ENGINE.settings())
    assert change < noise * warm.steps * np.exp(0.5 * 18.0)


# --------------------------------------------------------------------------------------- a stranger's model


def tandem(friction: float, impratio: float) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Two wheels on one frame, 14 kg, with MuJoCo's own solver options; it rolls straight and leans."""

    def wheel(name: str, x: float) -> str:
        return (
            f'<body name="{name}" pos="{x} 0 0"><joint type="hinge" axis="0 1 0"/>'
            '<inertial pos="0 0 0" mass="2" diaginertia=".045 .09 .045"/><geom name="'
            f'{name}" type="cylinder" size="0.3 0.001" zaxis="0 1 0" contype="0" conaffinity="0"/></body>'
        )

    pairs = "".join(
        f'<pair geom1="ground" geom2="{name}" condim="3" friction="{friction} {friction} 0 0 0" solref="0.05 1" '
        'solimp="0.9999 0.9999 0.001 0.5 2" margin="1e-3" gap="1e9"/>'
        for name in WHEELS
    )
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><compiler inertiafromgeom="false"/>'
        f'<option timestep="0.002" integrator="RK4" cone="elliptic" impratio="{impratio}"/><worldbody>'
        '<geom name="ground" type="plane" size="0 0 1" contype="0" conaffinity="0"/><body pos="0 0 0.3"><freejoint/>'
        f'<inertial pos="0 0 0.5" mass="10" diaginertia="1 1.5 1"/>{wheel("rear", -0.5)}{wheel("front", 0.5)}</body>'
        f"</worldbody><contact>{pairs}</contact></mujoco>"
    )
    data = mujoco.MjData(model)
    data.qvel[[0, 1, 3, 6, 7]] = 4.0, 0.03, 0.1, 4.0 / 0.3, 4.0 / 0.3
    stiffen(model, WHEELS, 1e-5)
    return model, data


@pytest.mark.parametrize(("friction", "impratio"), [(2.0, 10.0), (1.0, 10.0), (2.0, 100.0), (1.0, 100.0)])
def test_forces_in_a_stranger_s_model(friction, impratio) -> None:
    """It rolls straight and falls over slowly: forces stay near the weight of 137 N."""
    model, data = tandem(friction, impratio)
    with knife_edges(model, data, Plane(), WHEELS) as contacts:
        for _ in range(300):
            mujoco.mj_forward(model, data)
            assert 137 * 0.9 < data.efc_force.reshape(2, 3)[:, 0].sum() < 137 * 1.1
            mujoco.mj_step(model, data)
        assert contacts.standing()


def test_stranger_s_block_ends_with_an_error_where_the_solver_failed() -> None:
    model, data = tandem(1.0, 10.0)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_WARMSTART

    def step_without_room() -> None:
        with knife_edges(model, data, Plane(), WHEELS):
            model.opt.iterations = 1
            mujoco.mj_step(model, data, 10)

    with pytest.raises(EngineError, match="stopped unconverged"):
        step_without_room()


def test_tolerance_says_what_converged_means() -> None:
    """Looser tolerances and stiffer rows allow more, up to what ends a ride."""
    limits = [ExactContactSettings(tolerance=tolerance).converged_below for tolerance in (1e-22, 1e-14, 1e-8)]
    assert limits[0] < 1e-5 < limits[1] < limits[2] == WRONG
    assert NativeSettings().converged_below < WRONG
