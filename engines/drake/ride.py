"""Step a simulation of Drake's through a ride and record its samples."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from time import process_time
from typing import Any

import numpy as np

from ...reference.bicycle import BODIES
from ...reference.fall import Ending, Fall, FallWatch, find_first_ending
from ...reference.rim import RimWatch
from ..coordinates import coordinates_from_bodies, start_on_turn
from ..engine import EngineError, Problem, Progress
from .tree import BodyMotions, DrakeTree, read_body_motions, read_wheel_motions

REPORT_INTERVAL = 0.05  # [s]


@dataclass(frozen=True)
class DrakeRig:
    """A simulation with its state and its contact with the ground.

    Attributes
    ----------
    simulator : Simulator
    tree : DrakeTree
    context : Context
        The plant's part of the simulator's context.
    follow : callable
        Updates the contacts with the number of steps taken. To be called before the first step and after each; raises
        EngineError if a wheel has no contact.
    forces : callable
        Returns the contact forces on the wheels (2, 3) at the current state, inertial axes [N].
    """

    simulator: Any
    tree: DrakeTree
    context: Any
    follow: Callable[[int], None]
    forces: Callable[[], np.ndarray]


@dataclass(frozen=True)
class DrakeRecording:
    """The n samples of a ride.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Drake's time [s].
    motion : BodyMotions
        Of the four bodies, (n, 4).
    force : ndarray, shape (n, 2, 3)
        Contact forces on the wheels, inertial axes [N].
    kinetic_energy, potential_energy : ndarray, shape (n,)
        Energies [J].
    """

    time: np.ndarray
    motion: BodyMotions
    force: np.ndarray
    kinetic_energy: np.ndarray
    potential_energy: np.ndarray

    @classmethod
    def empty(cls, n: int) -> DrakeRecording:
        """Return arrays for n samples, filled with zeros."""
        return cls(np.zeros(n), BodyMotions.empty(n, len(BODIES)), np.zeros((n, 2, 3)), np.zeros(n), np.zeros(n))

    def first(self, n: int) -> DrakeRecording:
        """Return the first n samples."""
        return DrakeRecording(
            self.time[:n], self.motion[:n], self.force[:n], self.kinetic_energy[:n], self.potential_energy[:n]
        )


@dataclass(frozen=True)
class DrakeRide:
    """Result of a ride: samples, number of steps, their CPU time [s], why the ride ended early, and its fall."""

    recording: DrakeRecording
    steps: int
    cpu_time: float
    ended: str | None
    fall: Fall | None = None


class RideWatch:
    """Watch over the rims of both wheels, and for the fall of the bicycle.

    Parameters
    ----------
    rig : DrakeRig
    problem : Problem

    Raises
    ------
    EngineError
        If a rim lies inside the ground at the start.
    """

    def __init__(self, rig: DrakeRig, problem: Problem) -> None:
        self._rig, self._problem = rig, problem
        try:
            self._rims = RimWatch(problem.bicycle, problem.surface, problem.q)
        except ValueError as error:
            raise EngineError(str(error)) from error
        self._fall = None if problem.beyond_fall else FallWatch(problem.bicycle, problem.surface, self._convert)

    def look(self, time: float) -> Ending | None:
        """Return when and why the ride ends at a time [s], None if it goes on."""
        return find_first_ending(self._look_at_rims(time), self._look_at_fall(time))

    def _look_at_rims(self, time: float) -> Ending | None:
        if not self._rims.needed:
            return None
        motion = BodyMotions.empty(2)
        read_wheel_motions(self._rig.tree, self._rig.context, motion)
        self._rims.centre[:], self._rims.axle[:] = motion.position, motion.rotation[:, :, 1]
        return self._rims.look(time)

    def _look_at_fall(self, time: float) -> Ending | None:
        if self._fall is None or not self._fall.is_due(time):
            return None
        motion = BodyMotions.empty(len(BODIES))
        read_body_motions(self._rig.tree, self._rig.context, motion)
        return self._fall.look(time, self._fall.measure_height(motion.position[0]), motion)

    def _convert(self, times: np.ndarray, states: tuple[BodyMotions, BodyMotions]) -> tuple[np.ndarray, np.ndarray]:
        return convert_motions(self._problem, times, BodyMotions.stack(states))


def convert_motions(problem: Problem, times: np.ndarray, motion: BodyMotions) -> tuple[np.ndarray, np.ndarray]:
    """Compute generalised coordinates and rates (n, 9), with angles on the same turn as the problem's start."""
    q, qd = coordinates_from_bodies(
        problem.bicycle, times, motion.position[:, 0], motion.velocity[:, 0], motion.rotation, motion.spin
    )
    return start_on_turn(q, problem.q), qd


def ride_simulation(rig: DrakeRig, problem: Problem, step: float, counts: list[int], progress: Progress) -> DrakeRide:
    """Integrate from the current state of a rig.

    Parameters
    ----------
    rig : DrakeRig
    problem : Problem
    step : float
        Time step [s].
    counts : list of int
        Number of steps from the start to each output time.
    progress : callable

    Raises
    ------
    EngineError
        If a wheel has no contact point at the start, or Drake cannot evaluate it.
    """
    watch = RideWatch(rig, problem)
    recording = DrakeRecording.empty(len(counts))
    rig.follow(0)
    watch.look(0.0)
    try:
        rig.simulator.Initialize()
        _record_sample(rig, recording, 0)
    except EngineError:
        raise
    except RuntimeError as error:
        raise EngineError(f"Drake cannot evaluate the start: {_join_lines(error)}") from error
    steps, cpu_time, reported = 0, 0.0, 0
    steps_per_report = max(1, int(REPORT_INTERVAL / step))
    for k in range(1, len(counts)):
        while steps < counts[k]:
            until = min(counts[k], reported + steps_per_report)
            begun = process_time()
            steps, ended, touch = _advance(rig, watch, step, steps, until)
            cpu_time += process_time() - begun
            if touch is not None:
                # The end may lie before the last sample.
                samples = max(1, bisect_right(counts[:k], touch.time / step))
                return DrakeRide(recording.first(samples), steps, cpu_time, touch.why, touch.fall)
            if ended is not None:
                return DrakeRide(recording.first(k), steps, cpu_time, f"{ended} at {steps * step:.6g} s")
            if steps - reported >= steps_per_report:
                reported = steps
                progress(steps * step)
        try:
            _record_sample(rig, recording, k)
        except (EngineError, RuntimeError) as error:
            return DrakeRide(recording.first(k), steps, cpu_time, f"{_join_lines(error)} at {steps * step:.6g} s")
    return DrakeRide(recording, steps, cpu_time, None)


def _advance(
    rig: DrakeRig, watch: RideWatch, step: float, steps: int, until: int
) -> tuple[int, str | None, Ending | None]:
    """Step from ``steps`` to ``until`` steps; return the number of steps and why the ride ends, if it does."""
    while steps < until:
        try:
            # To the end of one step at a time: over several, an integrator with fixed steps adds up their lengths,
            # misses the end by their round-off and takes a step of 1e-17 s.
            rig.simulator.AdvanceTo((steps + 1) * step)
            steps += 1
            if not np.all(np.isfinite(rig.tree.plant.GetPositionsAndVelocities(rig.context))):
                return steps, "Drake's state became infinite", None
            rig.follow(steps)
        except (EngineError, RuntimeError) as error:
            return steps, _join_lines(error), None
        touch = watch.look(steps * step)
        if touch is not None:
            return steps, None, touch
    return steps, None, None


def _record_sample(rig: DrakeRig, recording: DrakeRecording, k: int) -> None:
    recording.time[k] = rig.context.get_time()
    read_body_motions(rig.tree, rig.context, recording.motion[k])
    recording.force[k] = rig.forces()
    recording.kinetic_energy[k] = rig.tree.plant.CalcKineticEnergy(rig.context)
    recording.potential_energy[k] = rig.tree.plant.CalcPotentialEnergy(rig.context)


def _join_lines(error: Exception) -> str:
    return " ".join(str(error).split())
