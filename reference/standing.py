"""Check that the wheels of a circular motion can stand on the ground, with their whole rims clear of it.

The equations of circular motions contain each wheel's contact only. In a bowl about as tight as a wheel, the rim of
a solution may lie inside the ground elsewhere.
"""

from __future__ import annotations

import numpy as np

from .bicycle import Bicycle
from .circular import CONTACT, LEAN, PITCH, STEER, CircularMotion, Steady
from .rim import require_clear_rims, rim_clearances
from .surface import Surface


def stands(equations: Steady, unknowns: np.ndarray) -> bool:
    """Return whether both rims are clear of the ground except at their contacts, at a solution of shape (22,)."""
    u = unknowns
    q = np.array([u[0], u[1], u[2], 0.0, u[LEAN], u[PITCH], u[STEER], 0.0, 0.0])
    return bool(np.all(rim_clearances(equations.bicycle, equations.surface, q, u[CONTACT]) > 0))


def motion_stands(bicycle: Bicycle, surface: Surface, motion: CircularMotion) -> bool:
    """Return whether both rims of a motion are clear of the ground except at their contacts."""
    return bool(np.all(rim_clearances(bicycle, surface, motion.state()[0], motion.contact.ravel()) > 0))


def require_standing(bicycle: Bicycle, surface: Surface, motion: CircularMotion) -> None:
    """Refuse a motion with a rim inside the ground.

    Raises
    ------
    ValueError
        If a rim is not clear, with the motion, the wheel, the depth and the place.
    """
    try:
        require_clear_rims(bicycle, surface, motion.state()[0], motion.contact.ravel())
    except ValueError as error:
        angles = f"lean {motion.lean:.6g}, steer {motion.steer:.6g}"
        raise ValueError(f"no bicycle can ride the solution at {angles} on {surface}: {error}") from error
