"""An engine's ride of a motion, with the quantities that follow from its coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ...engines.engine import Trajectory
from ...reference.kinematics import YAW
from ..measure import LARGEST_NOISE, ROUND_OFF, START_ERROR, Mismatch, evaluate_ride, find_mismatches, noise
from .motions import TransientMotion

_SINGLE = 2.0**-23


@dataclass(frozen=True)
class Ride:
    """A ride of an engine and the motion that it should follow.

    Attributes
    ----------
    motion : TransientMotion
    trajectory : Trajectory
        As `velodrome.engines.admission.ride_engine` admits it.
    step_noise : float
        Relative error that a step may add beyond its method, as stated by the engine.
    """

    motion: TransientMotion
    trajectory: Trajectory
    step_noise: float

    @cached_property
    def followed(self) -> Trajectory:
        """The ride with all other quantities computed from its coordinates and rates."""
        return evaluate_ride(self.trajectory, self.motion.problem.bicycle, self.motion.problem.surface)

    @cached_property
    def mismatches(self) -> list[Mismatch]:
        """Comparisons of the reported quantities and rates with the coordinates."""
        motion = self.motion
        return find_mismatches(self.trajectory, self.followed, motion.exact, motion.size, self.step_noise)

    @cached_property
    def exact(self) -> Trajectory:
        """The reference's ride, cut to the length of this one."""
        return self.motion.exact.first(len(self.trajectory.time))

    @property
    def step(self) -> float:
        """Mean step [s]."""
        return float(self.trajectory.time[-1]) / max(1, self.trajectory.steps)

    @property
    def noise(self) -> float:
        """Relative error of the final state that round-off and iterations may cause."""
        return noise(self.motion.scale, min(self.step_noise, LARGEST_NOISE), self.trajectory.steps)

    @property
    def round_off(self) -> float:
        """Unit of round-off of the engine: that of single precision if its step noise is as large."""
        return _SINGLE if self.step_noise >= _SINGLE / 2 else ROUND_OFF

    @cached_property
    def q(self) -> np.ndarray:
        """Coordinates with angles shifted by whole turns to the nearest of the reference, shape (n, 9)."""
        return without_turns(self.trajectory.q, self.exact.q)

    @cached_property
    def error(self) -> float:
        """Largest difference of the coordinates from the reference, relative to the motion's sizes."""
        return float(np.abs((self.q - self.exact.q) / self.motion.sizes).max()) + START_ERROR

    def altered(self, **changes: Any) -> Ride:
        """Return the ride with some fields of its trajectory replaced."""
        return Ride(self.motion, replace(self.trajectory, **changes), self.step_noise)

    def mismatch(self, quantities: Sequence[str]) -> list[Mismatch]:
        """Return the comparisons of some quantities that do not hold."""
        return [found for found in self.mismatches if found.quantity in quantities and not found.holds]


def without_turns(q: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Return coordinates (..., 9) with all angles shifted by whole turns to the nearest to those of ``near``."""
    shifted = np.array(q, float)
    shifted[..., YAW:] -= 2 * np.pi * np.round((shifted - near)[..., YAW:] / (2 * np.pi))
    return shifted
