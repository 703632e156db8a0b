"""Degenerate Hopf points: shapes of the bowl at which the criticality of a stable section's end changes.

There the first Lyapunov coefficient on the level set of energy is zero (a Bautin or generalised Hopf point, Kuznetsov
2004, section 8.3): orbits of one energy appear in pairs next to it, of which one is stable.

References
----------
Yu. A. Kuznetsov: Elements of Applied Bifurcation Theory. 3rd edition, Springer, 2004.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from ..bicycle import Bicycle
from ..families import trace
from ..roots import find_root
from ..surface import Paraboloid
from .hopf import HopfPoint, section_hopf_points


@dataclass(frozen=True, eq=False)
class BautinPoint:
    """A shape of the bowl at which a stable section's end is neither sub- nor supercritical.

    Attributes
    ----------
    number : int
        Of the family.
    alpha : float
        Shape of the bowl [1/m].
    point : HopfPoint
        There, with a first Lyapunov coefficient that is zero but for round-off.
    """

    number: int
    alpha: float
    point: HopfPoint


def find_bautin_points(bicycle: Bicycle, number: int, alphas: Sequence[float]) -> list[BautinPoint]:
    """Find the degenerate Hopf points at the ends of a family's stable sections over the shape of the bowl.

    Parameters
    ----------
    bicycle : Bicycle
    number : int
        Of the family, 1 to 4.
    alphas : sequence of float
        Rising shapes of the bowl, on the paraboloid [1/m], as close as changes of sign shall be found.

    Returns
    -------
    list of BautinPoint
        In the order of alpha.
    """
    found = []
    points = [section_hopf_points(trace(bicycle, Paraboloid(alpha), number)) for alpha in alphas]
    for (low, before), (high, after) in pairwise(zip(alphas, points, strict=True)):
        if len(before) == len(after):  # otherwise a section has appeared or vanished
            found += list(_find_between(bicycle, number, (low, before), (high, after)))
    return found


def _find_between(
    bicycle: Bicycle, number: int, low: tuple[float, list[HopfPoint]], high: tuple[float, list[HopfPoint]]
) -> Iterator[BautinPoint]:
    """Yield the points where coefficients of the same ends have opposite signs at two shapes of the bowl."""
    for k, (before, after) in enumerate(zip(low[1], high[1], strict=True)):
        if _cubic(before) * _cubic(after) >= 0:
            continue
        known = {low[0]: before, high[0]: after}

        def value(alpha: float, k: int = k, known: dict[float, HopfPoint] = known) -> float:
            if alpha not in known:
                known[alpha] = section_hopf_points(trace(bicycle, Paraboloid(alpha), number))[k]
            return _cubic(known[alpha])

        root = find_root(value, low[0], high[0], tolerance=1e-14)
        yield BautinPoint(number, root, known[root])


def _cubic(point: HopfPoint) -> float:
    """Return the first Lyapunov coefficient; zero where there is no normal form."""
    return point.first_lyapunov_coefficient or 0.0
