"""A ride's state against the exact one."""

from __future__ import annotations

import numpy as np

from engines.engine import Trajectory

from .consistency import coordinate_differences
from .limits import Scale


def state_error(trajectory: Trajectory, exact: Trajectory, scale: Scale) -> float:
    """Root mean square of all coordinates' and rates' differences from the exact motion's, relative to its sizes.

    A largest difference would hide what changes in any coordinate but the worst.

    Parameters
    ----------
    trajectory, exact : Trajectory
        Sampled at the same times; the exact one may be longer.
    scale : Scale
        Positions are measured by its radius, wheel angles by what they turn in its duration, other angles by a
        radian; rates by the wheels', and those of D by its speed.
    """
    n = len(trajectory.time)
    apart = coordinate_differences(trajectory, exact)
    sizes = np.array([*3 * [scale.radius], *4 * [1.0], *2 * [scale.turned]])
    return float(np.sqrt(np.mean([(apart / sizes) ** 2, ((trajectory.qd - exact.qd[:n]) / scale.rates) ** 2])))
