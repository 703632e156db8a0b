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
from ..sections import stable_sections
from ..surface import Paraboloid
from .hopf import HopfPoint, examine_end, section_hopf_points

# Coefficient at a root, relative to those between which it was searched for. Where it passes zero it is round-off of
# 1e-11 or so there; where it jumps, as from one pair of eigenvalues to another, it stays of their order.
_VANISHED = 1e-6


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

    Raises
    ------
    ValueError
        See `solve_bautin`.
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
        if changes_criticality(before, after):
            yield solve_bautin(bicycle, number, k, (low[0], before), (high[0], after))


def changes_criticality(before: HopfPoint, after: HopfPoint) -> bool:
    """Return whether the first Lyapunov coefficients of two Hopf points have opposite signs."""
    return _cubic(before) * _cubic(after) < 0


def solve_bautin(
    bicycle: Bicycle, number: int, place: int, low: tuple[float, HopfPoint], high: tuple[float, HopfPoint]
) -> BautinPoint:
    """Solve for the degenerate Hopf point between two shapes of the bowl.

    Parameters
    ----------
    bicycle : Bicycle
    number : int
        Of the family.
    place : int
        Index of the end among the Hopf points at the ends of the family's stable sections.
    low, high : tuple of float and HopfPoint
        Two shapes of the bowl [1/m] with this end, whose first Lyapunov coefficients have opposite signs.

    Returns
    -------
    BautinPoint

    Raises
    ------
    ValueError
        If the end is lost between the two, or the coefficient changes its sign without being zero.
    """
    known = dict([low, high])

    def value(alpha: float) -> float:
        if alpha not in known:
            family = trace(bicycle, Paraboloid(alpha), number)
            ends = [end for ends in stable_sections(family) for end in ends if end.cause == "hopf"]
            if place >= len(ends):
                raise ValueError(f"a stable section of family {number} is lost at alpha = {alpha:.6g}")
            known[alpha] = examine_end(family, ends[place])
        return _cubic(known[alpha])

    root = find_root(value, low[0], high[0], tolerance=1e-14)
    if abs(value(root)) > _VANISHED * max(abs(_cubic(low[1])), abs(_cubic(high[1]))):
        raise ValueError(
            f"the first Lyapunov coefficient changes its sign at alpha = {root:.9g} without being zero: it has a pole, "
            "or another pair of eigenvalues crosses beyond"
        )
    return BautinPoint(number, root, known[root])


def _cubic(point: HopfPoint) -> float:
    """Return the first Lyapunov coefficient; zero where there is no normal form."""
    return point.first_lyapunov_coefficient or 0.0
