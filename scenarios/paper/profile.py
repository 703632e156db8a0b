"""Distance of two solution curves in the coordinates of the paper's figures."""

from __future__ import annotations

import numpy as np

from ...reference.bicycle import Bicycle
from ...reference.curve import Samples

SPEED = 4.0  # m/s: the scale of the figures' abscissa, arctan(R_f wf / 4)


def figure_coordinates(bicycle: Bicycle, samples: Samples) -> np.ndarray:
    """Return abscissa, lean and steer of samples, shape (n, 3) [rad]."""
    return np.column_stack([abscissa(bicycle, samples.front_rate), samples.lean, samples.steer])


def abscissa(bicycle: Bicycle, front_rate: np.ndarray | float) -> np.ndarray:
    """Return the figures' abscissa: arctan of the magnitude of the scaled front speed [rad]."""
    return np.arctan(bicycle.front_wheel_radius * np.abs(front_rate) / SPEED)


def curve_distance(one: np.ndarray, other: np.ndarray) -> float:
    """Return the largest distance of a point of either curve (n, 3) from the other curve (Hausdorff distance) [rad]."""
    return max(float(nearest_point(a, b)[0].max()) for a, b in ((one, other), (other, one)))


def nearest_point(points: np.ndarray, curve: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return distances (n,) of points (n, k) from a polyline (m, k), and the nearest points on it, (n, k)."""
    start, along = curve[:-1], np.diff(curve, axis=0)
    length = np.maximum(np.einsum("mk,mk->m", along, along), 1e-300)
    share = np.einsum("nmk,mk->nm", points[:, None] - start, along) / length
    feet = start + np.clip(share, 0, 1)[:, :, None] * along
    gaps = np.linalg.norm(points[:, None] - feet, axis=2)
    least = gaps.argmin(axis=1)
    rows = np.arange(len(points))
    return gaps[rows, least], feet[rows, least]
