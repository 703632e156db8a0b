"""A ride in Jiminy's engine, with a wheel constraint at each wheel.

`jiminy.WheelConstraint` is a wheel without thickness that rolls on a plane: three rows that keep the material point at
the contact at rest, with the derivative of their Jacobian complete, so that it rolls for more than an instant. Three
things need care:

- ``Engine.start`` resets the constraint, and takes the wheel's centre at the start for that of an upright wheel. Its
  stabilisation would then lift a leaning wheel out of the ground by r (1 - cos lean). So the reference is set after the
  start, when the first accelerations have been computed already: until then the stabilisation is off.
- The engine's ``constraints.regularization`` is a softness of these constraints too.
- A joint with limits is held there by a further constraint; see `velodrome_jiminy.tree`.
"""

# Jiminy is an optional library, and its compiled bindings carry no types.
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

from dataclasses import dataclass
from time import process_time
from typing import Any

import jiminy_py.core as jiminy
import numpy as np
from jiminy_py.core import pinocchio as pin

from velodrome.engines.coordinates import WHEELS
from velodrome.engines.engine import EngineError, Problem, Progress

from .settings import JiminySettings
from .tree import REAR_RATE, STEER_RATE, build_model, to_jiminy

UP, AXLE = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True)
class Recording:
    """The n samples of a ride.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Jiminy's clock [s].
    configuration, velocity : ndarray, shapes (n, 10), (n, 9)
        States, see `velodrome_jiminy.tree`.
    force : ndarray, shape (n, 2, 3)
        Multipliers of the wheel constraints, which are the forces of the ground on the wheels in inertial axes [N].
    steps : int
    cpu_time : float
        Process CPU time of the steps [s].
    ended : str or None
        Why the ride ended early.
    """

    time: np.ndarray
    configuration: np.ndarray
    velocity: np.ndarray
    force: np.ndarray
    steps: int
    cpu_time: float
    ended: str | None


class Rig:
    """A bicycle in Jiminy's engine, started.

    Parameters
    ----------
    problem : Problem
    settings : JiminySettings

    Raises
    ------
    EngineError
        If Jiminy refuses the start.
    """

    def __init__(self, problem: Problem, settings: JiminySettings) -> None:
        bicycle = problem.bicycle
        self.robot = jiminy.Robot()
        self.robot.initialize(build_model(bicycle))
        self.wheels = []
        for name in WHEELS:
            radius = getattr(bicycle, f"{name}_wheel_radius")
            wheel = jiminy.WheelConstraint(f"{name}_wheel", radius, UP, AXLE)
            self.robot.add_constraint(f"{name}_wheel", wheel)
            self.wheels.append(wheel)
        self._apply_inputs(problem)
        self.engine = jiminy.Engine()
        self.engine.add_robot(self.robot)
        self.engine.set_options(_choose_options(self.engine.get_options(), bicycle.gravity, settings))
        try:
            self.engine.start(*to_jiminy(bicycle, problem.q, problem.qd))
        except (RuntimeError, ValueError) as error:
            raise EngineError(f"Jiminy does not start: {_shorten(error)}") from error
        for wheel in self.wheels:
            wheel.reference_transform = pin.SE3(np.eye(3), wheel.radius * UP)
            wheel.baumgarte_freq = settings.stabilisation

    @property
    def time(self) -> float:
        """Time reached [s]."""
        return self.engine.stepper_state.t

    def read_state(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return configuration (10,), velocity (9,), acceleration (9,) and contact forces (2, 3)."""
        state = self.engine.robot_states[0]
        force = np.array([wheel.lambda_c for wheel in self.wheels])
        return np.array(state.q), np.array(state.v), np.array(state.a), force

    def _apply_inputs(self, problem: Problem) -> None:
        inputs = problem.inputs
        if not (inputs.steer_torque or inputs.steer_damping or inputs.rear_wheel_torque):
            return

        def drive(_time: float, _q: Any, velocity: np.ndarray, _sensors: Any, torque: np.ndarray) -> None:
            torque[STEER_RATE] = inputs.steer_torque - inputs.steer_damping * velocity[STEER_RATE]
            torque[REAR_RATE] = inputs.rear_wheel_torque

        self.robot.controller = jiminy.FunctionalController(None, drive)


def ride_bicycle(problem: Problem, settings: JiminySettings, progress: Progress) -> Recording:
    """Ride a problem.

    Raises
    ------
    EngineError
        If Jiminy refuses the start.
    """
    rig = Rig(problem, settings)
    times, n = problem.times, len(problem.times)
    clock, force = np.empty(n), np.empty((n, 2, 3))
    configuration, velocity = np.empty((n, 10)), np.empty((n, 9))
    ended, cpu_time, samples = None, 0.0, 0
    for k in range(n):
        begin = process_time()
        try:
            if k:
                rig.engine.step(times[k] - rig.time)
        except RuntimeError as error:
            ended = f"Jiminy stopped between {times[k - 1]:.6g} s and {times[k]:.6g} s: {_shorten(error)}"
            break
        cpu_time += process_time() - begin
        clock[k] = rig.time
        configuration[k], velocity[k], _, force[k] = rig.read_state()
        samples = k + 1
        progress(rig.time)
    steps = rig.engine.stepper_state.iter
    rig.engine.stop()
    arrays = (values[:samples] for values in (clock, configuration, velocity, force))
    return Recording(*arrays, steps=steps, cpu_time=cpu_time, ended=ended)


def _choose_options(options: dict[str, Any], gravity: float, settings: JiminySettings) -> dict[str, Any]:
    """Return the engine's options for a ride; nothing is logged, since states are read from the engine."""
    options["world"]["gravity"] = np.array([0.0, 0.0, -gravity, 0.0, 0.0, 0.0])
    options["stepper"] |= {"odeSolver": settings.integrator, "dtMax": settings.step}
    options["constraints"]["regularization"] = settings.regularisation
    options["telemetry"] |= {key: False for key in options["telemetry"] if key.startswith("enable")}
    return options


def _shorten(error: Exception) -> str:
    """Return Jiminy's own words without the places in its source."""
    lines = (line.strip() for line in str(error).splitlines())
    return " ".join(line for line in lines if line and "jiminy::" not in line)
