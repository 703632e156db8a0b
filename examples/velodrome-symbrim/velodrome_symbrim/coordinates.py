"""The suite's coordinates in symbrim's, and back.

The suite: x forward, y left, z up; x, y, z of D, yaw, lean, pitch, steer, rear and front angle. symbrim: x
forward, y right, z down; rear contact's x and y, yaw, roll, pitch, rear angle, steer, front angle. So rotations
about x keep their sign and all others change it; pitch also changes by the tilt of the steering axis, with
which symbrim's rear frame is aligned.
"""

from __future__ import annotations

import numpy as np

from .equations import SPEEDS, Equations

AXES = np.array([1.0, -1.0, -1.0])  # of a vector, either way
# yaw, lean, pitch, steer, rear angle, front angle: places in the suite's nine and in symbrim's eight, and signs.
_SUITE = np.array([3, 4, 5, 6, 7, 8])
_SYMBRIM = np.array([2, 3, 4, 6, 5, 7])
_SIGNS = np.array([-1.0, 1.0, -1.0, -1.0, -1.0, -1.0])
_PITCH = 4  # in symbrim's eight


def to_symbrim(equations: Equations, q: np.ndarray, qd: np.ndarray) -> np.ndarray:
    """State (16,) of symbrim from the suite's coordinates and rates, shapes (9,)."""
    x = np.zeros(2 * SPEEDS)
    x[_SYMBRIM], x[SPEEDS + _SYMBRIM] = _SIGNS * q[_SUITE], _SIGNS * qd[_SUITE]
    x[_PITCH] += equations.tilt
    # With the rear contact at rest in the origin, D is as far from where it should be as the contact is.
    position, velocity = equations.reference_point(x[None])
    x[:2] = (AXES * q[:3] - position[0])[:2]
    x[SPEEDS : SPEEDS + 2] = (AXES * qd[:3] - velocity[0])[:2]
    return x


def from_symbrim(equations: Equations, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates and rates of the suite, shapes (n, 9), along states (n, 16)."""
    q, qd = np.empty((len(x), 9)), np.empty((len(x), 9))
    position, velocity = equations.reference_point(x)
    q[:, :3], qd[:, :3] = AXES * position, AXES * velocity
    angles = x[:, :SPEEDS].copy()
    angles[:, _PITCH] -= equations.tilt
    q[:, _SUITE], qd[:, _SUITE] = _SIGNS * angles[:, _SYMBRIM], _SIGNS * x[:, SPEEDS + _SYMBRIM]
    return q, qd
