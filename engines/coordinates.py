"""Conversion between the suite's coordinates and an engine's rigid bodies.

The nine coordinates and their order are `COORDINATES`, the four bodies `BODIES`; the theory page of the documentation
states the axes. Maps of coordinates take those of a trajectory, of shape (n, 9), or of one state, of shape (9,), and
raise ValueError for others.

- An engine that uses these coordinates gets the poses of its bodies from `body_positions` and `body_quaternions`, and
  their twists from `body_velocities` and `angular_velocities`. These functions also place the bodies at the start.
- An engine of rigid bodies gets its coordinates and rates from `coordinates_from_bodies`; `start_on_turn` shifts them
  to the turns on which the problem starts. `unwrap` continues angles that are known modulo a whole turn.
- `quaternions` converts rotation matrices to quaternions (w, x, y, z), and `rotation_matrices` converts them back.
"""

from __future__ import annotations

import numpy as np

from ..reference.bicycle import BODIES
from ..reference.kinematics import (
    COORDINATES,
    WHEELS,
    YAW,
    angular_velocities,
    body_positions,
    body_quaternions,
    body_velocities,
    coordinates_from_bodies,
    quaternions,
    rotations,
    unwrap,
)

__all__ = [
    "BODIES",
    "COORDINATES",
    "WHEELS",
    "angular_velocities",
    "body_positions",
    "body_quaternions",
    "body_velocities",
    "coordinates_from_bodies",
    "quaternions",
    "rotation_matrices",
    "rotations",
    "start_on_turn",
    "unwrap",
]


def start_on_turn(q: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Shift angles by whole turns so that the first sample has the turns of the problem's start.

    Parameters
    ----------
    q : ndarray, shape (n, 9)
        Coordinates whose angles are continuous and start on any turn.
    start : ndarray, shape (9,)
        Coordinates of the problem's start.

    Returns
    -------
    ndarray, shape (n, 9)
    """
    shifted = q.copy()
    shifted[:, YAW:] += 2 * np.pi * np.round((start[YAW:] - q[0, YAW:]) / (2 * np.pi))
    return shifted


def rotation_matrices(quaternions: np.ndarray) -> np.ndarray:
    """Return the rotation matrices (..., 3, 3) of quaternions (w, x, y, z), shape (..., 4), of any nonzero length."""
    w, x, y, z = np.moveaxis(np.asarray(quaternions, float), -1, 0)
    s = 2 / (w * w + x * x + y * y + z * z)
    rows = (
        (1 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)),
        (s * (x * y + w * z), 1 - s * (x * x + z * z), s * (y * z - w * x)),
        (s * (x * z - w * y), s * (y * z + w * x), 1 - s * (x * x + y * y)),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
