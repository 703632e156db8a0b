"""Normal forces of the ground on both wheels along a motion."""

from __future__ import annotations

import numpy as np

from .surface import Surface, unit_normals


def normal_forces(surface: Surface, contact: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Compute the parts of contact forces along the surface's upward normal, shape (..., 2) [N].

    Parameters
    ----------
    surface : Surface
    contact : ndarray, shape (..., 2, 3)
        Contact parameters (xi, eta, rim angle) of both wheels.
    force : ndarray, shape (..., 2, 3)
        Contact forces on the wheels in inertial axes [N].
    """
    return (force * unit_normals(surface, contact[..., 0], contact[..., 1])).sum(axis=-1)
