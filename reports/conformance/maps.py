"""Whether an engine's maps of coordinates are right, and which one is wrong.

Two kinds of evidence, each for every map of `coordinate_maps`:

- *Rolling.* Slip and gaps follow from coordinates and rates alone. An engine that puts its start on the constraints
  rolls in the right coordinates, whatever its physics; if it mirrors one on its way in and back, its wheels slip by
  metres a second in what it gives, and roll in that with the coordinate mirrored again.
- *The ride.* The reference rides with the map wrong (`predictions`), and one of these rides is the engine's. This tells
  a map of engines that keep what is off the constraints, and one that is wrong on the way in or back alone.

No tolerance enters but that a wrong map explains nine tenths: of the slip and the gaps, or of the difference from the
reference's ride.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...reference.contact import observe
from .coordinate_maps import coordinate_maps
from .explain import EXPLAINED, rate_names
from .motions import TransientMotion
from .predictions import measure_distance, predictions
from .report import ConformanceCheck, make_check, skip_check
from .rides import Ride

_CLAIM = "neither its slip nor its ride is that of mirrored, swapped or rescaled coordinates"
_LIMIT = "a map is wrong if that explains nine tenths of the slip and the gaps, or of the ride's difference"
_AS_MUCH = 2.0  # evidence that leaves up to twice the least is as good


@dataclass(frozen=True)
class MapEvidence:
    """How much a wrong map leaves of what it should explain.

    Attributes
    ----------
    what : str
        The map in words.
    simple : bool
        False for two mistakes at once.
    share : float
        What is left, as a share of what there is.
    told : str
        Both in words.
    """

    what: str
    simple: bool
    share: float
    told: str


def check_maps(ride: Ride) -> ConformanceCheck:
    """Check that no wrong map explains a ride."""
    name = f"maps on {ride.motion.name}"
    if len(ride.q) < 2:
        return skip_check(name, _CLAIM, "it has no sample but the start")
    found = find_wrong_map(ride)
    own = violation(ride.motion, ride.trajectory.q, ride.trajectory.qd)
    wrong = [] if found is None else [f"{found.what}: {found.told}"]
    return make_check(name, _CLAIM, wrong, [f"wheels are off rolling by {own:.2g} of their speed"], _LIMIT)


def find_wrong_map(ride: Ride) -> MapEvidence | None:
    """The wrong map that explains a ride best, or None; two mistakes only where no single one explains it."""
    if len(ride.q) < 2:
        return None
    all_of_them = [*_of_rolling(ride), *_of_the_ride(ride)]
    for simple in (True, False):
        candidates = [one for one in all_of_them if one.simple is simple]
        least = min(one.share for one in candidates)
        if least <= EXPLAINED:
            # Of those that explain as much the plainest, which stands first: on a plane y is told by its rate alone.
            return next(one for one in candidates if one.share <= _AS_MUCH * least)
    return None


def _of_rolling(ride: Ride) -> Iterator[MapEvidence]:
    q, qd = ride.trajectory.q, ride.trajectory.qd
    own = violation(ride.motion, q, qd)
    for map_ in coordinate_maps():
        left = violation(ride.motion, q @ map_.positions.T, qd @ map_.rates.T)
        told = f"wheels are off rolling by {own:.2g} of their speed in its coordinates, and by {left:.2g} in the others"
        yield MapEvidence(map_.what, map_.simple, _share(left, own), told)


def _of_the_ride(ride: Ride) -> Iterator[MapEvidence]:
    motion, exact, qd = ride.motion, ride.motion.exact, ride.trajectory.qd
    own = measure_distance(motion, ride.q, qd, exact.q, exact.qd)
    for one in predictions(motion):
        left = measure_distance(motion, ride.trajectory.q, qd, one.q, one.qd)
        told = f"its ride is {own:.2g} from the reference's, and {left:.2g} from the reference's with that mistake"
        yield MapEvidence(one.what, one.simple, _share(left, own), told)


def _share(left: float, own: float) -> float:
    return left / own if 0 < own < np.inf else (0.0 if left < own else np.inf)


def violation(motion: TransientMotion, q: np.ndarray, qd: np.ndarray) -> float:
    """How far wheels are from rolling on the ground, a mean over samples: slip over speed, and gap over radius.

    inf where a wheel has no contact. The first sample is the problem's start, which says nothing of the engine.
    """
    with np.errstate(all="ignore"):
        seen = observe(motion.problem.bicycle, motion.problem.surface, q[1:], qd[1:])
        slip = float(np.mean(np.linalg.norm(seen.slip, axis=2))) / motion.scale.speed
        found = slip + float(np.mean(np.abs(seen.gap))) / motion.problem.bicycle.rear_wheel_radius
    return found if seen.found and np.isfinite(found) else np.inf


def find_scaled_rate(ride: Ride) -> str | None:
    """Which rate looks scaled and by how much, if slip is explained by one: slip is linear in the rates."""
    bicycle, surface = ride.motion.problem.bicycle, ride.motion.problem.surface
    q, qd = ride.trajectory.q[1:], ride.trajectory.qd[1:]
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
