"""When a bicycle counts as fallen: nothing but the wheels touches the ground in the models.

The rear frame's centre of mass is then nearly on the ground, at a lean of some 84 degrees.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .bicycle import BODIES, Bicycle
from .kernels.fall import FallCriterion, measure_heights
from .surface import Surface

FALLEN_HEIGHT = 0.1  # relative to the upright height of the rear frame's centre of mass


@dataclass(frozen=True, eq=False)
class Fall:
    """The states of a ride just before and just after its bicycle fell.

    Attributes
    ----------
    time : ndarray, shape (2,)
        [s].
    q, qd : ndarray, shape (2, 9)
        Coordinates and rates.
    """

    time: np.ndarray
    q: np.ndarray
    qd: np.ndarray

    def as_json(self) -> dict[str, Any]:
        """Return the arrays as lists."""
        return {name: getattr(self, name).tolist() for name in ("time", "q", "qd")}


def describe_fall(time: float) -> str:
    """Describe why a ride ends at a time [s] at which its bicycle falls."""
    return f"the bicycle fell at t = {time:.6g} s"


def fall_criterion(bicycle: Bicycle, watched: bool = True) -> FallCriterion:
    """Return the criterion of a bicycle for kernels; a ride ends at its fall if ``watched``."""
    x, _, z = bicycle.centre(BODIES[0]) - bicycle.reference_point
    return FallCriterion(float(x), float(z), FALLEN_HEIGHT * bicycle.rear_frame_z, watched)


def heights_above_fallen(
    bicycle: Bicycle, surface: Surface, q: np.ndarray, qd: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Compute the height of the rear frame's centre of mass above that at which the bicycle counts as fallen.

    Parameters
    ----------
    bicycle : Bicycle
    surface : Surface
    q, qd : ndarray, shape (n, 9)
        Coordinates and rates.

    Returns
    -------
    height, rate : ndarray, shape (n,)
        [m] and [m/s].
    """
    states, height, rate = np.concatenate([q, qd], axis=1), np.empty(len(q)), np.empty(len(q))
    measure_heights(states, fall_criterion(bicycle), surface.function.real, surface.parameters, height, rate)
    return height, rate


def solve_fall(times: np.ndarray, heights: np.ndarray, rates: np.ndarray) -> float:
    """Return the time at which a height becomes zero between two states, the first above zero and the second not [s].

    The height is the cubic polynomial with the given values and rates: the error is of fourth order in the interval.

    Parameters
    ----------
    times, heights, rates : ndarray, shape (2,)
        [s], [m], [m/s].
    """
    span = float(times[1] - times[0])
    (a, b), (va, vb) = heights, rates * span
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        s, r = middle, 1 - middle
        value = r * r * (a * (1 + 2 * s) + va * s) + s * s * (b * (1 + 2 * r) - vb * r)
        low, high = (middle, high) if value > 0 else (low, middle)
    return float(times[0]) + high * span
