"""Pseudo-arclength continuation along a curve of circular motions."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from .circular import FORCE, LEAN, SIGMA, Steady, newton, plane_condition
from .kernels.steady import UNKNOWNS

FARTHEST = 1e3  # of D from the origin [m]: beyond, a large circle differs from its limit by round-off
LARGEST_LEAN = 1.5
LARGEST_SIGMA = 100.0  # 200 rad/s: a curve can run off to infinite speed at finite angles
LONGEST_STEP, SHORTEST_STEP = 0.15, 1e-6


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
    reach = 0.3 / (1 + 0.3 * np.hypot(u[0], u[1]))
    scale = np.ones(UNKNOWNS)
    scale[[0, 1, 10, 11, 13, 14]] = reach
    scale[2] = 1 / (1 + abs(u[2]))
    scale[SIGMA] = 1 / (1 + abs(u[SIGMA]))
    scale[FORCE] = 1 / (1 + np.abs(u[FORCE]).max())
    return scale**2


def tangent(equations: Steady, u: np.ndarray) -> np.ndarray:
    """Null vector of the Jacobian, of unit length in the arclength's metric, of either sign."""
    # Rank 21 of 22: the singular vector of the smallest singular value.
    null = np.linalg.svd(equations.jacobian(u))[2][-1]
    return null / np.sqrt(null @ (metric(u) * null))


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
    u, distance = start, 0.02
    direction = tangent(equations, u)
    direction = direction if direction @ towards > 0 else -direction
    yield Point(u, direction)
    for _ in range(most):
        while (step := _step(equations, Point(u, direction), distance)) is None:
            distance /= 2
            if distance < SHORTEST_STEP:
                return
        (u, direction), iterations = (step[0].unknowns, step[0].tangent), step[1]
        distance = min(longest, distance * (1.4 if iterations <= 4 else 0.8))
        yield Point(u, direction)
        if not 0 <= u[SIGMA] < LARGEST_SIGMA or abs(u[LEAN]) > LARGEST_LEAN or np.linalg.norm(u[:3]) > FARTHEST:
            return


def _step(equations: Steady, point: Point, distance: float) -> tuple[Point, int] | None:
    """One step along the arc and the iterations it took; None where it fails or turns too sharply."""
    covector = metric(point.unknowns) * point.tangent
    guess = point.unknowns + distance * point.tangent
    try:
        u, iterations = newton(equations, guess, plane_condition(point.unknowns, covector, distance), most=7)
    except ValueError:
        return None
    direction = tangent(equations, u)
    turn = float(direction @ covector)
    # A sharp turn means that the step jumped to another branch or over a bend.
    return (Point(u, direction * np.sign(turn)), iterations) if abs(turn) > 0.9 else None


def _arc(equations: Steady, first: Point, second: Point) -> tuple[Callable[[float], Point], float]:
    """Points of the curve by their distance along the first one's tangent, and the second one's distance."""
    covector = metric(first.unknowns) * first.tangent
    length = float(covector @ (second.unknowns - first.unknowns))
    points = {0.0: first, length: second}

    def at(distance: float) -> Point:
        if distance not in points:
            guess = first.unknowns + distance * first.tangent
            u, _ = newton(equations, guess, plane_condition(first.unknowns, covector, distance))
            direction = tangent(equations, u)
            points[distance] = Point(u, direction * np.sign(direction @ covector))
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
