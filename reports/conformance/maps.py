"""Whether an engine's maps between coordinates are right, and which one is wrong.

There are two kinds of evidence for every map of `coordinate_maps`:

- *Rolling.* Slip and gaps follow from coordinates and rates alone. An engine that projects its start onto the
  constraints rolls in the right coordinates, whatever its physics. If it mirrors a coordinate both in its input and in
  its output, the wheels slip by metres per second in its output, and roll when the coordinate is mirrored again.
- *The ride.* The reference simulates the problem with each wrong map (`predictions`), and the engine's ride is compared
  with these rides. This finds wrong maps of engines that do not project their start onto the constraints, and maps
  that are wrong in the input or in the output alone.

The only tolerance is that a wrong map must explain nine tenths: of the slip and the gaps, or of the difference from
the reference's ride.
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
_AS_MUCH = 2.0  # evidence that leaves up to twice the smallest share counts as equally good


@dataclass(frozen=True)
class MapEvidence:
    """How much of the slip or the difference remains if a wrong map is assumed.

    Attributes
    ----------
    what : str
        Description of the map.
    simple : bool
        False for a combination of two mistakes.
    share : float
        What remains, as a share of the original slip or difference.
    description : str
        Both amounts, as text.
    """

    what: str
    simple: bool
    share: float
    description: str


def check_maps(ride: Ride) -> ConformanceCheck:
    """Check that no wrong map explains a ride."""
    name = f"maps on {ride.motion.name}"
    if len(ride.q) < 2:
        return skip_check(name, _CLAIM, "it has no sample except the start")
    found = find_wrong_map(ride)
    own = violation(ride.motion, ride.trajectory.q, ride.trajectory.qd)
    wrong = [] if found is None else [f"{found.what}: {found.description}"]
    return make_check(name, _CLAIM, wrong, [f"wheels are off rolling by {own:.2g} of their speed"], _LIMIT)


def find_wrong_map(ride: Ride) -> MapEvidence | None:
    """Return the wrong map that explains a ride best, or None.

    A combination of two mistakes is returned only if no single one explains the ride.
    """
    if len(ride.q) < 2:
        return None
    all_evidence = [*_compare_rolling(ride), *_compare_rides(ride)]
    for simple in (True, False):
        candidates = [evidence for evidence in all_evidence if evidence.simple is simple]
        least = min(evidence.share for evidence in candidates)
        if least <= EXPLAINED:
            # Of equally good maps the first one, which is the simplest: on a plane y shows by its rate alone.
            return next(evidence for evidence in candidates if evidence.share <= _AS_MUCH * least)
    return None


def _compare_rolling(ride: Ride) -> Iterator[MapEvidence]:
    q, qd = ride.trajectory.q, ride.trajectory.qd
    own = violation(ride.motion, q, qd)
    for map_ in coordinate_maps():
        left = violation(ride.motion, q @ map_.positions.T, qd @ map_.rates.T)
        text = f"wheels are off rolling by {own:.2g} of their speed in its coordinates, and by {left:.2g} in the others"
        yield MapEvidence(map_.what, map_.simple, _divide(left, own), text)


def _compare_rides(ride: Ride) -> Iterator[MapEvidence]:
    motion, exact, qd = ride.motion, ride.motion.exact, ride.trajectory.qd
    own = measure_distance(motion, ride.q, qd, exact.q, exact.qd)
    for prediction in predictions(motion):
        left = measure_distance(motion, ride.trajectory.q, qd, prediction.q, prediction.qd)
        text = f"its ride is {own:.2g} from the reference's, and {left:.2g} from the reference's with that mistake"
        yield MapEvidence(prediction.what, prediction.simple, _divide(left, own), text)


def _divide(left: float, own: float) -> float:
    """Return left / own; a zero or infinite ``own`` gives 0 if ``left`` is smaller, and inf otherwise."""
    return left / own if 0 < own < np.inf else (0.0 if left < own else np.inf)


def violation(motion: TransientMotion, q: np.ndarray, qd: np.ndarray) -> float:
    """Measure how far the wheels are from rolling: mean slip relative to speed, plus mean gap relative to radius.

    The result is inf if a wheel has no contact. The first sample is left out: it is the problem's start and does not
    depend on the engine.
    """
    with np.errstate(all="ignore"):
        contact = observe(motion.problem.bicycle, motion.problem.surface, q[1:], qd[1:])
        slip = float(np.mean(np.linalg.norm(contact.slip, axis=2))) / motion.scale.speed
        total = slip + float(np.mean(np.abs(contact.gap))) / motion.problem.bicycle.rear_wheel_radius
    return total if contact.found and np.isfinite(total) else np.inf


def find_scaled_rate(ride: Ride) -> str | None:
    """Return which rate looks scaled and by how much, or None if no scaled rate explains the slip.

    Slip is linear in the rates, so each factor follows from a least-squares fit.
    """
    bicycle, surface = ride.motion.problem.bicycle, ride.motion.problem.surface
    q, qd = ride.trajectory.q[1:], ride.trajectory.qd[1:]
    slip = observe(bicycle, surface, q, qd).slip
    best: tuple[float, str] | None = None
    for i, name in enumerate(rate_names()):
        alone = np.zeros_like(qd)
        alone[:, i] = qd[:, i]
        part = observe(bicycle, surface, q, alone).slip
        square = float(np.sum(part * part))
        if not square > 0:
            continue
        more = -float(np.sum(slip * part)) / square
        share = float(np.linalg.norm(slip + more * part) / np.linalg.norm(slip)) if np.any(slip) else 1.0
        if share <= EXPLAINED and (best is None or share < best[0]):
            best = share, f"{name} looks scaled by {1 / (1 + more):.6g}: the wheels slip by as much"
    return None if best is None else best[1]
