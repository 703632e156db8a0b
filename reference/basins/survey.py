"""Outcomes of many disturbances: over a grid of two of them, and the share of a set that is survived."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..stability import VARIABLES
from .disturbance import disturb
from .neighbours import StableNeighbours
from .outcome import KINDS, SURVIVED, UNDECIDED, RideOutcome
from .riding import Patience, ride_out

_BLOCK = 2048  # starts that are held at once


@dataclass(frozen=True, eq=False)
class OutcomeMap:
    """Outcomes over a grid of two disturbances.

    Attributes
    ----------
    names : tuple of str
        The variables that are changed, along x and along y.
    x, y : ndarray, shapes (k,), (m,)
        Their changes, rising.
    kinds : ndarray of int, shape (m, k)
        Indices in `velodrome.reference.basins.outcome.KINDS`.
    times : ndarray, shape (m, k)
        When it was decided [s].
    """

    names: tuple[str, str]
    x: np.ndarray
    y: np.ndarray
    kinds: np.ndarray
    times: np.ndarray


@dataclass(frozen=True)
class Share:
    """The share of disturbances, drawn at random from a set, that are survived.

    Attributes
    ----------
    rides : int
        Number of disturbances.
    survived : int
        Number of those survived.
    undecided : int
        Number of those of which it is not known.
    kinds : dict
        Number of each outcome that occurred.
    """

    rides: int
    survived: int
    undecided: int
    kinds: dict[str, int]

    @property
    def share(self) -> float:
        """Of those survived; undecided ones count as lost."""
        return self.survived / self.rides

    @property
    def error(self) -> float:
        """Standard error by the binomial law, with one more of each kind, so that it is not zero at 0 and 1.

        The share could be larger by ``undecided / rides``, too.
        """
        better = (self.survived + 1) / (self.rides + 2)
        return float(np.sqrt(better * (1 - better) / self.rides))


def ride_disturbances(
    neighbours: StableNeighbours,
    changes: np.ndarray,
    patience: Patience,
    threads: int = 1,
    watch: Callable[[int], None] = lambda _: None,
    start=disturb,
) -> list[RideOutcome]:
    """Ride disturbances of a circle until it is decided what becomes of each.

    Parameters
    ----------
    neighbours : StableNeighbours
    changes : ndarray, shape (n, 7)
        Of the independent variables.
    patience : Patience
    threads : int
    watch : callable
        Called with the number of rides that are decided.
    start : callable
        `velodrome.reference.basins.disturbance.disturb`, or `disturb_on_level` there.

    Returns
    -------
    list of RideOutcome
    """
    outcomes: list[RideOutcome] = []
    for first in range(0, len(changes), _BLOCK):
        starts = start(neighbours.equations, neighbours.motion, changes[first : first + _BLOCK])
        before = len(outcomes)
        outcomes += ride_out(neighbours, starts, patience, threads, lambda done, before=before: watch(before + done))
    return outcomes


def map_outcomes(
    neighbours: StableNeighbours,
    names: tuple[str, str],
    values: tuple[np.ndarray, np.ndarray],
    patience: Patience,
    threads: int = 1,
    watch: Callable[[int], None] = lambda _: None,
    start=disturb,
) -> OutcomeMap:
    """Ride all disturbances of a grid.

    Parameters
    ----------
    neighbours : StableNeighbours
    names : tuple of str
        Two of the independent variables.
    values : tuple of ndarray, shapes (k,), (m,)
        Their changes.
    patience, threads, watch, start
        As of `ride_disturbances`.

    Returns
    -------
    OutcomeMap
    """
    x, y = values
    changes = np.zeros((len(y), len(x), len(VARIABLES)))
    changes[:, :, VARIABLES.index(names[0])] = x
    changes[:, :, VARIABLES.index(names[1])] = y[:, None]
    outcomes = ride_disturbances(neighbours, changes.reshape(-1, len(VARIABLES)), patience, threads, watch, start)
    kinds = np.array([KINDS.index(outcome.kind) for outcome in outcomes]).reshape(len(y), len(x))
    times = np.array([outcome.time for outcome in outcomes]).reshape(kinds.shape)
    return OutcomeMap(names, x, y, kinds, times)


def draw_box(reach: np.ndarray, count: int, seed: int = 0) -> np.ndarray:
    """Draw changes (count, 7) of the variables, evenly from -reach to reach (7,) in each."""
    return np.random.default_rng(seed).uniform(-reach, reach, (count, len(reach)))


def count_share(outcomes: list[RideOutcome]) -> Share:
    """Count the outcomes of disturbances."""
    kinds = Counter(outcome.kind for outcome in outcomes)
    survived = sum(kinds[kind] for kind in SURVIVED)
    return Share(len(outcomes), survived, kinds[UNDECIDED], {kind: kinds[kind] for kind in KINDS if kinds[kind]})
