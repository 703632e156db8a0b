"""Find when a bicycle falls, and cut rides there.

All functions use the rear frame's position, as it follows from the coordinates (`velodrome.reference.fall`).
"""

from __future__ import annotations

from dataclasses import replace

from ...engines.engine import Trajectory
from ...reference.bicycle import Bicycle
from ...reference.fall import count_standing, heights_above_fallen, solve_fall
from ...reference.surface import Surface


def fell_at(trajectory: Trajectory, bicycle: Bicycle, surface: Surface, standing: int | None = None) -> float | None:
    """Return the time at which the rear frame's centre of mass is nearly on the ground [s]; None if it never is.

    The time is solved between the two states around the fall: those that the engine gives, or two samples of an engine
    that rode on. The height is the cubic polynomial with their heights and rates. ``standing`` is the number of samples
    before the fall, if it is known (`velodrome.reference.fall.count_standing`).
    """
    first = count_standing(bicycle, surface, trajectory.q, trajectory.qd) if standing is None else standing
    if first == len(trajectory.time):
        fall = trajectory.fall
        if fall is None:
            return None
        return solve_fall(fall.time, *heights_above_fallen(bicycle, surface, fall.q, fall.qd))
    if first == 0:
        return float(trajectory.time[0])
    around = slice(first - 1, first + 1)
    heights = heights_above_fallen(bicycle, surface, trajectory.q[around], trajectory.qd[around])
    return solve_fall(trajectory.time[around], *heights)


def until_fall(
    trajectory: Trajectory, bicycle: Bicycle, surface: Surface, beyond: int = 0, standing: int | None = None
) -> Trajectory:
    """Return the ride up to its fall and ``beyond`` samples more: at least one sample, and all if it does not fall.

    ``standing`` is as in `fell_at`.
    """
    if standing is None:
        standing = count_standing(bicycle, surface, trajectory.q, trajectory.qd)
    return trajectory if standing == len(trajectory.time) else trajectory.first(max(1, standing + beyond))


def cut_at_fall(trajectory: Trajectory, bicycle: Bicycle, surface: Surface) -> Trajectory:
    """Return the ride up to its fall and one further sample, which is not measured and shows the fallen bicycle."""
    cut = until_fall(trajectory, bicycle, surface, 1)
    return cut if len(cut.time) == len(trajectory.time) else replace(cut, ended="the bicycle fell")
