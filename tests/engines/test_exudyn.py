"""The Exudyn engine against the reference and against the library's own rolling disc."""

from __future__ import annotations

import dataclasses
import os
import signal
import subprocess
import sys
import threading
from functools import cache

import numpy as np
import pytest
from pydantic import ValidationError

from velodrome.engines.engine import EngineError, Problem, Trajectory
from velodrome.engines.registry import load_engine
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.bowls import Sphere
from velodrome.reference.dae import consistent_state
from velodrome.reference.rim import rim_search
from velodrome.reference.simulate import PreciseMotion, simulate
from velodrome.reference.surface import Paraboloid, Plane, Surface, SurfaceFunction, surface_function

ENGINE = load_engine("exudyn")
RATE = 18.0  # rear wheel [rad/s]: the fastest rate of the motions below
SHORT, LONG = 2.0, 10.0


def problem(
    surface: Surface, lean: float, steer: float, duration: float, bicycle: Bicycle | None = None, yaw: float = 0.0
) -> Problem:
    """A disturbed ride with the given lean and steer, 100 samples a second."""
    bicycle = bicycle or Bicycle()
    q, qd = consistent_state(bicycle, surface, (0.986, 2.148), lean, steer, (0.1, 0.0, RATE), yaw)
    return Problem(bicycle, surface, q, qd, np.arange(round(100 * duration) + 1) / 100)


def bowl(duration: float) -> Problem:
    """Near the stable circular motion Q2 of the bowl (Xiong et al. 2020, section 4.2), lean rate disturbed."""
    return problem(Paraboloid(0.005), 0.7374431, 2.8370309, duration)


def run(task: Problem, step: float) -> Trajectory:
    return ENGINE.simulate(task, ENGINE.settings.model_validate({"step": step}), lambda _time: None)


@cache
def bowl_run(duration: float, step: float) -> Trajectory:
    return run(bowl(duration), step)


@cache
def bowl_reference(duration: float) -> PreciseMotion:
    task = bowl(duration)
    return simulate(task.bicycle, task.surface, task.q, task.qd, task.times)


def furthest(q: np.ndarray, exact: np.ndarray) -> float:
    """Largest distance of D from where it should be [m]."""
    return float(np.linalg.norm(q[:, :3] - exact[:, :3], axis=1).max())


# Generalized alpha has the error C h^2 (1 + k h + ...), where k is of the size of the motion's fastest rate.
# So halving a step h divides the error by 4 (1 +- k h), and extrapolation to h = 0 leaves k h of it.
def next_order(step: float) -> float:
    return RATE * step


def relative_force_error(result: Trajectory, exact: np.ndarray) -> np.ndarray:
    """Of each wheel in each sample (n, 2)."""
    assert result.contact_force is not None
    return np.linalg.norm(result.contact_force - exact, axis=2) / np.linalg.norm(exact, axis=2)


DURATIONS = [SHORT, pytest.param(LONG, marks=pytest.mark.slow)]


@pytest.mark.parametrize("duration", DURATIONS)
def test_position_error_falls_with_the_square_of_the_step(duration) -> None:
    exact = bowl_reference(duration).q
    coarse, fine = (furthest(bowl_run(duration, step).q, exact) for step in (2e-3, 1e-3))
    assert coarse / fine == pytest.approx(4, rel=next_order(2e-3))


@pytest.mark.parametrize("duration", DURATIONS)
def test_limit_of_small_steps_is_the_reference(duration) -> None:
    exact = bowl_reference(duration).q
    coarse, fine = bowl_run(duration, 2e-3).q, bowl_run(duration, 1e-3).q
    assert furthest((4 * fine - coarse) / 3, exact) < next_order(2e-3) * furthest(fine, exact) < 1e-5


@pytest.mark.parametrize("duration", DURATIONS)
def test_contact_forces_are_the_multipliers_of_the_reference(duration) -> None:
    exact = bowl_reference(duration).force
    coarse, fine = (relative_force_error(bowl_run(duration, step), exact) for step in (2e-3, 1e-3))
    # Multipliers are of second order like everything else, from the first step on.
    assert coarse.max() / fine.max() == pytest.approx(4, rel=next_order(2e-3))
    assert fine.max() < next_order(1e-3) ** 2 < 1e-3
    # At the start there is no step yet, but the engine's forward differences of 1e-7 on both sides of the rows.
    assert fine[0].max() < 1e-6


@pytest.mark.parametrize("duration", DURATIONS)
def test_constraints_hold(duration) -> None:
    result = bowl_run(duration, 1e-3)
    assert result.gap is not None
    assert result.slip is not None
    # The gap is a difference of coordinates of some three metres: a few tens of their round-off.
    assert np.abs(result.gap).max() < 30 * 3 * np.finfo(float).eps
    # Newton's method leaves 1e-11 of a residual that starts as the weight in kN; of slip, half of what is in a step.
    assert np.abs(result.slip).max() < 1e-11 * 0.094 * 9.81 / (1e-3 / 2)


@pytest.mark.parametrize("duration", DURATIONS)
def test_energy_error_falls_with_the_square_of_the_step(duration) -> None:
    def drift(step: float) -> float:
        result = bowl_run(duration, step)
        assert result.kinetic_energy is not None
        assert result.potential_energy is not None
        energy = result.kinetic_energy + result.potential_energy
        return float(np.abs(energy / energy[0] - 1).max())

    assert drift(2e-3) / drift(1e-3) == pytest.approx(4, rel=next_order(2e-3))


def test_contact_points_are_those_of_the_reference() -> None:
    from velodrome.reference.contact import observe

    task, result = bowl(SHORT), bowl_run(SHORT, 1e-3)
    seen = observe(task.bicycle, task.surface, result.q, result.qd)
    assert result.contact_point is not None
    assert result.kinetic_energy is not None
    # The joints hold the positions, so the wheels are where the coordinates say, up to round-off on some
    # three metres. Velocities satisfy the joints up to the method's error, (k h)^2.
    assert np.abs(result.contact_point - seen.point).max() < 100 * 3 * np.finfo(float).eps
    assert np.abs(result.kinetic_energy / seen.kinetic_energy - 1).max() < next_order(1e-3) ** 2


def test_initial_state_comes_back() -> None:
    task = problem(Paraboloid(0.005), 0.3, -0.4, 0.01, yaw=8.0)
    task.q[7:] = 100.0, -50.0  # some turns of the wheels
    result = run(task, 1e-3)
    np.testing.assert_allclose(result.time, task.times, rtol=2 * np.finfo(float).eps, atol=0)
    np.testing.assert_allclose(result.q[0], task.q, rtol=0, atol=100 * np.finfo(float).eps)
    np.testing.assert_allclose(result.qd[0], task.qd, rtol=0, atol=10 * RATE * np.finfo(float).eps)


def test_runs_are_bitwise_identical() -> None:
    first, second = bowl_run(SHORT, 2e-3), run(bowl(SHORT), 2e-3)
    for field in dataclasses.fields(Trajectory):
        if field.name != "cpu_time":
            np.testing.assert_array_equal(getattr(first, field.name), getattr(second, field.name))


@surface_function
def _waves(x, y, parameters):
    height, k = parameters[0], parameters[1]
    sx, cx, sy, cy = np.sin(k * x), np.cos(k * x), np.sin(k * y), np.cos(k * y)
    f, bend = height * sx * cy, -height * k * k
    return f, height * k * cx * cy, -height * k * sx * sy, bend * sx * cy, bend * cx * sy, bend * sx * cy


class Waves:
    """z = 0.02 sin x cos y: curvature changes its sign, and no axis of symmetry helps."""

    function: SurfaceFunction = _waves
    parameters = np.array([0.02, 1.0])


def test_any_bicycle_on_any_surface() -> None:
    bicycle = Bicycle(trail=0.06, steer_axis_tilt=0.4, rear_wheel_radius=0.33, front_wheel_mass=2.0, gravity=9.0)
    task = problem(Waves(), 0.2, -0.1, SHORT, bicycle, yaw=2.0)
    exact = simulate(bicycle, task.surface, task.q, task.qd, task.times)
    coarse, fine = run(task, 2e-3), run(task, 1e-3)
    error = furthest(fine.q, exact.q)
    assert furthest(coarse.q, exact.q) / error == pytest.approx(4, rel=next_order(2e-3))
    assert furthest((4 * fine.q - coarse.q) / 3, exact.q) < next_order(2e-3) * error


def test_kernel_rows_are_derivatives() -> None:
    """Normal row = gradient of the gap; all rows = velocity of the rim's material point in the contact frame."""
    from velodrome.engines.exudyn import kernel

    function, parameters = _waves.real, Waves.parameters
    looking = rim_search(Waves(), [0.3])
    rng = np.random.default_rng(1)
    rows, scratch, step = np.empty((3, 7)), np.empty((3, 7)), 1e-6
    for _ in range(20):
        centre, triad = 0.05 * rng.standard_normal(3), np.linalg.qr(rng.standard_normal((3, 3)))[0]
        triad[2] *= np.linalg.det(triad)

        def gap(coordinates: np.ndarray, centre=centre, triad=triad) -> float:
            return kernel.velocity_rows(coordinates, centre, triad, 0.3, looking, function, parameters, scratch)

        theta = triad_upright(triad) + 0.2 * rng.standard_normal(4)
        coordinates = np.concatenate([rng.standard_normal(2), [0.3], theta / np.linalg.norm(theta)])
        kernel.velocity_rows(coordinates, centre, triad, 0.3, looking, function, parameters, rows)
        gradient = [(gap(coordinates + e) - gap(coordinates - e)) / (2 * step) for e in step * np.eye(7)]
        # Central differences: h^2 of curvature, and round-off over h.
        np.testing.assert_allclose(rows[2], gradient, rtol=0, atol=1e-8)
        stretched = np.concatenate([coordinates[:3], 1.3 * coordinates[3:]])
        assert gap(stretched) == pytest.approx(gap(coordinates), abs=1e-14)

        rates = rng.standard_normal(7)
        rates[3:] -= coordinates[3:] * (coordinates[3:] @ rates[3:])  # along the unit sphere
        axes = [np.array(kernel.axes(*(coordinates + s * rates)[3:])).T for s in (-step, 0.0, step)]
        _, arm, _ = kernel.wheel_contact(coordinates, centre, triad, 0.3, looking, function, parameters)
        material = rates[:3] + (axes[2] - axes[0]) / (2 * step) @ axes[1].T @ np.array(arm)
        np.testing.assert_allclose(rows @ rates, rows[:, :3] @ material, rtol=0, atol=1e-8)


def triad_upright(triad: np.ndarray) -> np.ndarray:
    """Euler parameters (4,) that turn the rows of a triad to the inertial axes."""
    from scipy.spatial.transform import Rotation

    return np.roll(Rotation.from_matrix(triad).as_quat(), 1)


@pytest.mark.parametrize(
    ("times", "complaint"),
    [
        (np.arange(11) / 1000 * 2.5, "0.00125 s would"),
        (np.array([0.0, 0.1, 0.3]), "evenly spaced"),
    ],
)
def test_times_off_the_steps_are_refused(times, complaint) -> None:
    task = dataclasses.replace(bowl(0.1), times=times)
    with pytest.raises(ValueError, match=complaint):
        run(task, 2e-3)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("step", 0.0),
        ("spectral_radius", 1.0),
        ("newton_relative_tolerance", 1.0),
        ("solver", "rk4"),
        ("jacobian", "never"),
        ("start", "cold"),
        ("steps", 1.0),
    ],
)
def test_wrong_settings_are_refused(name, value) -> None:
    with pytest.raises(ValidationError, match=name):
        ENGINE.settings.model_validate({name: value})


def test_a_fall_ends_the_run_and_prints_nothing(capfd) -> None:
    bicycle = Bicycle()
    q, qd = consistent_state(bicycle, Plane(), (0.0, 0.0), 0.3, 0.0, (1.0, 0.0, 2.0))
    task = Problem(bicycle, Plane(), q, qd, np.arange(1001) / 100)
    standing = run(task, 1e-3)
    assert standing.ended is not None
    assert standing.ended.startswith("the bicycle fell at t")
    result = run(dataclasses.replace(task, beyond_fall=True), 1e-3)
    assert result.ended is not None
    assert "did not converge at t" in result.ended
    assert len(standing.time) < len(result.time)
    assert 0 < len(result.time) < len(task.times)
    assert result.contact_force is not None
    assert len(result.q) == len(result.contact_force) == len(result.time)
    np.testing.assert_allclose(result.time, task.times[: len(result.time)], rtol=2 * np.finfo(float).eps, atol=0)
    assert np.all(np.isfinite(result.q))
    assert capfd.readouterr() == ("", "")


def test_a_start_without_contact_is_an_error() -> None:
    task = dataclasses.replace(bowl(0.1), surface=Sphere(20.0))
    task.q[0] = 1e3  # beyond the sphere, where there is no ground
    with pytest.raises(EngineError, match="could not start"):
        run(task, 1e-3)


def test_progress_is_told_and_may_stop_the_run() -> None:
    told: list[float] = []
    ENGINE.simulate(bowl(0.5), ENGINE.settings(), told.append)
    assert told == sorted(told)
    assert len(told) > 2

    class StopError(Exception):
        pass

    def stop(_time: float) -> None:
        raise StopError

    with pytest.raises(StopError):
        ENGINE.simulate(bowl(0.5), ENGINE.settings(), stop)


def test_interrupt_gets_out() -> None:
    # A background job inherits SIGINT ignored: this is about what happens where it is not.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    timer = threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT))
    bowl_run(SHORT, 2e-3)  # compiled: the signal must meet the integration
    task = bowl(100.0)
    timer.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            run(task, 1e-3)
    finally:
        signal.signal(signal.SIGINT, before)


def test_library_is_imported_only_to_run() -> None:
    load = "import sys; from velodrome.engines.registry import load_engine; load_engine('exudyn').version"
    check = f"{load}; assert 'exudyn' not in sys.modules"
    subprocess.run([sys.executable, "-c", check], check=True)
