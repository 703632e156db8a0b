"""Integrate a ride and record its samples."""

# pinocchio is an optional library whose compiled bindings carry no types.
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from time import process_time

import numpy as np
import pinocchio as pin

from ...reference.bicycle import BODIES
from ...reference.rim import Ending, RimWatch
from ...reference.simulate import steps_per_output
from ..engine import EngineError, Problem, Progress
from .dynamics import ConstrainedBicycle, NoContactError
from .settings import ConstraintSettings
from .tree import JOINTS, to_pinocchio

REPORT_INTERVAL = 0.05  # of simulated time between two calls of `progress` [s]
# Contact forces with a larger error than this, relative to the weight, are unusable.
WRONG = 0.01
NO_CONTACT = "a wheel lies flat or has no contact point with the surface"


@dataclass(frozen=True)
class Recording:
    """The n samples of a ride.

    Attributes
    ----------
    time : ndarray, shape (n,)
        [s]
    configuration, velocity : ndarray, shapes (n, 10), (n, 9)
        Pinocchio's state.
    position : ndarray, shape (n, 4, 3)
        Centres of mass [m].
    rotation, spin : ndarray, shapes (n, 4, 3, 3), (n, 4, 3)
        Orientations and angular velocities of the bodies, in inertial axes [rad/s].
    force : ndarray, shape (n, 2, 3)
        Contact forces on the wheels [N].
    energy : ndarray, shape (n, 2)
        Kinetic and potential energy [J].
    """

    time: np.ndarray
    configuration: np.ndarray
    velocity: np.ndarray
    position: np.ndarray
    rotation: np.ndarray
    spin: np.ndarray
    force: np.ndarray
    energy: np.ndarray

    @classmethod
    def empty(cls, n: int) -> Recording:
        """Return arrays for n samples, filled with zeros."""
        shapes = ((n,), (n, 10), (n, 9), (n, 4, 3), (n, 4, 3, 3), (n, 4, 3), (n, 2, 3), (n, 2))
        return cls(*(np.zeros(shape) for shape in shapes))

    def first(self, n: int) -> Recording:
        """Return the first n samples."""
        return Recording(*(getattr(self, name)[:n] for name in self.__dataclass_fields__))


@dataclass(frozen=True)
class RideResult:
    """Result of a ride.

    Attributes
    ----------
    recording : Recording
        The samples that were reached.
    steps : int
    cpu_time : float
        Process CPU time of the steps [s].
    ended : str or None
        Why the ride ended early.
    unconverged_steps : int
        Steps with an evaluation in which the solver did not meet its accuracy.
    largest_residual : float
        Largest residual of the contact forces, relative to the weight.
    """

    recording: Recording
    steps: int
    cpu_time: float
    ended: str | None
    unconverged_steps: int
    largest_residual: float


class SolverWatch:
    """Evaluate accelerations and keep what the solver leaves.

    Attributes
    ----------
    largest : float
        Largest residual of the contact forces in any evaluation, relative to the weight.
    converged : bool
        Whether the solver met its accuracy in every evaluation since the attribute was set to True.
    """

    def __init__(self, bicycle: ConstrainedBicycle, weight: float) -> None:
        self._bicycle, self._weight = bicycle, weight
        self.largest, self.converged = 0.0, True

    def accelerate(self, configuration: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Return the derivative of the velocity; see `ConstrainedBicycle.accelerate`."""
        rates = self._bicycle.accelerate(configuration, velocity)
        self.largest = max(self.largest, self._bicycle.residual / self._weight)
        self.converged = self.converged and self._bicycle.converged
        return rates


Accelerate = Callable[[np.ndarray, np.ndarray], np.ndarray]


def differentiate_configuration(configuration: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Return the derivative (10,) of a configuration (10,) with a unit quaternion, from the velocity (9,)."""
    x, y, z, w = configuration[3:7]
    wx, wy, wz = velocity[3:6]
    rates = np.empty(10)
    rates[:3] = pin.Quaternion(configuration[3:7]).toRotationMatrix() @ velocity[:3]
    rates[3:7] = (
        0.5 * (w * wx + y * wz - z * wy),
        0.5 * (w * wy + z * wx - x * wz),
        0.5 * (w * wz + x * wy - y * wx),
        -0.5 * (x * wx + y * wy + z * wz),
    )
    rates[7:] = velocity[6:]
    return rates


def normalise(configuration: np.ndarray) -> np.ndarray:
    """Return a configuration whose quaternion has unit length."""
    unit = configuration.copy()
    unit[3:7] /= np.linalg.norm(unit[3:7])
    return unit


def step_rk4(
    configuration: np.ndarray, velocity: np.ndarray, rates: np.ndarray, step: float, accelerate: Accelerate
) -> tuple[np.ndarray, np.ndarray]:
    """Return the state after a step of Runge-Kutta's method; ``rates`` are those of the velocity at its start.

    The quaternion is a vector of four numbers whose length the equations keep; it is normalised where it is used.
    """
    moved, changed = [differentiate_configuration(configuration, velocity)], [rates]
    for share in (0.5, 0.5, 1.0):
        here = normalise(configuration + share * step * moved[-1])
        speed = velocity + share * step * changed[-1]
        moved.append(differentiate_configuration(here, speed))
        changed.append(accelerate(here, speed))

    def combine(slopes: list[np.ndarray]) -> np.ndarray:
        return step / 6 * (slopes[0] + 2 * slopes[1] + 2 * slopes[2] + slopes[3])

    return normalise(configuration + combine(moved)), velocity + combine(changed)


def step_euler(
    model: pin.Model, configuration: np.ndarray, velocity: np.ndarray, rates: np.ndarray, step: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the state after a step as Pinocchio's examples take it: the velocity first, then the configuration."""
    faster = velocity + step * rates
    return pin.integrate(model, configuration, step * faster), faster


def record_sample(bicycle: ConstrainedBicycle, recording: Recording, k: int) -> None:
    """Record the poses, forces and energies of sample k, whose state has been recorded and evaluated last."""
    model, data = bicycle.model, bicycle.data
    configuration, velocity = recording.configuration[k], recording.velocity[k]
    recording.energy[k, 0] = pin.computeKineticEnergy(model, data, configuration, velocity)
    recording.energy[k, 1] = pin.computePotentialEnergy(model, data, configuration)
    for body, joint in enumerate(JOINTS):
        place = data.oMi[joint]
        recording.position[k, body] = place.act(model.inertias[joint].lever)
        recording.rotation[k, body] = place.rotation
        recording.spin[k, body] = pin.getVelocity(model, data, joint, pin.LOCAL_WORLD_ALIGNED).angular
    recording.force[k] = bicycle.force


class Ride:
    """A ride in progress.

    Parameters
    ----------
    problem : Problem
    settings : ConstraintSettings

    Raises
    ------
    EngineError
        If a rim lies inside the ground at the start or has no contact.
    """

    def __init__(self, problem: Problem, settings: ConstraintSettings) -> None:
        self.bicycle = ConstrainedBicycle(problem, settings)
        mass = sum(problem.bicycle.body_mass(name) for name in BODIES)
        self.watch = SolverWatch(self.bicycle, mass * problem.bicycle.gravity)
        self.settings = settings
        self.steps, self.unconverged = 0, 0
        try:
            self._rims = RimWatch(problem.bicycle, problem.surface, problem.q)
        except ValueError as error:
            raise EngineError(str(error)) from error
        self.configuration, self.velocity = to_pinocchio(problem.bicycle, problem.q, problem.qd)
        self._evaluate()
        self.look()

    @property
    def time(self) -> float:
        """Time reached [s]."""
        return self.steps * self.settings.step

    def advance(self) -> str | None:
        """Take a step and evaluate the state that it reaches; return why the ride ends there, None if it goes on."""
        step = self.settings.step
        try:
            if self.settings.integrator == "rk4":
                state = step_rk4(self.configuration, self.velocity, self._rates, step, self.watch.accelerate)
            else:
                state = step_euler(self.bicycle.model, self.configuration, self.velocity, self._rates, step)
            self.steps += 1
            self.unconverged += not self.watch.converged
            self.watch.converged = True
            if not (np.all(np.isfinite(state[0])) and np.all(np.isfinite(state[1]))):
                return f"the state became infinite at {self.time:.6g} s"
            self.configuration, self.velocity = state
            self._evaluate()
        except NoContactError:
            return f"{NO_CONTACT} at {self.time:.6g} s"
        return self.find_unconverged()

    def find_unconverged(self) -> str | None:
        """Return when and how far the solver failed to converge; None if its forces are usable."""
        if self.watch.largest < WRONG:
            return None
        return (
            f"Pinocchio's constraint solver stopped unconverged at {self.time:.6g} s: the contact forces changed by "
            f"{100 * self.watch.largest:.3g} % of the weight in its last iteration"
        )

    def look(self) -> Ending | None:
        """Look at both rims; return when and why the ride ends, None if it goes on."""
        if not self._rims.needed:
            return None
        self._rims.centre[:], self._rims.axle[:] = self.bicycle.contacts.centre, self.bicycle.contacts.axle
        return self._rims.look(self.time)

    def record(self, recording: Recording, k: int) -> None:
        """Record sample k."""
        recording.time[k] = self.time
        recording.configuration[k], recording.velocity[k] = self.configuration, self.velocity
        record_sample(self.bicycle, recording, k)

    def _evaluate(self) -> None:
        self._rates = self.watch.accelerate(self.configuration, self.velocity)


def ride_bicycle(problem: Problem, settings: ConstraintSettings, progress: Progress) -> RideResult:
    """Integrate a problem.

    Raises
    ------
    ValueError
        If the output times are not a uniform grid from 0, or the step does not divide its interval.
    EngineError
        If not even the start can be evaluated.
    """
    stride = steps_per_output(problem.times, settings.step)
    recording = Recording.empty(len(problem.times))
    try:
        ride = Ride(problem, settings)
    except NoContactError as error:
        raise EngineError("a wheel has no contact point with the surface at the start") from error
    ended = ride.find_unconverged()
    if ended is not None:
        raise EngineError(ended)
    ride.record(recording, 0)
    samples, cpu_time, ended = _continue_ride(ride, stride, recording, progress)
    return RideResult(
        recording=recording.first(samples),
        steps=ride.steps,
        cpu_time=cpu_time,
        ended=ended,
        unconverged_steps=ride.unconverged,
        largest_residual=ride.watch.largest,
    )


def _continue_ride(ride: Ride, stride: int, recording: Recording, progress: Progress) -> tuple[int, float, str | None]:
    """Continue from the first sample; return the number of samples, CPU time [s] and why the ride ended early."""
    cpu_time, reported = 0.0, 0.0
    for k in range(1, len(recording.time)):
        begin = process_time()
        for _ in range(stride):
            ended = ride.advance()
            touch = None if ended is not None else ride.look()
            if ended is not None or touch is not None:
                break
        cpu_time += process_time() - begin
        if touch is not None:
            # The second touch may lie before the last sample.
            return max(1, bisect_right(recording.time[:k], touch.time)), cpu_time, touch.why
        if ended is not None:
            return k, cpu_time, ended
        ride.record(recording, k)
        if ride.time - reported >= REPORT_INTERVAL:
            reported = ride.time
            progress(reported)
    return len(recording.time), cpu_time, None
