"""A ride's state against the exact one."""

from __future__ import annotations

import numpy as np

from ...engines.engine import Trajectory
from .consistency import coordinate_differences
from .limits import Scale
from .metrics import SETTLED_SHARE


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
    return float(np.sqrt(np.mean(relative_differences(trajectory, exact, scale) ** 2)))


def relative_differences(trajectory: Trajectory, exact: Trajectory, scale: Scale) -> np.ndarray:
    """Differences of all coordinates and rates of a ride of n samples, relative to sizes as in `state_error`.

    Returns
    -------
    ndarray, shape (2, n, 9)
    """
    n = len(trajectory.time)
    apart = coordinate_differences(trajectory, exact)
    sizes = np.array([*3 * [scale.radius], *4 * [1.0], *2 * [scale.turned]])
    return np.array([apart / sizes, (trajectory.qd - exact.qd[:n]) / scale.rates])


def rms_force_error(trajectory: Trajectory, exact: Trajectory) -> float | None:
    """Root mean square of the contact forces' differences from the exact ones, relative to the largest of those.

    A largest difference would hide what changes in any sample but the worst. Samples before contacts have settled are
    left out; None where there are no others, or no forces.
    """
    settled = trajectory.time >= SETTLED_SHARE
    if trajectory.contact_force is None or exact.contact_force is None or not settled.any():
        return None
    force = exact.contact_force[: len(trajectory.time)]
    apart = np.linalg.norm(trajectory.contact_force - force, axis=2)[settled]
    return float(np.sqrt(np.mean(apart**2)) / np.linalg.norm(force, axis=2).max())
