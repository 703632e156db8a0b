"""The edge of a basin along a direction of disturbance, by a scan and repeated division of an interval.

The disturbances of a direction that are survived need not be an interval. The scan shows which of its sizes are; the
edge is the first change outwards from a survived to a lost one, and whatever is narrower than the scan is missed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..simulate import RideStart
from .disturbance import disturb
from .neighbours import StableNeighbours
from .outcome import RideOutcome
from .riding import Patience, ride_out

_PARTS = 8  # of an interval in a round, whose rides share a call of compiled code


@dataclass(frozen=True, eq=False)
class Shot:
    """A ride next to the edge: the size of its disturbance, its start, and what became of it."""

    size: float
    start: RideStart | None
    outcome: RideOutcome


Shoot = Callable[[np.ndarray], list[Shot]]


@dataclass(frozen=True, eq=False)
class EdgeBracket:
    """The edge along a direction.

    Attributes
    ----------
    direction : ndarray, shape (7,)
        Change of the independent variables for a size of 1.
    scan : list of Shot
        By rising size.
    inside, outside : Shot or None
        The nearest survived and lost disturbances on both sides of the edge; None where the smallest of the scan is
        lost, or none is.
    """

    direction: np.ndarray
    scan: list[Shot]
    inside: Shot | None
    outside: Shot | None

    @property
    def size(self) -> float | None:
        """Middle between both; None where there is no edge in the scan."""
        if self.inside is None or self.outside is None:
            return None
        return 0.5 * (self.inside.size + self.outside.size)

    @property
    def error(self) -> float | None:
        """Half of the distance between both."""
        if self.inside is None or self.outside is None:
            return None
        return 0.5 * (self.outside.size - self.inside.size)

    @property
    def survivors_beyond(self) -> list[float]:
        """Sizes of the scan beyond the edge that are survived."""
        if self.outside is None:
            return []
        return [shot.size for shot in self.scan if shot.size > self.outside.size and shot.outcome.survived]


def make_shoot(
    neighbours: StableNeighbours, direction: np.ndarray, patience: Patience, threads: int = 1, start=disturb
) -> Shoot:
    """Return a function that rides disturbances of given sizes along a direction (7,).

    Parameters
    ----------
    neighbours, direction, patience, threads
    start : callable
        `velodrome.reference.basins.disturbance.disturb`, or `disturb_on_level` there.
    """

    def shoot(sizes: np.ndarray) -> list[Shot]:
        starts = start(neighbours.equations, neighbours.motion, np.outer(sizes, direction))
        outcomes = ride_out(neighbours, starts, patience, threads)
        return [Shot(*shot) for shot in zip(sizes.tolist(), starts, outcomes, strict=True)]

    return shoot


def find_edge(shoot: Shoot, direction: np.ndarray, sizes: Sequence[float] | np.ndarray, relative: float) -> EdgeBracket:
    """Find the edge of the basin along a direction.

    Parameters
    ----------
    shoot : callable
        See `make_shoot`.
    direction : ndarray, shape (7,)
    sizes : sequence of float
        Rising sizes of the scan, positive.
    relative : float
        Distance between both sides of the edge at which the search ends, relative to its size; it ends earlier where
        rides between them are undecided.

    Returns
    -------
    EdgeBracket
    """
    scan = shoot(np.asarray(sizes, float))
    first = next((k for k, shot in enumerate(scan) if shot.outcome.lost), None)
    if first is None:
        return EdgeBracket(direction, scan, scan[-1], None)
    before = [shot for shot in scan[:first] if shot.outcome.survived]
    if not before:
        return EdgeBracket(direction, scan, None, scan[first])
    inside, outside = narrow(shoot, before[-1], scan[first], relative * scan[first].size)
    return EdgeBracket(direction, scan, inside, outside)


def narrow(shoot: Shoot, inside: Shot, outside: Shot, width: float) -> tuple[Shot, Shot]:
    """Divide the interval between a survived and a lost disturbance until it is as narrow as ``width``.

    Returns
    -------
    inside, outside : Shot
        Both sides of the first change from survived to lost in each round. Their distance is larger than ``width``
        where rides in between are undecided.
    """
    while outside.size - inside.size > width:
        sizes = np.linspace(inside.size, outside.size, _PARTS + 1)[1:-1]
        if not inside.size < sizes[0] < sizes[-1] < outside.size:
            break  # neighbouring floating-point numbers
        shots = [inside, *shoot(sizes), outside]
        first = next(k for k, shot in enumerate(shots) if shot.outcome.lost)
        last = max(k for k in range(first) if shots[k].outcome.survived)
        inside, outside = shots[last], shots[first]
        if first - last > 1 + _PARTS // 2:  # most of the interval is undecided
            break
    return inside, outside
