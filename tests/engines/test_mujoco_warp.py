"""MuJoCo Warp stage by stage: settings, the tree, the first forces, a step, rides, batches, and what is refused."""

# MuJoCo Warp is an extra, without which its types are not known; MuJoCo's compiled bindings carry none.
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

pytest.importorskip("mujoco_warp", reason="needs the extra warp")

import mujoco
import mujoco_warp
import warp

from velodrome.engines.engine import EngineError, Problem, Trajectory
from velodrome.engines.lagrange import ENGINE as REFERENCE
from velodrome.engines.mujoco.model import mjcf
from velodrome.engines.mujoco.native import ENGINE as NATIVE
from velodrome.engines.mujoco.ride import read_contact_forces
from velodrome.engines.mujoco.state import HINGES, from_mujoco, spin_matrix, to_mujoco
from velodrome.engines.mujoco_warp import ride
from velodrome.engines.mujoco_warp.engine import ENGINE
from velodrome.engines.mujoco_warp.evaluation import Evaluation
from velodrome.engines.mujoco_warp.process import quiet_warp
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.dae import consistent_state
from velodrome.reference.inputs import Inputs
from velodrome.reference.kernels.dynamics import mass_and_bias
from velodrome.reference.kinematics import constants
from velodrome.reference.surface import Plane
from velodrome.scenarios.scenario import load_scenario
from velodrome.scenarios.scenario.start import make_start
from velodrome.testing import check_engine

pytestmark = pytest.mark.engines

SINGLE = 2.0**-23
SETTINGS = ENGINE.settings()
# Rates of a contact row at a depth and a velocity: k = 1 / (d T r)^2 and b = 2 / (d T), with d its largest impedance.
STIFFNESS, DAMPING = 1 / (0.95 * SETTINGS.contact_time) ** 2, SETTINGS.damping


@cache
def problem_of(scenario: str, duration: float) -> Problem:
    problem = make_start(load_scenario(scenario)[1]).problem
    return replace(problem, times=problem.times[problem.times <= duration + 1e-9])


def run(engine: Any, problem: Problem, **settings: Any) -> Trajectory:
    chosen = engine.settings(**settings)
    engine.check(problem, chosen)
    return engine.simulate(problem, chosen, lambda time: None)


def apart(one: Trajectory, other: Trajectory) -> float:
    """Largest distance of D in two rides [m]."""
    assert len(one.time) == len(other.time)
    return float(np.linalg.norm(one.q[:, :3] - other.q[:, :3], axis=1).max())


def round_states(qpos: np.ndarray, qvel: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return qpos.astype(np.float32).astype(float), qvel.astype(np.float32).astype(float)


# ---------------------------------------------------------------------------------------- settings and what is known


def test_library_is_loaded_when_something_runs() -> None:
    code = "import sys, velodrome.engines.mujoco_warp.engine; print(sorted({'warp', 'mujoco'} & set(sys.modules)))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"batch_size": 4, "batch_place": 4}, "batch_place is 4; in a batch of 4 it must be at most 3"),
        ({"step": 5e-5}, "greater than or equal to 0.0001"),
        ({"tolerance": 1e-8}, "tolerance"),
        ({"integrator": "discrete"}, "integrator"),
        ({"device": "gpu"}, "device"),
        ({"precision": "float64"}, "precision"),
    ],
)
def test_settings_are_refused(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        ENGINE.settings(**settings)


def test_a_processor_that_is_not_there_is_refused() -> None:
    with pytest.raises(ValueError, match="device is 'cuda:99'; Warp finds cpu"):
        run(ENGINE, problem_of("q2", 0.1), device="cuda:99")


def test_output_times_between_steps_are_refused() -> None:
    with pytest.raises(ValueError, match="must divide the output interval"):
        run(ENGINE, problem_of("q2", 0.1), step=0.003)


def test_noise_is_what_the_solver_may_leave() -> None:
    assert ENGINE.step_noise(SETTINGS) == 1e-6 > 4 * SINGLE
    assert ENGINE.step_noise(ENGINE.settings(tolerance=1e-3)) == 1e-3


def test_what_mujoco_warp_changes_or_refuses_of_a_model() -> None:
    """As long as this passes, the settings bound the tolerance, and the flag must go."""
    model = mujoco.MjModel.from_xml_string(mjcf(Bicycle(), NATIVE.settings(), "plane"))
    with quiet_warp(), pytest.raises(NotImplementedError, match="AUTORESET"):
        mujoco_warp.put_model(model)
    model.opt.disableflags = 0
    with quiet_warp(), warp.ScopedDevice("cpu"):
        assert model.opt.tolerance == 1e-8
        assert mujoco_warp.put_model(model).opt.tolerance.numpy() == np.float32(1e-6)


# ---------------------------------------------------------------------------------------------------- the tree


def test_mass_matrix_bias_and_energy_are_those_of_the_reference() -> None:
    """M = T^T M' T and h = T^T (h' + M' T' q') with qvel = T q', at random states, to some roundings of sums."""
    rng, problem, count = np.random.default_rng(2), problem_of("q2", 0.1), 10
    q = np.concatenate([rng.uniform(-3, 3, (count, 3)), rng.uniform(-1.4, 1.4, (count, 6))], axis=1)
    states = [round_states(*to_mujoco(*state)) for state in zip(q, rng.uniform(-5, 5, (count, 9)), strict=True)]
    with quiet_warp(), warp.ScopedDevice("cpu"):
        begun = ride.build_ride(problem, ENGINE.settings(batch_size=count))
        for name, values in zip(("qpos", "qvel"), zip(*states, strict=True), strict=True):
            getattr(begun.data, name).assign(np.array(values, dtype=np.float32))
        mujoco_warp.forward(begun.model, begun.data)
        for place, (qpos, qvel) in enumerate(states):
            here = Evaluation(begun.rig, begun.model, begun.data, place)
            (q,), (qd,) = from_mujoco(np.zeros(1), qpos[None], qvel[None], np.zeros(9))
            transformation, drift, step = np.zeros((9, 9)), np.zeros(9), 1e-30j
            transformation[:3, :3], transformation[3:6, 3:6] = np.eye(3), spin_matrix(q)
            transformation[range(6, 9), HINGES] = 1
            drift[3:6] = (spin_matrix(q + step * qd) @ qd[3:6]).imag / 1e-30
            mass, bias = np.empty((9, 9)), np.empty(9)
            mass_and_bias(q, qd, constants(problem.bicycle), mass, bias)
            theirs = here.mass_matrix
            ours = transformation.T @ theirs @ transformation
            np.testing.assert_allclose(ours, mass, rtol=0, atol=20 * SINGLE * np.abs(mass).max())
            force = transformation.T @ (begun.data.qfrc_bias.numpy()[place] + theirs @ drift)
            np.testing.assert_allclose(force, bias, rtol=0, atol=20 * SINGLE * np.abs(bias).max())
            kinetic = begun.data.energy.numpy()[place, 1]
            np.testing.assert_allclose(kinetic, 0.5 * qd @ mass @ qd, rtol=20 * SINGLE)


# ----------------------------------------------------------------------------------------- first forces and a step


@pytest.mark.parametrize("scenario", ["plane-circle", "q2-plus"])
def test_first_forces_and_a_step_are_mujoco_s(scenario: str) -> None:
    """From the same state, rounded to single precision, and with the same margin.

    A row's acceleration is off by the roundings of its depth times the stiffness k, and of its velocity times b. The
    wheels carry the whole bicycle. A step adds the acceleration's error times the step, and rounds its result.
    """
    problem = problem_of(scenario, 0.1)
    with quiet_warp(), warp.ScopedDevice("cpu"):
        begun = ride.build_ride(problem, SETTINGS)
        here = begun.begin()
        model, data = begun.rig.model, begun.rig.data
        data.qpos[:], data.qvel[:] = here.qpos, here.qvel
        mujoco.mj_forward(model, data)
        expected = np.empty((2, 3))
        read_contact_forces(model, data, begun.rig.wheels, expected)
        speed, size = np.abs(here.qvel).max(), max(1.0, np.abs(here.qpos[:3]).max())
        error = 4 * SINGLE * (STIFFNESS * size + DAMPING * speed)
        weight = sum(problem.bicycle.body_mass(body) for body in ("rear_frame", "front_frame"))
        force = here.contact_force
        assert 0 < np.abs(force - expected).max() < weight * error
        assert here.residual < 1e-4
        mujoco.mj_step(model, data)
        after = begun.step()
        # Wheels turn by the force at their rims: the acceleration by that of the rim over the radius, and twice that.
        largest = error * 2 / problem.bicycle.rear_wheel_radius
        assert np.abs(after.qvel - data.qvel).max() < SETTINGS.step * largest + 2 * SINGLE * speed
        assert np.abs(after.qpos - data.qpos).max() < SETTINGS.step**2 * largest + 2 * SINGLE * size


# ------------------------------------------------------------------------------------------------------- rides


@pytest.mark.parametrize("scenario", ["plane-circle", "q2-plus"])
def test_single_precision_costs_what_its_roundings_do(scenario: str) -> None:
    """D is some 10 m from the origin, and each of 500 steps rounds it to 2^-24 of that."""
    problem = problem_of(scenario, 1.0)
    ours, theirs = run(ENGINE, problem), run(NATIVE, problem)
    assert ours.ended is None
    assert SINGLE < apart(ours, theirs) < 500 * 10 * SINGLE
    assert ours.steps == theirs.steps == 500
    assert ours.unconverged_steps == 0
    assert ours.largest_residual is not None
    assert ours.largest_residual < 1e-3
    # The engine creeps as MuJoCo does: its distance from the reference is none of round-off.
    exact = run(REFERENCE, problem)
    np.testing.assert_allclose(apart(ours, exact), apart(theirs, exact), rtol=0.05)
    assert np.array_equal(ours.q[:, 0], ours.q[:, 0].astype(np.float32))


def test_torques_and_steer_damping_are_applied() -> None:
    problem = replace(problem_of("iftomm-2", 0.5), inputs=Inputs(1.0, 2.0, 3.0))
    ours, theirs = run(ENGINE, problem), run(NATIVE, problem)
    assert apart(ours, theirs) < 250 * 10 * SINGLE
    assert apart(theirs, run(NATIVE, problem_of("iftomm-2", 0.5))) > 1e-3


def test_samples_do_not_depend_on_the_output_times() -> None:
    problem = problem_of("q2-plus", 0.5)
    often, seldom = run(ENGINE, problem), run(ENGINE, replace(problem, times=problem.times[::25]))
    # Coordinates are converted by numpy, whose last bits depend on the length of an array.
    for name in ("body_position", "body_quaternion", "contact_force", "kinetic_energy"):
        np.testing.assert_array_equal(getattr(often, name)[::25], getattr(seldom, name))


@pytest.mark.parametrize("scenario", ["plane-circle", "q2-plus"])
def test_places_of_a_batch_give_the_same_bits(scenario: str) -> None:
    problem = problem_of(scenario, 0.2)
    alone = run(ENGINE, problem)
    for place in (0, 2):
        other = run(ENGINE, problem, batch_size=3, batch_place=place)
        for name in ("q", "qd", "contact_force", "kinetic_energy"):
            np.testing.assert_array_equal(getattr(other, name), getattr(alone, name))


def test_ride_ends_where_a_wheel_lies_flat() -> None:
    start = consistent_state(Bicycle(), Plane(), (0.0, 0.0), 0.3, 0.0, (0.5, 0.0, 1.0))
    problem = Problem(Bicycle(), Plane(), *start, np.arange(151) * 0.01, beyond_fall=True)
    ours, theirs = (run(engine, problem) for engine in (ENGINE, NATIVE))
    assert theirs.ended is not None
    assert ours.ended is not None
    assert "a wheel lies flat or has no contact point" in ours.ended
    assert abs(len(ours.time) - len(theirs.time)) <= 1


def test_solver_that_stops_unconverged_ends_the_ride() -> None:
    with pytest.raises(EngineError, match="MuJoCo Warp's contact solver stopped unconverged at 0 s"):
        run(ENGINE, problem_of("iftomm-2", 0.1), solver="CG", iterations=1)


def test_conjugate_gradients_stop_too_early() -> None:
    """A cost of the least tolerance, 1e-6, may be 1.4 % of the forces; Newton's method stops far below it."""
    trajectory = run(ENGINE, problem_of("iftomm-2", 0.1), solver="CG")
    assert trajectory.ended is not None
    assert "stopped unconverged" in trajectory.ended


@pytest.mark.parametrize(("room", "what"), [({"CONTACTS": 1}, "contacts"), ({"ROWS": 3}, "constraint rows")])
def test_contacts_without_room_are_refused(room: dict[str, int], what: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """MuJoCo Warp itself leaves out what does not fit, and goes on."""
    for name, value in room.items():
        monkeypatch.setattr(ride, name, value)
    with pytest.raises(EngineError, match=f"MuJoCo Warp has more {what} than it has room for"):
        run(ENGINE, problem_of("iftomm-2", 0.1))


def test_nothing_is_printed_and_warp_is_left_as_it_was(capfd: pytest.CaptureFixture[str]) -> None:
    before = warp.config.log_level
    run(ENGINE, problem_of("iftomm-2", 0.1))
    assert warp.config.log_level == before
    assert capfd.readouterr().out == ""


# --------------------------------------------------------------------------------------------------- conformance


def test_the_engine_conforms() -> None:
    report = check_engine(ENGINE)
    assert {check.outcome for check in report.checks} == {"passed"}
    assert len(report.checks) == 30


@pytest.mark.slow
@pytest.mark.parametrize(
    "settings",
    [
        {"integrator": "implicit"},
        {"integrator": "RK4"},
        {"integrator": "Euler", "cone": "pyramidal"},
        {"noslip_iterations": 3},
    ],
)
def test_it_is_mujoco_with_other_settings(settings: dict[str, Any]) -> None:
    problem = problem_of("iftomm-2", 1.0)
    ours, theirs = run(ENGINE, problem, **settings), run(NATIVE, problem, **settings)
    assert apart(ours, theirs) < 500 * 10 * SINGLE
    hidden = settings.get("integrator") == "RK4" or "noslip_iterations" in settings
    assert (ours.unconverged_steps is None) == hidden
