"""Wrong maps of coordinates: mirrored, swapped, or in other units."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import combinations

import numpy as np

from ...reference.kinematics import COORDINATES, FRONT_ANGLE, LEAN, PITCH, REAR_ANGLE, STEER, YAW
from .explain import rate_names

_SWAPS = (
    (0, 1),
    (YAW, LEAN),
    (YAW, PITCH),
    (LEAN, PITCH),
    (LEAN, STEER),
    (PITCH, STEER),
    (REAR_ANGLE, FRONT_ANGLE),
)


@dataclass(frozen=True)
class CoordinateMap:
    """A wrong map of coordinates, which ``positions @ q`` and ``rates @ qd`` undo.

    Attributes
    ----------
    what : str
        Description of the map.
    positions, rates : ndarray, shape (9, 9)
        Matrices that undo the map, for coordinates and rates.
    simple : bool
        False for a combination of two mistakes.
    """

    what: str
    positions: np.ndarray
    rates: np.ndarray
    simple: bool = True


@cache
def coordinate_maps() -> tuple[CoordinateMap, ...]:
    """Return the wrong maps that the examination distinguishes."""
    return tuple(_make_maps())


def _make_maps() -> Iterator[CoordinateMap]:
    for i, name in enumerate(COORDINATES):
        yield CoordinateMap(f"{name} looks mirrored", _make_mirror(i), _make_mirror(i))
    for i, name in enumerate(rate_names()):
        yield CoordinateMap(f"{name} looks mirrored, the coordinate not", np.eye(9), _make_mirror(i))
    for i, name in enumerate(COORDINATES):
        yield CoordinateMap(f"{name} looks mirrored, its rate not", _make_mirror(i), np.eye(9))
    for i, j in _SWAPS:
        swap = np.eye(9)
        swap[[i, j]] = swap[[j, i]]
        yield CoordinateMap(f"{COORDINATES[i]} looks swapped with {COORDINATES[j]}", swap, swap)
    for angles in ([YAW], [LEAN], [PITCH], [STEER], list(range(YAW, 9))):
        radians = np.eye(9)
        radians[angles, angles] = np.pi / 180
        what = COORDINATES[angles[0]] if len(angles) == 1 else "every angle"
        yield CoordinateMap(f"{what} looks to be in degrees", radians, radians)
    for i, j in combinations(range(9), 2):
        both = _make_mirror(i, j)
        yield CoordinateMap(f"{COORDINATES[i]} and {COORDINATES[j]} look mirrored", both, both, simple=False)


def _make_mirror(*columns: int) -> np.ndarray:
    mirror = np.eye(9)
    mirror[columns, columns] = -1
    return mirror
