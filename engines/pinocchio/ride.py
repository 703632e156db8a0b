"""Integrate a ride and record its samples."""

# pinocchio is an optional library whose compiled bindings carry no types.
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass
from time import process_time

import numpy as np
import pinocchio as pin

from ...reference.bicycle import BODIES
from ...reference.fall import Ending, Fall, FallWatch, find_first_ending
from ...reference.rim import RimWatch
from ...reference.simulate import steps_per_output
from ..coordinates import start_on_turn
from ..engine import EngineError, Problem, Progress
from .dynamics import ConstrainedBicycle, NoAccelerationError
from .integrators import step_euler, step_rk4
from .settings import ConstraintSettings
from .tree import JOINTS, from_pinocchio, to_pinocchio

REPORT_INTERVAL = 0.05  # of simulated time between two calls of `progress` [s]
# Contact forces with a larger error than this, relative to the largest of them, are unusable.
WRONG = 0.01
# Coordinates and rates beyond this are known to micrometres at best, even if they were exact but for round-off.
HUGE = 1e10


@dataclass(frozen=True)
class PinocchioRecording:
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
    def empty(cls, n: int) -> PinocchioRecording:
        """Return arrays for n samples, filled with zeros."""
        shapes = ((n,), (n, 10), (n, 9), (n, 4, 3), (n, 4, 3, 3), (n, 4, 3), (n, 2, 3), (n, 2))
        return cls(*(np.zeros(shape) for shape in shapes))

    @classmethod
    def join(cls, parts: Iterable[PinocchioRecording]) -> PinocchioRecording:
        """Return the samples of several recordings in one."""
        parts = list(parts)
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in cls.__dataclass_fields__))

    def first(self, n: int) -> PinocchioRecording:
        """Return the first n samples."""
        return PinocchioRecording(*(getattr(self, name)[:n] for name in self.__dataclass_fields__))


@dataclass(frozen=True)
class PinocchioOutcome:
    """Result of a ride.

    Attributes
    ----------
    recording : PinocchioRecording
        The samples that were reached.
    steps : int
    cpu_time : float
        Process CPU time of the steps [s].
    ended : str or None
        Why the ride ended early.
    fall : Fall or None
        The states around the fall that ended it.
    unconverged_steps : int
        Steps with an evaluation in which the solver did not meet its accuracy.
    largest_residual : float
        Largest residual of the contact forces, relative to the largest of them or to the weight.
    """

    recording: PinocchioRecording
    steps: int
    cpu_time: float
    ended: str | None
    fall: Fall | None
    unconverged_steps: int
    largest_residual: float


def convert_recording(problem: Problem, seen: PinocchioRecording, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Compute generalised coordinates and rates (n, 9), with angles on the same turn as the problem's start."""
    motion = (seen.configuration, seen.velocity, seen.position[:, 0], seen.rotation, seen.spin)
    q, qd = from_pinocchio(problem.bicycle, times, *motion)
    return start_on_turn(q, problem.q), qd


class ProximalWatch:
    """Evaluate accelerations and keep what the solver leaves.

    Attributes
    ----------
    largest : float
        Largest residual of the contact forces in any evaluation, relative to the largest of them or to the weight.
    converged : bool
        Whether the solver met its accuracy in every evaluation since the attribute was set to True.
    """

    def __init__(self, bicycle: ConstrainedBicycle, weight: float) -> None:
        self._bicycle, self._weight = bicycle, weight
        self.largest, self.converged = 0.0, True

    def accelerate(self, configuration: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Return the derivative of the velocity; see `ConstrainedBicycle.accelerate`."""
        rates = self._bicycle.accelerate(configuration, velocity)
        largest_force = max(self._weight, float(np.abs(self._bicycle.force).max()))
        self.largest = max(self.largest, self._bicycle.residual / largest_force)
        self.converged = self.converged and self._bicycle.converged
        return rates


class PinocchioRide:
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
        self.watch = ProximalWatch(self.bicycle, mass * problem.bicycle.gravity)
        self.settings = settings
        self.steps, self.unconverged = 0, 0
        try:
            self._rims = RimWatch(problem.bicycle, problem.surface, problem.q)
        except ValueError as error:
            raise EngineError(str(error)) from error
        self.configuration, self.velocity = to_pinocchio(problem.bicycle, problem.q, problem.qd)
        self._problem = problem
        self._fall = None if problem.beyond_fall else FallWatch(problem.bicycle, problem.surface, self._convert_states)
        self._evaluate()
        self.look()

    @property
    def time(self) -> float:
        """Time reached [s]."""
        return self.steps * self.settings.step

    def advance(self) -> str | None:
        """Take a step and evaluate the state that it reaches; return why the ride ends there, None if it goes on."""
        try:
            # A ride that ends here may overflow before it does.
            with np.errstate(over="ignore", invalid="ignore"):
                self.configuration, self.velocity = self._step()
            self.steps += 1
            self.unconverged += not self.watch.converged
            self.watch.converged = True
            if not max(np.abs(self.configuration).max(), np.abs(self.velocity).max()) < HUGE:
                return f"Pinocchio's state became infinite or huge at {self.time:.6g} s"
            self._evaluate()
        except NoAccelerationError as error:
            return f"{error} at {self.time:.6g} s"
        return self.find_unconverged()

    def advance_by(self, steps: int) -> tuple[str | None, Ending | None]:
        """Take some steps; return why the ride ends before they are done, and the touch or fall that ends it."""
        for _ in range(steps):
            ended = self.advance()
            if ended is not None:
                return ended, None
            touch = self.look()
            if touch is not None:
                return None, touch
        return None, None

    def find_unconverged(self) -> str | None:
        """Return when and how far the solver failed to converge; None if its forces are usable."""
        if self.watch.largest < WRONG:
            return None
        return (
            f"Pinocchio's constraint solver stopped unconverged at {self.time:.6g} s: the contact forces changed by "
            f"{100 * self.watch.largest:.3g} % in its last iteration"
        )

    def look(self) -> Ending | None:
        """Look at both rims and at the height; return when and why the ride ends, None if it goes on."""
        return find_first_ending(self._look_at_rims(), self._look_at_fall())

    def _look_at_rims(self) -> Ending | None:
        if not self._rims.needed:
            return None
        self._rims.centre[:], self._rims.axle[:] = self.bicycle.contacts.centre, self.bicycle.contacts.axle
        return self._rims.look(self.time)

    def _look_at_fall(self) -> Ending | None:
        if self._fall is None or not self._fall.is_due(self.time):
            return None
        here = PinocchioRecording.empty(1)
        self.record(here, 0)
        return self._fall.look(self.time, self._fall.measure_height(here.position[0, 0]), here)

    def _convert_states(
        self, times: np.ndarray, states: tuple[PinocchioRecording, PinocchioRecording]
    ) -> tuple[np.ndarray, np.ndarray]:
        return convert_recording(self._problem, PinocchioRecording.join(states), times)

    def record(self, recording: PinocchioRecording, k: int) -> None:
        """Record the present state as sample k."""
        model, data = self.bicycle.model, self.bicycle.data
        recording.time[k] = self.time
        recording.configuration[k], recording.velocity[k] = self.configuration, self.velocity
        recording.energy[k, 0] = pin.computeKineticEnergy(model, data, self.configuration, self.velocity)
        recording.energy[k, 1] = pin.computePotentialEnergy(model, data, self.configuration)
        for body, joint in enumerate(JOINTS):
            place = data.oMi[joint]
            recording.position[k, body] = place.act(model.inertias[joint].lever)
            recording.rotation[k, body] = place.rotation
            recording.spin[k, body] = pin.getVelocity(model, data, joint, pin.LOCAL_WORLD_ALIGNED).angular
        recording.force[k] = self.bicycle.force

    def _step(self) -> tuple[np.ndarray, np.ndarray]:
        step, state = self.settings.step, (self.configuration, self.velocity, self._rates)
        if self.settings.integrator == "rk4":
            return step_rk4(*state, step, self.watch.accelerate)
        return step_euler(self.bicycle.model, *state, step)

    def _evaluate(self) -> None:
        self._rates = self.watch.accelerate(self.configuration, self.velocity)


def ride_bicycle(problem: Problem, settings: ConstraintSettings, progress: Progress) -> PinocchioOutcome:
    """Integrate a problem.

    Raises
    ------
    ValueError
        If the output times are not a uniform grid from 0, or the step does not divide its interval.
    EngineError
        If not even the start can be evaluated.
    """
    stride = steps_per_output(problem.times, settings.step)
    recording = PinocchioRecording.empty(len(problem.times))
    try:
        ride = PinocchioRide(problem, settings)
    except NoAccelerationError as error:
        raise EngineError(f"{error} at the start") from error
    ended = ride.find_unconverged()
    if ended is not None:
        raise EngineError(ended)
    ride.record(recording, 0)
    samples, cpu_time, ended, fall = _continue_ride(ride, stride, recording, progress)
    return PinocchioOutcome(
        recording=recording.first(samples),
        steps=ride.steps,
        cpu_time=cpu_time,
        ended=ended,
        fall=fall,
        unconverged_steps=ride.unconverged,
        largest_residual=ride.watch.largest,
    )


def _continue_ride(
    ride: PinocchioRide, stride: int, recording: PinocchioRecording, progress: Progress
) -> tuple[int, float, str | None, Fall | None]:
    """Continue from the first sample; return samples, CPU time [s], why the ride ended early, and a fall."""
    cpu_time, reported = 0.0, 0.0
    for k in range(1, len(recording.time)):
        begin = process_time()
        ended, touch = ride.advance_by(stride)
        cpu_time += process_time() - begin
        if touch is not None:
            # The end may lie before the last sample.
            return max(1, bisect_right(recording.time[:k], touch.time)), cpu_time, touch.why, touch.fall
        if ended is not None:
            return k, cpu_time, ended, None
        ride.record(recording, k)
        if ride.time - reported >= REPORT_INTERVAL:
            reported = ride.time
            progress(reported)
    return len(recording.time), cpu_time, None, None
