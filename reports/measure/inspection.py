"""Compare a ride's state and forces with the exact ones."""

from __future__ import annotations

import numpy as np

from ...engines.engine import Trajectory
from .consistency import coordinate_differences
from .limits import Scale
from .metrics import SETTLED_SHARE


def state_error(trajectory: Trajectory, exact: Trajectory, scale: Scale) -> float:
    """Return the root mean square error of all coordinates and rates, relative to the sizes of the motion.

    A largest error would not show changes in any coordinate but the worst.

    Parameters
    ----------
    trajectory, exact : Trajectory
        Sampled at the same times; the exact one may be longer.
    scale : Scale
        Positions are relative to its radius, wheel angles to their rotation in its duration, other angles to a
        radian; the rates of D are relative to its speed, the others to the wheels' rate.
    """
    return float(np.sqrt(np.mean(relative_differences(trajectory, exact, scale) ** 2)))


def relative_differences(trajectory: Trajectory, exact: Trajectory, scale: Scale) -> np.ndarray:
    """Return the errors of all coordinates and rates of a ride of n samples, relative to sizes as in `state_error`.

    Returns
    -------
    ndarray, shape (2, n, 9)
    """
    n = len(trajectory.time)
    difference = coordinate_differences(trajectory, exact)
    sizes = np.array([*3 * [scale.radius], *4 * [1.0], *2 * [scale.turned]])
    return np.array([difference / sizes, (trajectory.qd - exact.qd[:n]) / scale.rates])


def rms_force_error(trajectory: Trajectory, exact: Trajectory) -> float | None:
    """Return the root mean square error of the contact forces, relative to the largest exact force.

    A largest error would not show changes in any sample but the worst. Samples before the contacts have settled are
    left out. None where there are no others, or no forces.
    """
    settled = trajectory.time >= SETTLED_SHARE
    if trajectory.contact_force is None or exact.contact_force is None or not settled.any():
        return None
    force = exact.contact_force[: len(trajectory.time)]
    difference = np.linalg.norm(trajectory.contact_force - force, axis=2)[settled]
    return float(np.sqrt(np.mean(difference**2)) / np.linalg.norm(force, axis=2).max())
