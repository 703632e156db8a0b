"""MuJoCo's native model: its tree against the reference's, its contacts against the laws they follow."""

# MuJoCo's compiled bindings carry no types.
# pyright: reportAttributeAccessIssue=false

import subprocess
import sys
from dataclasses import fields, replace

import mujoco
import numpy as np
import pytest
from pydantic import ValidationError
from ripples import Ripples
from scipy.optimize import root

from benchmarks.mujoco_settings.study import slip_power
from velodrome.engines.engine import EngineError, Problem, Trajectory
from velodrome.engines.mujoco.native import ENGINE
from velodrome.engines.mujoco.planes import build_planes
from velodrome.engines.mujoco.ride import Rig
from velodrome.engines.mujoco.settings import IMPEDANCES
from velodrome.engines.mujoco.state import HINGES, from_mujoco, spin_matrix, to_mujoco
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.contact import observe
from velodrome.reference.dae import consistent_state, dynamics
from velodrome.reference.kernels import dynamics as kernel
from velodrome.reference.kinematics import body_positions, constants, quaternions, rotations
from velodrome.reference.surface import Paraboloid, Plane, Surface
from velodrome.reports.measure.creep import contact_acceleration

BOWL = Paraboloid(1 / 200)
# Q2's spectrum: the fastest mode decays at 12.3 1/s, the weave turns at 6.7 rad/s; the wheels spin at 18 rad/s.
FASTEST_MODE = 12.3
SPIN = 18.0


def circular_start(surface: Surface) -> tuple[np.ndarray, np.ndarray]:
    """State of family 2 at rear_rate = 18, near Q2 (Xiong et al. 2020, section 4.2)."""
    bicycle = Bicycle()

    def acceleration(v):
        q, qd = consistent_state(bicycle, surface, (v[0], v[1]), v[2], v[3], (0.0, 0.0, SPIN))
        a = dynamics(bicycle, surface, q, qd).acceleration
        # D runs around the axis; lean and steer stay.
        return [qd[0] + qd[3] * v[1], qd[1] - qd[3] * v[0], a[4], a[6]]

    x, y, lean, steer = root(acceleration, [0.99, 2.15, 0.737, 2.84], tol=1e-14).x
    return consistent_state(bicycle, surface, (x, y), lean, steer, (0.0, 0.0, SPIN))


def every(interval: float, duration: float) -> np.ndarray:
    return np.arange(round(duration / interval) + 1) * interval


@pytest.fixture(scope="module")
def q2() -> Problem:
    return Problem(Bicycle(), BOWL, *circular_start(BOWL), every(0.01, 2.0))


@pytest.fixture(scope="module")
def circle() -> Problem:
    return Problem(Bicycle(), Plane(), *circular_start(Plane()), every(0.01, 2.0))


@pytest.fixture(scope="module")
def q2_disturbed(q2) -> Problem:
    """Q2 with the lean rate raised by 0.1 rad/s; the other speeds are solved."""
    q, _ = q2.q, q2.qd
    q, qd = consistent_state(Bicycle(), BOWL, (q[0], q[1]), q[4], q[6], (0.1, 0.0, SPIN), guess=(q[2], q[5]))
    return replace(q2, q=q, qd=qd)


def run(problem: Problem, **settings) -> Trajectory:
    return ENGINE.simulate(problem, ENGINE.settings(**settings), lambda t: None)


def random_bicycle(rng: np.random.Generator) -> Bicycle:
    """The benchmark with every parameter within 2 %: still rigid bodies."""
    values = {f.name: getattr(Bicycle(), f.name) * (1 + 0.02 * rng.uniform(-1, 1)) for f in fields(Bicycle)}
    for name in ("rear_wheel_Iyy", "front_wheel_Iyy"):
        # A thin ring meets the triangle inequality with equality: the limit of what MuJoCo must take.
        values[name] = 2 * values[name.replace("yy", "xx")]
    return Bicycle(**values)


def random_state(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    q = np.concatenate([rng.uniform(-3, 3, 3), [rng.uniform(-9, 9), rng.uniform(-1.4, 1.4)], rng.uniform(-9, 9, 4)])
    return q, rng.uniform(-5, 5, 9)


def set_state(rig: Rig, q: np.ndarray, qd: np.ndarray) -> None:
    rig.data.qpos[:], rig.data.qvel[:] = to_mujoco(q, qd)
    mujoco.mj_forward(rig.model, rig.data)


def rate_of_velocity(q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
    """Time derivative of qvel along a motion, by the complex step."""
    q, qd = q + 1e-30j * qd, qd + 1e-30j * qdd
    return np.concatenate([qd[:3], spin_matrix(q) @ qd[3:6], qd[HINGES]]).imag / 1e-30


# ---------------------------------------------------------------------------------------------- the tree


def test_state_round_trip() -> None:
    rng = np.random.default_rng(1)
    for _ in range(50):
        q, qd = random_state(rng)
        q[5] = rng.uniform(-3, 3)
        qpos, qvel = to_mujoco(q, qd)
        again = from_mujoco(np.zeros(1), qpos[None], qvel[None], q)
        # Round-off of a division by cos(lean) >= 0.17.
        np.testing.assert_allclose(np.concatenate(again).ravel(), [*q, *qd], rtol=0, atol=1e-13)


def test_mass_matrix_and_bias_are_those_of_the_reference(q2) -> None:
    """M = T^T M' T and h = T^T (h' + M' T' q') with qvel = T q' ."""
    rng = np.random.default_rng(2)
    for _ in range(20):
        bicycle, (q, qd) = random_bicycle(rng), random_state(rng)
        rig = build_planes(replace(q2, bicycle=bicycle, surface=Plane()), ENGINE.settings())
        set_state(rig, q, qd)
        transformation = np.zeros((9, 9))
        transformation[:3, :3], transformation[3:6, 3:6] = np.eye(3), spin_matrix(q)
        transformation[range(6, 9), HINGES] = 1
        theirs = np.zeros((9, 9))
        mujoco.mj_fullM(rig.model, rig.data, theirs)
        drift = rate_of_velocity(q, qd, np.zeros(9))
        mass, bias = np.empty((9, 9)), np.empty(9)
        kernel.mass_and_bias(q, qd, constants(bicycle), mass, bias)
        scale = np.abs(mass).max()
        np.testing.assert_allclose(transformation.T @ theirs @ transformation, mass, rtol=0, atol=1e-12 * scale)
        force = transformation.T @ (rig.data.qfrc_bias + theirs @ drift)
        np.testing.assert_allclose(force, bias, rtol=0, atol=1e-12 * np.abs(bias).max())


def test_poses_and_energies_are_those_of_the_reference(q2_disturbed) -> None:
    trajectory = run(q2_disturbed)
    bicycle = q2_disturbed.bicycle
    seen = observe(bicycle, BOWL, trajectory.q, trajectory.qd)
    assert trajectory.kinetic_energy is not None
    assert trajectory.potential_energy is not None
    np.testing.assert_allclose(trajectory.kinetic_energy, seen.kinetic_energy, rtol=1e-12)
    np.testing.assert_allclose(trajectory.potential_energy, seen.potential_energy, rtol=1e-12)
    np.testing.assert_allclose(trajectory.body_position, body_positions(bicycle, trajectory.q), rtol=0, atol=1e-12)
    same = np.einsum("nbi,nbi->nb", trajectory.body_quaternion, quaternions(rotations(bicycle, trajectory.q)))
    np.testing.assert_allclose(np.abs(same), 1, rtol=0, atol=1e-12)


def test_start_is_exact(q2_disturbed) -> None:
    trajectory = run(replace(q2_disturbed, times=every(0.01, 0.01)))
    np.testing.assert_allclose(trajectory.q[0], q2_disturbed.q, rtol=0, atol=1e-14)
    np.testing.assert_allclose(trajectory.qd[0], q2_disturbed.qd, rtol=0, atol=1e-13)


def test_turns_at_the_start_are_kept(q2) -> None:
    q = q2.q.copy()
    q[3] += 4 * np.pi
    trajectory = run(replace(q2, q=q, surface=BOWL, times=every(0.01, 0.1)))
    # A yaw of two turns more is the same heading to the round-off of 4 pi.
    assert abs(trajectory.q[0, 3] - q[3]) < 1e-14 * q[3] * 10


# -------------------------------------------------------------------------------------------- the ground


@pytest.mark.parametrize("surface", [BOWL, Paraboloid(0.2), Ripples(0.05)])
def test_contact_is_the_closest_approach_on_any_surface(surface) -> None:
    """MuJoCo's distance, normal and point on the moving planes are those of the true surface."""
    bicycle = Bicycle()
    for x, y, lean, steer in ((1.0, 2.0, 0.4, 0.3), (-2.0, 0.5, -0.6, -0.4), (0.3, -1.5, 0.1, 1.0)):
        q, qd = consistent_state(bicycle, surface, (x, y), lean, steer, (0.1, 0.2, 5.0), yaw=0.7)
        q[2] -= 2e-3
        rig = build_planes(Problem(bicycle, surface, q, qd, every(0.01, 0.1)), ENGINE.settings())
        mujoco.mj_forward(rig.model, rig.data)
        seen = observe(bicycle, surface, q[None], qd[None])
        assert rig.data.ncon == 2
        for i in range(2):
            k = rig.wheels[int(rig.data.contact.geom[i, 1])]
            # The ellipsoid is e = 0.1 mm thick: its support exceeds the edge's by at most e^2 / (2 r s).
            assert abs(rig.data.contact.dist[i] - seen.gap[0, k]) < 1e-4**2 / (2 * 0.3 * 0.5)
            np.testing.assert_allclose(rig.data.contact.frame[i, :3], seen.normal[0, k], rtol=0, atol=1e-12)
            middle = seen.point[0, k] - 0.5 * seen.gap[0, k] * seen.normal[0, k]
            # ... and its deepest point lies up to e off the wheel's plane, where the normal tilts by e / r.
            np.testing.assert_allclose(rig.data.contact.pos[i], middle, rtol=0, atol=1e-4)


def test_plane_and_flat_bowl_are_the_same(circle) -> None:
    flat = run(replace(circle, surface=Paraboloid(0.0)))
    np.testing.assert_array_equal(flat.q, run(circle).q)


def test_moving_planes_on_flat_ground_change_nothing(circle) -> None:
    """A bowl with a radius of curvature of 5e9 m takes the moving planes, and rides like the plane."""
    # At 2.5 m its slope is 5e-10, which makes 2.5e-9 m in 1 s; ten times that for angles and the wheels.
    bowl = run(replace(circle, surface=Paraboloid(1e-10), times=every(0.01, 1.0)))
    plane = run(replace(circle, times=every(0.01, 1.0)))
    assert np.abs(bowl.q - plane.q).max() < 2.5e-8


# -------------------------------------------------------------------------- the contacts' laws of motion


def creep(problem: Problem, trajectory: Trajectory) -> tuple[np.ndarray, float]:
    """Slip (n, 2, 2) that balances J' q' / b at each sample, and b."""
    b = ENGINE.settings(**trajectory.settings).damping
    return contact_acceleration(problem.bicycle, problem.surface, trajectory.q, trajectory.qd) / b, b


@pytest.mark.parametrize("step", [0.002, 0.001])
@pytest.mark.parametrize("start", ["circle", "q2_disturbed"])
def test_wheels_creep_by_the_missing_acceleration(start, step, request) -> None:
    """Slip = J' q' / b, but for what is of higher order.

    - The contact lies half the depth inside the wheel: spin * depth / 2.
    - The slip follows its equilibrium at the rate b, while the motion changes at its own.
    - A row is compliant by (1 - d) / d / impratio of its own acceleration, of the size of J' q' or so.
    """
    problem = request.getfixturevalue(start)
    trajectory = run(problem, step=step, impratio=100.0)
    assert trajectory.slip is not None
    assert trajectory.gap is not None
    predicted, b = creep(problem, trajectory)
    error = np.linalg.norm(trajectory.slip - predicted, axis=2)
    size = np.linalg.norm(predicted, axis=2)
    depth = np.abs(trajectory.qd[:, 7:]) * np.abs(trajectory.gap) / 2
    compliance = 2 * (1 - IMPEDANCES[0]) / IMPEDANCES[0] / 100
    settled = trajectory.time > 0.1  # 1 / b is 2 ms
    assert np.all((error <= depth + size * (FASTEST_MODE / b + compliance))[settled])
    assert size[settled].min() > 10 * step * 0.5  # v^2 / R is about 12 m/s^2: the law is not met by zeros


def euler_power(problem: Problem, step: float) -> float:
    """Energy a second [W] that one semi-implicit Euler step adds with exact accelerations."""
    rig = build_planes(problem, ENGINE.settings(step=step))
    q, qd = problem.q, problem.qd
    acceleration = rate_of_velocity(q, qd, dynamics(problem.bicycle, problem.surface, q, qd).acceleration)

    def energy() -> float:
        mujoco.mj_forward(rig.model, rig.data)
        mujoco.mj_energyPos(rig.model, rig.data)
        mujoco.mj_energyVel(rig.model, rig.data)
        return rig.data.energy.sum()

    before = energy()
    rig.data.qvel[:] += step * acceleration
    mujoco.mj_integratePos(rig.model, rig.data.qpos, rig.data.qvel, step)
    return (energy() - before) / step


def total_energy(trajectory: Trajectory) -> np.ndarray:
    assert trajectory.kinetic_energy is not None
    assert trajectory.potential_energy is not None
    return trajectory.kinetic_energy + trajectory.potential_energy


@pytest.mark.parametrize("step", [0.002, 0.001])
def test_discrete_integrator_doubles_the_creep(circle, step) -> None:
    """Its rows see the velocity at the end of the step: a = -b (v + h a), so that slip = J' q' (1 / b + h).

    With a time constant of two steps b h is 1 / 0.95, and 20 s on the circle cost 27 % of the energy instead of 11 %.
    """
    trajectory = run(circle, integrator="discrete", step=step)
    assert trajectory.ended is None
    assert trajectory.slip is not None
    predicted, b = creep(circle, trajectory)
    settled = trajectory.time > 0.1
    sizes = [np.linalg.norm(slip, axis=2)[settled] for slip in (trajectory.slip, predicted)]
    # The change of the motion within the delay 1 / b + h, and the depth of the contacts, 2.2 %.
    tolerance = FASTEST_MODE * (1 / b + step) + 0.022
    np.testing.assert_allclose(sizes[0], (1 + b * step) * sizes[1], rtol=tolerance)


@pytest.mark.parametrize("integrator", ["implicitfast", "discrete", "RK4"])
def test_energy_is_lost_to_creep_and_gained_by_the_integrator(circle, integrator) -> None:
    """On the plane dE/dt = friction power + what a first-order integrator adds (RK4: nothing)."""
    trajectory = run(circle, integrator=integrator)
    settled = trajectory.time >= 0.1
    time, energy = trajectory.time[settled], total_energy(trajectory)[settled]
    work = np.trapezoid(slip_power(circle, trajectory)[settled], time)
    gain = euler_power(circle, 0.002) * (time[-1] - time[0]) if integrator != "RK4" else 0.0
    # The gain is taken at the start; the wheels lose 1.5 % of their speed in 2 s, power goes with its cube,
    # so its mean is half of 4.5 % off. The next order in the step, spin * step, is 3.6 %.
    assert abs(energy[-1] - energy[0] - work - gain) < (0.0225 + SPIN * 0.002) * abs(gain) + 1e-3 * abs(work)
    assert work < 0


def test_errors_are_of_first_order_with_contacts_of_two_steps(q2) -> None:
    """Slip, energy loss and radius drift halve with the step."""
    steps = (0.002, 0.001, 0.0005)
    radius = np.hypot(q2.q[0], q2.q[1])
    rows = []
    for step in steps:
        trajectory = run(replace(q2, times=every(0.01, 1.0)), step=step)
        assert trajectory.slip is not None
        energy = total_energy(trajectory)
        slip = np.linalg.norm(trajectory.slip[50:], axis=2).mean()
        rows.append([slip, energy[-1] - energy[0], np.hypot(trajectory.q[-1, 0], trajectory.q[-1, 1]) - radius])
    # error = c h (1 + k h + ...) has ratios 2 (1 + k h) with h the finer step; k is at most of the size of
    # the motion's fastest rates, and the second ratio lies half as far from 2 as the first.
    first, second = np.abs(np.array(rows[0]) / rows[1] - 2), np.abs(np.array(rows[1]) / rows[2] - 2)
    assert np.all(first < 2 * (SPIN + FASTEST_MODE) * steps[1])
    assert np.all(second < 2 * (SPIN + FASTEST_MODE) * steps[2])


def test_disturbed_q2_stays_up_for_twenty_seconds(q2_disturbed) -> None:
    trajectory = run(replace(q2_disturbed, times=every(0.01, 20.0)))
    assert trajectory.ended is None
    assert trajectory.steps == 10_000
    assert trajectory.slip is not None
    assert trajectory.gap is not None
    # 0.1 / 2.35 rad of swing in the slow mode, and what 12 % less speed does; the ground is 0.83 rad away.
    assert np.abs(trajectory.q[:, 4] - q2_disturbed.q[4]).max() < 0.2
    predicted, _ = creep(q2_disturbed, trajectory)
    ratio = np.linalg.norm(trajectory.slip[20:], axis=2) / np.linalg.norm(predicted[20:], axis=2)
    # Depth 2.2 % and compliance, now a tenth of (1 - d) / d, and the change of the motion, as above.
    assert np.abs(ratio - 1).max() < 0.022 + 0.022 + FASTEST_MODE / 526


def test_contact_forces_approach_the_multipliers(circle) -> None:
    """Friction and normal forces on the wheels, inertial axes: the reference's, to first order in the step."""
    difference = []
    for step in (0.002, 0.001):
        trajectory = run(replace(circle, times=every(0.01, 0.5)), step=step)
        assert trajectory.contact_force is not None
        q, qd = trajectory.q[-1], trajectory.qd[-1]
        # At MuJoCo's own lean, steer and speeds, put back on the constraints.
        q, qd = consistent_state(
            circle.bicycle, Plane(), (q[0], q[1]), q[4], q[6], (qd[4], qd[6], qd[7]), yaw=q[3], guess=(q[2], q[5])
        )
        exact = dynamics(circle.bicycle, Plane(), q, qd).force
        difference.append(np.abs(trajectory.contact_force[-1] - exact).max() / np.abs(exact).max())
    # The first order's size is that of the motion's fastest rate times the step, the second's likewise.
    assert difference[0] < SPIN * 0.002
    assert abs(difference[0] / difference[1] - 2) < 2 * (SPIN + FASTEST_MODE) * 0.001


# --------------------------------------------------------------------------------------- as an engine


def test_repeats_bitwise_and_does_not_depend_on_output(q2_disturbed, circle) -> None:
    for problem in (q2_disturbed, circle):
        often, again = (run(replace(problem, times=every(0.002, 1.0))) for _ in range(2))
        seldom = run(replace(problem, times=every(0.1, 1.0)))
        for name in ("q", "qd", "contact_force", "body_position", "kinetic_energy", "gap", "slip"):
            np.testing.assert_array_equal(getattr(often, name), getattr(again, name))
        for name in ("qd", "contact_force", "body_position", "kinetic_energy"):
            np.testing.assert_array_equal(getattr(often, name)[::50], getattr(seldom, name))


def test_euler_is_implicitfast_without_damping(circle) -> None:
    # No force depends on velocity, so both solve the same; 1000 steps' round-off of coordinates of size 10.
    np.testing.assert_allclose(run(circle, integrator="Euler").q, run(circle).q, rtol=0, atol=1e-12)


def test_times_between_steps_are_refused(q2) -> None:
    with pytest.raises(ValueError, match=r"step is 0\.003; it must divide the output interval of 0\.01 s, as 0\.0025"):
        run(q2, step=0.003)
    with pytest.raises(ValueError, match=r"as 0\.01 would"):
        run(q2, step=0.02)


@pytest.mark.parametrize(
    "settings",
    [{"step": 0.0}, {"integrator": "rk4"}, {"time_constant": 0.003}, {"impratio": -1.0}, {"noslip": 3}, {"cone": "x"}],
)
def test_settings_are_checked(settings) -> None:
    with pytest.raises(ValidationError):
        ENGINE.settings(**settings)


def test_fall_ends_with_a_reason_whatever_the_output(q2) -> None:
    q, qd = consistent_state(Bicycle(), Plane(), (0.1, 0.2), 0.05, 0.0, (0.0, 0.0, 3.0))
    for beyond, why in ((False, "the bicycle fell"), (True, "a wheel lies flat or has no contact point")):
        problem = Problem(Bicycle(), Plane(), q, qd, every(0.01, 4.0), beyond_fall=beyond)
        often, seldom = run(problem), run(replace(problem, times=every(0.05, 4.0)))
        assert often.ended is not None
        assert often.ended.startswith(why)
        assert often.ended == seldom.ended
        assert 0.5 < often.time[-1] < 4.0
        for trajectory in (often, seldom):
            assert len(trajectory.q) == len(trajectory.time) == len(trajectory.contact_force)  # pyright: ignore
            assert np.all(np.isfinite(trajectory.q))


def test_instability_ends_with_a_reason_and_no_litter(q2, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    trajectory = run(replace(q2, qd=q2.qd * 1e11))
    assert trajectory.ended == "MuJoCo's state became infinite or huge at 0.002 s"
    assert len(trajectory.time) == 1
    assert mujoco.get_mju_user_warning() is None
    assert list(tmp_path.iterdir()) == []


def test_start_without_contact_is_refused(q2) -> None:
    q = q2.q.copy()
    q[4] = np.pi / 2  # the rear wheel lies flat
    with pytest.raises(EngineError, match="no contact point"):
        run(replace(q2, q=q, surface=Plane()))


def test_progress_and_interrupt(q2) -> None:
    seen: list[float] = []
    ENGINE.simulate(replace(q2, times=every(0.5, 2.0)), ENGINE.settings(), seen.append)
    assert np.all(np.diff(seen) >= 0.05 - 1e-12)
    assert len(seen) == 40

    def interrupt(time: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        ENGINE.simulate(q2, ENGINE.settings(), interrupt)
    assert mujoco.get_mju_user_warning() is None


def test_listing_does_not_load_mujoco() -> None:
    code = "from velodrome.engines.mujoco.native import ENGINE; ENGINE.version; "
    code += "import sys; sys.exit('mujoco' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.slow
def test_small_steps_approach_the_reference() -> None:
    """On the plane the error at 5 s is of first order down to 0.05 ms."""
    problem = Problem(Bicycle(), Plane(), *circular_start(Plane()), every(0.1, 5.0))
    # A circular motion of the reference is known in closed form: D goes around the axis.
    turn = problem.qd[3] * problem.times
    x, y = problem.q[:2]
    exact = np.column_stack([x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn)])
    paths = [run(problem, step=step).q[:, :2] for step in (0.0002, 0.0001, 0.00005)]
    errors = [np.linalg.norm(path - exact, axis=1).max() for path in paths]
    ratios = np.array(errors[:-1]) / errors[1:]
    # 2 (1 + k h), the phase's error growing with the time squared: k of spin * 5 s is the most.
    assert np.all(np.abs(ratios - 2) < 2 * SPIN * 5.0 * np.array([0.0001, 0.00005]))
