"""Bifurcations of periodic orbits along a branch.

With mu the five multipliers other than those of time and energy, each kind of event is a change of sign along the
branch (Kuznetsov 2004, sections 5.3 and 10.2):

    fold             dE / ds, where two orbits of one energy meet
    period doubling  prod (1 + mu_i)
    torus            prod (1 - mu_i mu_j) over the pairs i < j, where the pair that crosses is complex

References
----------
Yu. A. Kuznetsov: Elements of Applied Bifurcation Theory. 3rd edition, Springer, 2004.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np

from .orbit_branch import OrbitBranch, solve_between
from .orbits import PeriodicOrbit

FOLD, PERIOD_DOUBLING, TORUS = "fold", "period doubling", "torus"


@dataclass(frozen=True, eq=False)
class OrbitEvent:
    """A bifurcation of periodic orbits: its kind, the orbit, and the index of the last of the branch's before it."""

    kind: str
    orbit: PeriodicOrbit
    place: int


def fold_test(orbit: PeriodicOrbit) -> float:
    """Return the derivative of the energy along the branch [J]."""
    return orbit.energy_slope


def period_doubling_test(orbit: PeriodicOrbit) -> float:
    """Return a number that changes sign where a multiplier passes -1."""
    return float(np.prod(1 + orbit.multipliers[2:]).real)


def torus_test(orbit: PeriodicOrbit) -> float:
    """Return a number that changes sign where two multipliers pass a product of 1."""
    return float(np.prod([1 - a * b for a, b in combinations(orbit.multipliers[2:], 2)]).real)


_TESTS: dict[str, Callable[[PeriodicOrbit], float]] = {
    FOLD: fold_test,
    PERIOD_DOUBLING: period_doubling_test,
    TORUS: torus_test,
}


def find_events(branch: OrbitBranch) -> list[OrbitEvent]:
    """Find the bifurcations along a branch, each solved to round-off of the distance along it."""
    return sorted(_find_all(branch), key=lambda event: event.place)


def _find_all(branch: OrbitBranch) -> Iterator[OrbitEvent]:
    for place, (first, second) in enumerate(pairwise(branch.orbits)):
        for kind, test in _TESTS.items():
            if test(first) * test(second) < 0:
                orbit = solve_between(branch, place, test)
                if orbit is not None and (kind != TORUS or _crosses_as_pair(orbit)):
                    yield OrbitEvent(kind, orbit, place)


def _crosses_as_pair(orbit: PeriodicOrbit) -> bool:
    """Return whether the two multipliers whose product is nearest to 1 are complex: real ones do not bifurcate."""
    a, _ = min(combinations(orbit.multipliers[2:], 2), key=lambda pair: abs(1 - pair[0] * pair[1]))
    return abs(a.imag) > 0
