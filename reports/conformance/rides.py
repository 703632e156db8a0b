"""An engine's ride of a motion, with what follows from its coordinates."""

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
    """A ride.

    Attributes
    ----------
    motion : TransientMotion
    trajectory : Trajectory
        As `velodrome.engines.admission.ride_engine` admits it.
    step_noise : float
        Relative error that a step of the engine may add beyond its method, as it says itself.
    """

    motion: TransientMotion
    trajectory: Trajectory
    step_noise: float

    @cached_property
    def followed(self) -> Trajectory:
        """The ride as it follows from its coordinates and rates."""
        return evaluate_ride(self.trajectory, self.motion.problem.bicycle, self.motion.problem.surface)

    @cached_property
    def mismatches(self) -> list[Mismatch]:
        """Reports and rates held against the coordinates."""
        motion = self.motion
        return find_mismatches(self.trajectory, self.followed, motion.exact, motion.size, self.step_noise)

    @cached_property
    def exact(self) -> Trajectory:
        """The reference's ride, as long as this one."""
        return self.motion.exact.first(len(self.trajectory.time))

    @property
    def step(self) -> float:
        """Mean step [s]."""
        return float(self.trajectory.time[-1]) / max(1, self.trajectory.steps)

    @property
    def noise(self) -> float:
        """Relative error of the state at the end that round-off and iterations may leave."""
        return noise(self.motion.scale, min(self.step_noise, LARGEST_NOISE), self.trajectory.steps)

    @property
    def round_off(self) -> float:
        """Unit of round-off that the engine computes with: single precision if its steps leave as much."""
        return _SINGLE if self.step_noise >= _SINGLE / 2 else ROUND_OFF

    @cached_property
    def q(self) -> np.ndarray:
        """Coordinates with all angles on the reference's turns, shape (n, 9)."""
        return without_turns(self.trajectory.q, self.exact.q)

    @cached_property
    def error(self) -> float:
        """Largest error of the coordinates against the reference, relative to the motion's sizes."""
        return float(np.abs((self.q - self.exact.q) / self.motion.sizes).max()) + START_ERROR

    def altered(self, **changes: Any) -> Ride:
        """The ride with other samples of some fields."""
        return Ride(self.motion, replace(self.trajectory, **changes), self.step_noise)

    def mismatch(self, quantities: Sequence[str]) -> list[Mismatch]:
        """What does not agree of some quantities."""
        return [one for one in self.mismatches if one.quantity in quantities and not one.holds]


def without_turns(q: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Coordinates (..., 9) with all angles shifted by whole turns to the nearest to others."""
    shifted = np.array(q, float)
    shifted[..., YAW:] -= 2 * np.pi * np.round((shifted - near)[..., YAW:] / (2 * np.pi))
    return shifted
