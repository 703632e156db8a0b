"""Find when a bicycle falls, and cut rides there: nothing but the wheels touches the ground in the models.

All functions use the rear frame's position. Pass them rides as returned by
`velodrome.reports.measure.consistency.evaluate_ride`; otherwise the engine's own poses decide whether it fell.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...engines.engine import Trajectory
from ...reference.bicycle import Bicycle
from ...reference.surface import Surface, evaluate

_FALLEN_HEIGHT = 0.1  # relative to the upright height of the rear frame's centre of mass; a lean of some 84 degrees


def fell_at(trajectory: Trajectory, bicycle: Bicycle, surface: Surface) -> float | None:
    """Return the time at which the rear frame's centre of mass is nearly on the ground [s]; None if it never is.

    The time is interpolated linearly between samples.
    """
    height, time = _height_above_fallen(trajectory, bicycle, surface), trajectory.time
    low = np.flatnonzero(height < 0)
    if len(low) == 0:
        return None
    k = int(low[0])
    if k == 0:
        return float(time[0])
    share = height[k - 1] / (height[k - 1] - height[k])
    return float(time[k - 1] + share * (time[k] - time[k - 1]))


def until_fall(trajectory: Trajectory, bicycle: Bicycle, surface: Surface, beyond: int = 0) -> Trajectory:
    """Return the ride up to its fall and ``beyond`` samples more: at least one sample, and all if it does not fall."""
    low = np.flatnonzero(_height_above_fallen(trajectory, bicycle, surface) < 0)
    return trajectory if len(low) == 0 else trajectory.first(max(1, int(low[0]) + beyond))


def cut_at_fall(trajectory: Trajectory, bicycle: Bicycle, surface: Surface) -> Trajectory:
    """Return the ride up to its fall and one further sample, which is not measured and shows the fallen bicycle."""
    cut = until_fall(trajectory, bicycle, surface, 1)
    return cut if len(cut.time) == len(trajectory.time) else replace(cut, ended="the bicycle fell")


def _height_above_fallen(trajectory: Trajectory, bicycle: Bicycle, surface: Surface) -> np.ndarray:
    """Return the height of the rear frame's centre of mass above that at which it counts as fallen, shape (n,) [m]."""
    centre = trajectory.body_position[:, 0]
    ground = evaluate(surface, centre[:, 0], centre[:, 1])[:, 0]
    return centre[:, 2] - ground - _FALLEN_HEIGHT * bicycle.rear_frame_z
