"""Step a simulation of Drake's through a ride and record its samples."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from time import process_time
from typing import Any

import numpy as np

from ...reference.bicycle import BODIES
from ...reference.rim import Ending, RimWatch
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
    """Result of a ride: its samples, the number of steps, their CPU time [s] and why the ride ended early."""

    recording: DrakeRecording
    steps: int
    cpu_time: float
    ended: str | None


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
    try:
        watch = RimWatch(problem.bicycle, problem.surface, problem.q)
    except ValueError as error:
        raise EngineError(str(error)) from error
    recording = DrakeRecording.empty(len(counts))
    rig.follow(0)
    _look_at_rims(rig, watch, 0.0)
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
                # The second touch may lie before the last sample.
                samples = max(1, bisect_right(counts[:k], touch.time / step))
                return DrakeRide(recording.first(samples), steps, cpu_time, touch.why)
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
    rig: DrakeRig, watch: RimWatch, step: float, steps: int, until: int
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
        touch = _look_at_rims(rig, watch, steps * step)
        if touch is not None:
            return steps, None, touch
    return steps, None, None


def _look_at_rims(rig: DrakeRig, watch: RimWatch, time: float) -> Ending | None:
    """Return why the ride ends if a rim touches the ground at a second place."""
    if not watch.needed:
        return None
    motion = BodyMotions.empty(2)
    read_wheel_motions(rig.tree, rig.context, motion)
    watch.centre[:], watch.axle[:] = motion.position, motion.rotation[:, :, 1]
    return watch.look(time)


def _record_sample(rig: DrakeRig, recording: DrakeRecording, k: int) -> None:
    recording.time[k] = rig.context.get_time()
    read_body_motions(rig.tree, rig.context, recording.motion[k])
    recording.force[k] = rig.forces()
    recording.kinetic_energy[k] = rig.tree.plant.CalcKineticEnergy(rig.context)
    recording.potential_energy[k] = rig.tree.plant.CalcPotentialEnergy(rig.context)


def _join_lines(error: Exception) -> str:
    return " ".join(str(error).split())
