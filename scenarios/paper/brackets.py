"""Directions that a rolling bicycle can reach: velocities, their Lie brackets, and brackets of those."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...reference.bicycle import Bicycle
from ...reference.dae import contact_parameters
from ...reference.kernels import dynamics as kernel
from ...reference.kinematics import LEAN, REAR_ANGLE, STEER, constants
from ...reference.surface import Paraboloid

Field = Callable[[np.ndarray], np.ndarray]

_STEP = 3e-4  # of central differences, nested twice: truncation error h^2, round-off 1e-16 / h^2
_COUNTS = 1e-4  # relative size above which singular values count: the errors of differences are about 1e-7


def _velocity_field(bicycle: Bicycle, surface: Paraboloid, free: int) -> Field:
    """Make the velocity field (9,) -> (9,) of one free rate equal to one, the others zero."""

    def field(q: np.ndarray) -> np.ndarray:
        qd = np.zeros(9)
        qd[free] = 1.0
        p = contact_parameters(bicycle, surface, q)
        kernel.complete_velocity(q, qd, p, surface.function.real, surface.parameters, constants(bicycle))
        return qd

    return field


def bracket(first: Field, second: Field) -> Field:
    """Make the Lie bracket [first, second] by central differences along the fields."""

    def along(field: Field, direction: np.ndarray, q: np.ndarray) -> np.ndarray:
        return (field(q + _STEP * direction) - field(q - _STEP * direction)) / (2 * _STEP)

    return lambda q: along(second, first(q), q) - along(first, second(q), q)


def growth(bicycle: Bicycle, surface: Paraboloid, q: np.ndarray) -> tuple[list[int], float]:
    """Count the dimensions spanned by the velocities, with their brackets, and with brackets of those.

    Parameters
    ----------
    bicycle : Bicycle
    surface : Paraboloid
    q : ndarray, shape (9,)
        Coordinates with both wheels on the ground.

    Returns
    -------
    dimensions : list of int
        One for each of the three sets.
    smallest : float
        Smallest singular value that counts, relative to the largest.
    """
    fields = [_velocity_field(bicycle, surface, free) for free in (LEAN, STEER, REAR_ANGLE)]
    brackets = [bracket(fields[i], fields[j]) for i, j in ((0, 1), (0, 2), (1, 2))]
    second = [bracket(field, other) for field in fields for other in brackets]
    spans, smallest = [], np.inf
    for spanning in (fields, [*fields, *brackets], [*fields, *brackets, *second]):
        rows = np.array([field(q) for field in spanning])
        values = np.linalg.svd(rows / np.linalg.norm(rows, axis=1, keepdims=True), compute_uv=False)
        counted = values[values > _COUNTS * values[0]]
        spans.append(len(counted))
        smallest = min(smallest, float(counted[-1] / values[0]))
    return spans, smallest
