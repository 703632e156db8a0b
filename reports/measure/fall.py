"""When a bicycle falls, and the ride up to there: nothing but wheels touches the ground, so no ride comes after.

All of it looks at the rear frame's position: give it rides as `velodrome.reports.measure.consistency.evaluate_ride`
does, or the engine says itself whether it fell.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...engines.engine import Trajectory
from ...reference.bicycle import Bicycle
from ...reference.surface import Surface, evaluate

_FALLEN_HEIGHT = 0.1  # of the upright height of the rear frame's centre of mass: a lean of some 84 degrees


def fell_at(trajectory: Trajectory, bicycle: Bicycle, surface: Surface) -> float | None:
    """Time at which the rear frame's centre of mass is nearly on the ground [s], samples joined by lines; or None."""
    height, time = _height(trajectory, bicycle, surface), trajectory.time
    low = np.flatnonzero(height < 0)
    if len(low) == 0:
        return None
    k = int(low[0])
    if k == 0:
        return float(time[0])
    share = height[k - 1] / (height[k - 1] - height[k])
    return float(time[k - 1] + share * (time[k] - time[k - 1]))


def until_fall(trajectory: Trajectory, bicycle: Bicycle, surface: Surface, beyond: int = 0) -> Trajectory:
    """The ride up to its fall, and a number of samples ``beyond``; at least one sample, and all if it does not fall."""
    low = np.flatnonzero(_height(trajectory, bicycle, surface) < 0)
    return trajectory if len(low) == 0 else trajectory.first(max(1, int(low[0]) + beyond))


def cut_at_fall(trajectory: Trajectory, bicycle: Bicycle, surface: Surface) -> Trajectory:
    """The ride up to its fall and one sample more than what is measured: there it lies."""
    shown = until_fall(trajectory, bicycle, surface, 1)
    return shown if len(shown.time) == len(trajectory.time) else replace(shown, ended="the bicycle fell")


def _height(trajectory: Trajectory, bicycle: Bicycle, surface: Surface) -> np.ndarray:
    """Height of the rear frame's centre of mass over where it counts as fallen, shape (n,) [m]."""
    centre = trajectory.body_position[:, 0]
    ground = evaluate(surface, centre[:, 0], centre[:, 1])[:, 0]
    return centre[:, 2] - ground - _FALLEN_HEIGHT * bicycle.rear_frame_z
