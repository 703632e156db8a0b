"""When a bicycle counts as fallen: nothing but the wheels touches the ground in the models.

The rear frame's centre of mass is then nearly on the ground, at a lean of some 84 degrees.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Generic, TypeVar

import numpy as np

from .bicycle import BODIES, Bicycle
from .kernels.fall import FallCriterion, measure_heights
from .surface import Surface, evaluate

LOOK_INTERVAL = 0.01  # between two looks at a ride of fixed steps [s]
_NEAR = 3.0  # heights above the ground, in units of the criterion's, below which a bicycle is looked at in every step
FALLEN_HEIGHT = 0.1  # relative to the upright height of the rear frame's centre of mass


_State = TypeVar("_State")


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


@dataclass(frozen=True)
class Ending:
    """Time [s] and reason of a ride's end; the states around a fall if it is one."""

    time: float
    why: str
    fall: Fall | None = None


def find_first_ending(*endings: Ending | None) -> Ending | None:
    """Return the ending with the least time; None if there is none."""
    return min((one for one in endings if one is not None), key=lambda ending: ending.time, default=None)


@lru_cache(maxsize=64)
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


def count_standing(bicycle: Bicycle, surface: Surface, q: np.ndarray, qd: np.ndarray) -> int:
    """Return the number of states, coordinates and rates (n, 9), before the first in which the bicycle has fallen."""
    low = np.flatnonzero(heights_above_fallen(bicycle, surface, q, qd)[0] <= 0)
    return int(low[0]) if len(low) else len(q)


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


class FallWatch(Generic[_State]):
    """Watch for the fall of a bicycle in a ride of an engine with fixed steps.

    Parameters
    ----------
    bicycle : Bicycle
    surface : Surface
    convert : callable
        Returns the coordinates and rates, shapes (2, 9), of two of the engine's own states, from their times (2,) and
        the states.

    Attributes
    ----------
    near : bool
        Whether the bicycle was so low at the last look that every step is to be looked at.
    """

    def __init__(
        self,
        bicycle: Bicycle,
        surface: Surface,
        convert: Callable[[np.ndarray, tuple[_State, _State]], tuple[np.ndarray, np.ndarray]],
    ) -> None:
        self._where = bicycle, surface
        self._convert = convert
        self._before: tuple[float, _State] | None = None
        self._near_height = _NEAR * fall_criterion(bicycle).limit
        self._due = 0.0
        self.near = False

    def is_due(self, time: float) -> bool:
        """Return whether the bicycle is to be looked at: every 10 ms, and at every step once it is near its fall."""
        return time >= self._due

    def measure_height(self, centre: Sequence[float] | np.ndarray) -> float:
        """Return the height of the rear frame's centre of mass (3,) [m] above that of a fallen bicycle [m]."""
        bicycle, surface = self._where
        return float(centre[2] - evaluate(surface, centre[0], centre[1])[0] - fall_criterion(bicycle).limit)

    def look(self, time: float, height: float, state: _State) -> Ending | None:
        """Look at the bicycle at a time [s]; return when and why the ride ends, None if it does not.

        Parameters
        ----------
        time : float
        height : float
            Height above that at which the bicycle counts as fallen, as `heights_above_fallen` computes it [m].
        state : object
            The engine's own state at that time, which it does not change later.
        """
        before, self._before = self._before, (time, state)
        self.near = not height > self._near_height
        # A multiple of the interval counts as reached despite round-off.
        self._due = time if self.near else time + LOOK_INTERVAL * (1 - 1e-6)
        if before is None or not height <= 0:  # a height that is not a number is no fall
            return None
        times = np.array([before[0], time])
        q, qd = self._convert(times, (before[1], state))
        fell = solve_fall(times, *heights_above_fallen(*self._where, q, qd))
        return Ending(fell, describe_fall(fell), Fall(times, q, qd))
