"""Which map of coordinates a ride speaks of: the wheels roll in the coordinates of the right one.

Slip and gaps follow from coordinates and rates alone. An engine whose maps are right rides on its wheels in its own
coordinates, whatever its physics; one that mirrors a coordinate on its way in and back slips by metres a second in the
coordinates that it gives, and rolls in those with the coordinate mirrored again. So every map of a list is undone in
turn, and that which leaves the least violation of the rolling constraints is the one that the ride speaks of. No
tolerance enters but that a wrong map explains at least half of the violation.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import combinations

import numpy as np

from ...engines.engine import Trajectory
from ...reference.contact import observe
from ...reference.kinematics import COORDINATES, FRONT_ANGLE, LEAN, PITCH, REAR_ANGLE, STEER, YAW
from .explain import EXPLAINED, rate_names
from .motions import Motion
from .report import Check, judge, skip
from .rides import Ride

_HALF = 0.5
_SWAPS = (
    (0, 1),
    (YAW, LEAN),
    (YAW, PITCH),
    (LEAN, PITCH),
    (LEAN, STEER),
    (PITCH, STEER),
    (REAR_ANGLE, FRONT_ANGLE),
)
CLAIM = "the wheels roll in its coordinates, and in no mirrored, swapped or rescaled ones better"


@dataclass(frozen=True)
class CoordinateMap:
    """A way to mistake coordinates, and how it is undone: q is ``positions @ q`` and qd ``rates @ qd``.

    Attributes
    ----------
    what : str
        In words.
    positions, rates : ndarray, shape (9, 9)
    """

    what: str
    positions: np.ndarray
    rates: np.ndarray


@cache
def coordinate_maps() -> tuple[CoordinateMap, ...]:
    """The maps that are told apart, the simplest first."""
    return tuple(_maps())


def _maps() -> Iterator[CoordinateMap]:
    for i, name in enumerate(COORDINATES):
        yield CoordinateMap(f"{name} looks mirrored", _mirror(i), _mirror(i))
    for i, name in enumerate(rate_names()):
        yield CoordinateMap(f"{name} looks mirrored, the coordinate not", np.eye(9), _mirror(i))
    for i, name in enumerate(COORDINATES):
        yield CoordinateMap(f"{name} looks mirrored, its rate not", _mirror(i), np.eye(9))
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
        both = _mirror(i, j)
        yield CoordinateMap(f"{COORDINATES[i]} and {COORDINATES[j]} look mirrored", both, both)


def _mirror(*columns: int) -> np.ndarray:
    mirror = np.eye(9)
    mirror[columns, columns] = -1
    return mirror


def violation(motion: Motion, q: np.ndarray, qd: np.ndarray) -> float:
    """How far wheels are from rolling on the ground, a mean over samples: slip over speed, and gap over radius.

    inf where a wheel has no contact. The first sample is the problem's start, which says nothing of the engine.
    """
    with np.errstate(all="ignore"):
        seen = observe(motion.problem.bicycle, motion.problem.surface, q[1:], qd[1:])
        slip = float(np.mean(np.linalg.norm(seen.slip, axis=2))) / motion.scale.speed
        found = slip + float(np.mean(np.abs(seen.gap))) / motion.problem.bicycle.rear_wheel_radius
    return found if seen.found and np.isfinite(found) else np.inf


def check_maps(ride: Ride) -> Check:
    """Check that a ride speaks of no wrong map."""
    motion, trajectory = ride.motion, ride.trajectory
    if len(trajectory.q) < 2:
        return skip(f"maps on {motion.name}", CLAIM, "it has no sample but the start")
    told = f"wheels are off rolling by {violation(motion, trajectory.q, trajectory.qd):.2g} of their speed"
    wrong = []
    best = best_map(motion, trajectory)
    if best is not None:
        wrong = [f"{best[0].what}: {told} in its coordinates, and by {best[1]:.2g} with that undone"]
    limit = "a map is wrong if another explains at least half of the slip and the gaps"
    return judge(f"maps on {motion.name}", CLAIM, wrong, [told], limit)


def best_map(motion: Motion, trajectory: Trajectory) -> tuple[CoordinateMap, float] | None:
    """The simplest map among those that explain a ride best, with the violation that it leaves; None for the right one.

    A pair of mirrored coordinates is named only if it explains what no single one does.
    """
    if len(trajectory.q) < 2:
        return None
    own = violation(motion, trajectory.q, trajectory.qd)
    maps = coordinate_maps()
    left = [violation(motion, trajectory.q @ one.positions.T, trajectory.qd @ one.rates.T) for one in maps]
    least = min(left)
    if not least < _HALF * own:
        return None
    first = next(i for i, value in enumerate(left) if value <= least + EXPLAINED * (own if own < np.inf else 1.0))
    return maps[first], left[first]


def scaled_rate(motion: Motion, trajectory: Trajectory) -> str | None:
    """Which rate looks scaled and by how much, if slip is explained by one: slip is linear in the rates."""
    bicycle, surface, q, qd = motion.problem.bicycle, motion.problem.surface, trajectory.q[1:], trajectory.qd[1:]
    slip = observe(bicycle, surface, q, qd).slip
    told: tuple[float, str] | None = None
    for i, name in enumerate(rate_names()):
        alone = np.zeros_like(qd)
        alone[:, i] = qd[:, i]
        part = observe(bicycle, surface, q, alone).slip
        square = float(np.sum(part * part))
        if not square > 0:
            continue
        more = -float(np.sum(slip * part)) / square
        share = float(np.linalg.norm(slip + more * part) / np.linalg.norm(slip)) if np.any(slip) else 1.0
        if share <= EXPLAINED and (told is None or share < told[0]):
            told = share, f"{name} looks scaled by {1 / (1 + more):.6g}: the wheels slip by as much"
    return None if told is None else told[1]
