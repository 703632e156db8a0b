"""Normal forces of a ride, the friction that it requires, and where a given coefficient is insufficient."""

from __future__ import annotations

import numpy as np

from ...engines.engine import Trajectory
from ...reference.surface import Surface
from .kernels.forces import split_forces


def normal_force(trajectory: Trajectory, surface: Surface) -> np.ndarray | None:
    """Return the contact forces along the surface's upward normal, shape (n, 2) [N]; None where they are not given."""
    parts = separate_forces(trajectory, surface)
    return None if parts is None else parts[0]


def separate_forces(trajectory: Trajectory, surface: Surface) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the contact forces along the surface's upward normal and across it, each of shape (n, 2) [N]."""
    if trajectory.contact_force is None or trajectory.contact_point is None:
        return None
    point, force = (np.ascontiguousarray(part) for part in (trajectory.contact_point, trajectory.contact_force))
    pressure, tangential = np.empty(force.shape[:2]), np.empty(force.shape[:2])
    split_forces(point, force, surface.function.real, surface.parameters, pressure, tangential)
    return pressure, tangential


def required_friction(trajectory: Trajectory, surface: Surface) -> np.ndarray:
    """Return the least coefficient of friction for the contact forces of a trajectory, wheel by wheel.

    Parameters
    ----------
    trajectory : Trajectory
        Has contact points and forces; those of the reference give the friction for rolling without slip.
    surface : Surface

    Returns
    -------
    ndarray, shape (n, 2)
        Tangential over normal force; infinite where the ground would have to pull, 0 without any force.

    Raises
    ------
    ValueError
        If the trajectory has no contact points or forces.
    """
    parts = separate_forces(trajectory, surface)
    if parts is None:
        raise ValueError(f"{trajectory.engine} gives no contact forces")
    return divide_forces(*parts)


def divide_forces(pressure: np.ndarray, tangential: np.ndarray) -> np.ndarray:
    """Return the coefficients of friction that forces need, all of shape (n, 2); see `required_friction`."""
    # A wheel in the air needs no friction.
    ratio = np.divide(tangential, pressure, out=np.full(pressure.shape, np.inf), where=pressure > 0)
    return np.where((pressure == 0) & (tangential == 0), 0.0, ratio)


def cone_is_left(friction: float, rolling: Trajectory, surface: Surface) -> float | None:
    """Return the first time at which rolling needs more friction than there is [s]; None if it never does.

    Parameters
    ----------
    friction : float
        Coefficient of friction of the contact.
    rolling : Trajectory
        The reference's ride.
    surface : Surface
    """
    beyond = np.flatnonzero((required_friction(rolling, surface) > friction).any(axis=1))
    return float(rolling.time[beyond[0]]) if len(beyond) else None
