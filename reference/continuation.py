"""Pseudo-arclength continuation along a curve of circular motions."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from .circular import Steady
from .kernels import curve as kernel
from .kernels.steady import UNKNOWNS

FARTHEST = 1e3  # of D from the origin [m]: beyond, a large circle differs from its limit by round-off
LARGEST_LEAN = 1.5
LARGEST_SIGMA = 100.0  # 200 rad/s: a curve can run off to infinite speed at finite angles
LONGEST_STEP = 0.15
_FIRST_STEP = 0.02
_CHUNK = 32  # points that are followed at once


@dataclass(frozen=True)
class Point:
    """A solution on a curve, with the curve's direction there.

    Attributes
    ----------
    unknowns : ndarray, shape (22,)
        See `reference.kernels.steady`.
    tangent : ndarray, shape (22,)
        Of unit length in the arclength's metric.
    """

    unknowns: np.ndarray
    tangent: np.ndarray


def metric(u: np.ndarray) -> np.ndarray:
    """Diagonal of the arclength's metric at a point: unknowns that grow without bound count relatively."""
    weights = np.empty(UNKNOWNS)
    kernel.metric(u, weights)
    return weights


def tangent(equations: Steady, u: np.ndarray) -> np.ndarray:
    """Direction of the curve, of unit length in the arclength's metric, of either sign."""
    chosen, full, along = u[kernel.CHOSEN], np.empty(UNKNOWNS), np.empty(UNKNOWNS)
    # Rank 8 of 9: the singular vector of the smallest singular value.
    null = np.linalg.svd(equations.expand(chosen).jacobian)[2][-1]
    kernel.unit(chosen, null, *equations.where[1:], full, along)
    return along


def follow(
    equations: Steady, start: np.ndarray, towards: np.ndarray, longest: float = LONGEST_STEP, most: int = 4000
) -> Iterator[Point]:
    """Follow the curve through a solution.

    Parameters
    ----------
    equations : Steady
    start : ndarray, shape (22,)
        A solution.
    towards : ndarray, shape (22,)
        Direction whose scalar product with the first tangent is to be positive.
    longest : float
        Longest step of the arc.
    most : int
        Number of points at the most.

    Yields
    ------
    Point
        The start, then points along the curve, until it ends: with the first point of sigma < 0, beyond
        the largest lean, circle or speed, or where the shortest steps no longer converge.
    """
    direction = tangent(equations, start)
    first = Point(start, direction if direction @ towards > 0 else -direction)
    yield first
    distance, ended, largest = min(_FIRST_STEP, longest), False, (LARGEST_LEAN, LARGEST_SIGMA, FARTHEST)
    while most > 0 and not ended:
        unknowns, tangents = np.empty((2, min(_CHUNK, most) + 1, UNKNOWNS))
        unknowns[0], tangents[0] = first.unknowns, first.tangent
        filled, distance, ended = kernel.follow(distance, longest, largest, *equations.where, unknowns, tangents)
        points = [Point(*row) for row in zip(unknowns[1:filled], tangents[1:filled], strict=True)]
        yield from points
        first, most = points[-1] if points else first, most - len(points)


def _stepped(equations: Steady, first: Point, distance: float) -> Point:
    """Point of the curve at a distance along another's tangent.

    Raises
    ------
    ValueError
        If the step does not converge.
    """
    unknowns, along = np.empty((2, UNKNOWNS))
    if not kernel.step(first.unknowns, first.tangent, distance, *equations.where, unknowns, along)[0]:
        raise ValueError("no circular motion is found along the curve")
    return Point(unknowns, along)


def _arc(equations: Steady, first: Point, second: Point) -> tuple[Callable[[float], Point], float]:
    """Points of the curve by their distance along the first one's tangent, and the second one's distance."""
    covector = (metric(first.unknowns) * first.tangent)[kernel.CHOSEN]
    along, change = first.tangent[kernel.CHOSEN], (second.unknowns - first.unknowns)[kernel.CHOSEN]
    length = float(covector @ change / (covector @ along))
    points = {0.0: first, length: second}

    def at(distance: float) -> Point:
        if distance not in points:
            points[distance] = _stepped(equations, first, distance)
        return points[distance]

    return at, length


def root_between(equations: Steady, first: Point, second: Point, function: Callable[[Point], float]) -> Point:
    """Solve function = 0 between two neighbours of a followed curve where it has opposite signs.

    Parameters
    ----------
    equations : Steady
    first, second : Point
        Neighbours, in the order in which they were followed.
    function : callable
        Maps a `Point`, its tangent in the direction followed, to a number.

    Returns
    -------
    Point
        To round-off of the arc's length.
    """
    at, length = _arc(equations, first, second)
    root: Any = brentq(lambda distance: function(at(distance)), 0.0, length, xtol=1e-15)
    return at(root)


def least_between(equations: Steady, first: Point, second: Point, function: Callable[[Point], float]) -> Point:
    """Find where a function is least between two near points of a followed curve, to some 1e-6 of their distance."""
    at, length = _arc(equations, first, second)
    found: Any = minimize_scalar(
        lambda distance: function(at(distance)),
        bounds=(0.0, length),
        method="bounded",
        options={"xatol": 1e-6 * length},
    )
    return at(float(found.x))
