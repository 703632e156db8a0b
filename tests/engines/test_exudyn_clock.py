"""Exudyn's samples by its own clock, and what its Newton iterations leave of them."""

from __future__ import annotations

from functools import cache
from typing import Any

import exudyn as exu
import numpy as np
import pytest
from exudyn.itemInterface import MassPoint, NodePoint, SensorBody

from velodrome.engines.admission import ride_engine
from velodrome.engines.engine import Problem, Trajectory
from velodrome.engines.exudyn import kernel
from velodrome.engines.exudyn.engine import BUILTIN, ENGINE, PLANE_NORMAL, ExudynEngine
from velodrome.engines.exudyn.method import generalized_alpha
from velodrome.engines.exudyn.results import weights
from velodrome.engines.exudyn.settings import SolverSettings
from velodrome.engines.exudyn.solve import Integration, integrate, no_progress
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.contact import observe
from velodrome.reference.dae import consistent_state
from velodrome.reference.rim import rim_search
from velodrome.reference.simulate import simulate
from velodrome.reference.surface import Paraboloid, Plane, Surface, SurfaceFunction, surface_function

ENGINES = [ENGINE, PLANE_NORMAL, BUILTIN]
ROUND_OFF = 2.0**-52
STEPS, STEP = 100_000, 1e-3  # the library's own sensors leave out sample 97187


def falling_point(write_period: float | None = None) -> np.ndarray:
    """Samples (n, 4) of a point that moves by 1 m/s: time and position, with as many samples as steps.

    Recorded by the engine of this suite, or by the library's own period.
    """
    container: Any = exu.SystemContainer()
    system = container.AddSystem()
    node = system.AddNode(NodePoint(initialVelocities=[1.0, 0.0, 0.0]))
    body = system.AddObject(MassPoint(mass=1.0, nodeNumber=node))
    kind: Any = exu.OutputVariableType.Position
    sensor = system.AddSensor(SensorBody(bodyNumber=body, outputVariableType=kind, storeInternal=True))
    system.Assemble()
    with no_progress():
        if write_period is None:
            outcome = integrate(system, Integration(STEPS * STEP, STEPS, STEPS, SolverSettings()), lambda _time: None)
            assert (outcome.steps, outcome.ended, outcome.unconverged_steps) == (STEPS, None, 0)
        else:
            settings: Any = exu.SimulationSettings()
            settings.solution.file.write = False
            settings.solution.sensors.writePeriod = write_period
            settings.timeIntegration.numberOfSteps, settings.timeIntegration.endTime = STEPS, STEPS * STEP
            settings.timeIntegration.adaptiveStep, settings.timeIntegration.verboseMode = False, 0
            solver: Any = exu.MainSolverImplicitSecondOrder()
            solver.SolveSystem(system, settings)
    return np.array(system.GetSensorStoredData(sensor))


def test_every_sample_of_a_long_ride_is_where_its_time_says() -> None:
    found, asked = falling_point(), STEP * np.arange(STEPS + 1)
    assert len(found) == STEPS + 1
    # A product of the step and a number, each rounded once.
    np.testing.assert_allclose(found[:, 0], asked, rtol=2 * ROUND_OFF, atol=0)
    # The position is a sum of as many terms.
    np.testing.assert_allclose(found[:, 1], asked, rtol=STEPS * ROUND_OFF, atol=0)


def test_the_library_s_own_sensors_leave_out_a_sample() -> None:
    """As long as this passes, `velodrome.engines.exudyn.solve` has to tell the samples."""
    assert len(falling_point(STEP)) == STEPS, f"Exudyn {exu.__version__} has mended this"


def upright(speed: float, duration: float, rate: float, surface: Surface | None = None) -> Problem:
    bicycle, surface = Bicycle(), surface or Plane()
    spin = speed / bicycle.rear_wheel_radius
    q, qd = consistent_state(bicycle, surface, (0.0, 0.0), 0.0, 0.0, (0.0, 0.0, spin))
    return Problem(bicycle, surface, q, qd, np.arange(round(rate * duration) + 1) / rate)


@pytest.mark.slow
def test_a_hundred_seconds_at_every_step() -> None:
    speed = 5.0
    task = upright(speed, 100.0, 1000.0)
    found = ride_engine(ENGINE, task, ENGINE.settings(), lambda _time: None)
    assert found.ended is None
    np.testing.assert_array_equal(found.time, task.times)
    # A sample left out would be a step of twice the way; the step's own error is (k h)^2 / 12 of it at the most.
    ways = np.abs(np.diff(found.q[:, 0]))
    np.testing.assert_allclose(ways, speed * STEP, rtol=(speed / 0.3 * STEP) ** 2 / 12, atol=0)


def q2_like(surface: Surface) -> Problem:
    """A disturbed ride at strong lean."""
    q, qd = consistent_state(Bicycle(), surface, (0.986, 2.148), 0.7, 2.83, (0.1, 0.0, 18.0))
    return Problem(Bicycle(), surface, q, qd, np.arange(51) / 100)


@surface_function
def _ripples(x, y, parameters):
    height, k = parameters[0], parameters[1]
    s, c = np.sin(k * x), np.cos(k * x)
    return height * s, height * k * c, 0 * x, -height * k * k * s, 0 * x, 0 * x


class Ripples:
    """z = 0.02 sin 2 x."""

    function: SurfaceFunction = _ripples
    parameters = np.array([0.02, 2.0])


TASKS = {
    "straight": lambda: upright(5.0, 0.5, 100.0),
    "slowly": lambda: upright(1.5, 0.5, 100.0),
    "circle": lambda: q2_like(Plane()),
    "bowl": lambda: q2_like(Paraboloid(0.005)),
    "ripples": lambda: upright(4.0, 0.5, 100.0, Ripples()),
}


ON_THE_PLANE = ("straight", "slowly", "circle")
RIDES = [(engine, name) for engine in ENGINES for name in TASKS if engine is not BUILTIN or name in ON_THE_PLANE]


@cache
def task(name: str) -> Problem:
    return TASKS[name]()


@cache
def run(engine: ExudynEngine, name: str, **settings: float) -> Trajectory:
    result = engine.simulate(task(name), engine.settings.model_validate(settings), lambda _time: None)
    assert result.ended is None
    return result


def figures(engine: ExudynEngine, name: str, **settings: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions of D, contact forces, and slip as it follows from the coordinates."""
    result, problem = run(engine, name, **settings), task(name)
    assert result.contact_force is not None
    slip = observe(problem.bicycle, problem.surface, result.q, result.qd).slip
    return result.q[:, :3], result.contact_force, slip


@pytest.mark.parametrize(("engine", "name"), RIDES)
def test_what_is_shown_is_the_step_s_error_and_not_the_tolerance_s(engine, name) -> None:
    """The default leaves of Newton's method less than a hundredth of the step's own error, or next to nothing."""
    problem = task(name)
    exact = simulate(problem.bicycle, problem.surface, problem.q, problem.qd, problem.times)
    usual, converged = figures(engine, name), figures(engine, name, newton_relative_tolerance=1e-13)
    # The straight ride has next to no error of its own; there, what the tolerance stands for: lengths of 1e-11 of the
    # weights in kN, as slip in a step, as the way that such a slip goes, and as the force that a length's share of a
    # step's square makes of the mass.
    bicycle, method = problem.bicycle, generalized_alpha(engine.settings().spectral_radius)
    left = 1e-11 * float(np.linalg.norm(weights(bicycle)))
    slip = left / (method.beta / method.gamma * STEP)
    floors = (slip * problem.times[-1], 94 * left / (method.beta * STEP**2), slip)
    for found, tight, true, floor in zip(usual, converged, (exact.q[:, :3], exact.force, 0.0), floors, strict=True):
        own_error = float(np.abs(tight - true).max())
        assert float(np.abs(found - tight).max()) < max(own_error / 100, floor)


@pytest.mark.parametrize("engine", ENGINES)
def test_residual_is_told_and_within_the_tolerance(engine) -> None:
    """Newton's method starts from the weights, with next to nothing of inertia on an undisturbed ride."""
    for settings in ({}, {"newton_relative_tolerance": 1e-7}):
        result = run(engine, "straight", **settings)
        tolerance = result.settings["newton_relative_tolerance"]
        assert result.unconverged_steps == 0
        assert result.largest_residual is not None
        assert 0 < result.largest_residual < 1.01 * tolerance
    # A looser iteration leaves more.
    assert result.largest_residual > 100 * (run(engine, "straight").largest_residual or 1.0)


def test_a_wheel_without_contact_has_no_normal() -> None:
    """The plane of the library's disc must not turn to a guess."""
    out, where = np.zeros((2, 3)), np.zeros((2, 7))
    where[:, 3] = 1.0
    where[:, 2] = 0.3, np.nan
    shape = (np.zeros((2, 3)), np.stack([np.eye(3)] * 2), np.array([0.3, 0.3]))
    ground = Plane()
    looking = rim_search(ground, (0.3, 0.3))
    next(kernel.normals(where, *shape, looking, ground.function.real, ground.parameters, out))
    np.testing.assert_allclose(out[0], [0.0, 0.0, 1.0], atol=4 * ROUND_OFF)
    assert np.isnan(out[1]).all()
