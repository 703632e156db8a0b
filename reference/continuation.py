"""Pseudo-arclength continuation along a curve of circular motions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from .bicycle import Bicycle
from .circular import CONTACT, Condition, Steady, as_solved, newton, reverse_speeds
from .kernels import curve as kernel
from .kernels.circle import SIGMA_UNIT
from .kernels.steady import UNKNOWNS
from .roots import find_root
from .surface import SurfaceOfRevolution, has_tip

FARTHEST = 1e3  # distance of D from the origin [m]: a larger circle differs from its limit by round-off only
LARGEST_LEAN = 1.5
_LARGEST_SPEED = 60.0  # of a rim [m/s], or 200 rad/s where wheels are large: a curve can lead to infinite speed
LONGEST_STEP = 0.15
_FIRST_STEP = 0.02
_REAR_SIDE = CONTACT.start + 1  # eta of the rear contact; its xi is zero, as the rear wheel heads along its circle
_CHUNK = 32  # points followed in one call of the kernel
# Fraction of the radius where the ground ends. Towards the rim of a sphere, derivatives of the height lose digits in
# proportion to the inverse of the distance, and steps of the arc become very short: a curve ends within a thousandth.
_AT_THE_EDGE = 1e-3
# Value, of order one, below which a condition is fulfilled: round-off, about 1e-14, times the equations' condition.
_FULFILLED = 1e-11


@dataclass(frozen=True)
class Point:
    """A solution on a curve, with the curve's direction there.

    Attributes
    ----------
    unknowns : ndarray, shape (22,)
        See `velodrome.reference.kernels.steady`.
    tangent : ndarray, shape (22,)
        Unit tangent in the arclength's metric.
    """

    unknowns: np.ndarray
    tangent: np.ndarray


def metric(u: np.ndarray) -> np.ndarray:
    """Return the diagonal of the arclength's metric at a point: unknowns that grow without bound count relatively."""
    weights = np.empty(UNKNOWNS)
    kernel.metric(u, weights)
    return weights


def arc_distance(first: Point, point: Point) -> float:
    """Return the distance of a near point from the first, along the curve."""
    return float((metric(first.unknowns) * first.tangent) @ (point.unknowns - first.unknowns))


def tangent(equations: Steady, u: np.ndarray) -> np.ndarray:
    """Return the unit tangent of the curve, in the arclength's metric and of either sign, at a solution `as_solved`."""
    chosen, full, along = u[kernel.CHOSEN], np.empty(UNKNOWNS), np.empty(UNKNOWNS)
    # Rank 8 of 9: the singular vector of the smallest singular value.
    null = np.linalg.svd(equations.expand(chosen).jacobian)[2][-1]
    kernel.unit(chosen, null, *equations.where[1:], full, along)
    return along


def follow_curve(
    equations: Steady, start: np.ndarray, towards: np.ndarray, longest: float = LONGEST_STEP, most: int = 4000
) -> Iterator[Point]:
    """Follow the curve through a solution.

    Parameters
    ----------
    equations : Steady
    start : ndarray, shape (22,)
        A solution.
    towards : ndarray, shape (22,)
        Direction whose scalar product with the first tangent shall be positive.
    longest : float
        Longest step of the arc.
    most : int
        Largest number of points after the start.

    Yields
    ------
    Point
        The start, then points along the curve until it ends: with the first point of sigma < 0, beyond
        the largest lean, circle or speed, at the edge of the ground, before a tip of it, or where the shortest
        steps no longer converge. All of them are `as_solved`.
    """
    if as_solved(start) is not start:
        start, towards = reverse_speeds(start), reverse_speeds(towards)
    direction = tangent(equations, start)
    first = Point(start, direction if direction @ towards > 0 else -direction)
    tip, side = has_tip(equations.surface), start[_REAR_SIDE]
    for point in _follow_steps(equations, first, longest, most):
        # The rear wheel reaches the axis sideways; a tip there has no normal, and no motion can be solved for.
        if tip and side * point.unknowns[_REAR_SIDE] <= 0:
            return
        yield point
        if at_edge(equations.surface, point):
            return


def largest_sigma(bicycle: Bicycle) -> float:
    """Return the unknown sigma at which a curve is ended: a small wheel turns fast at an ordinary speed."""
    smallest = min(bicycle.rear_wheel_radius, bicycle.front_wheel_radius)
    largest_rate = max(200.0, _LARGEST_SPEED / smallest)
    return largest_rate**2 / SIGMA_UNIT


def at_edge(surface: SurfaceOfRevolution, point: Point) -> bool:
    """Return whether a wheel is at the edge of the ground."""
    inner, outer = surface.extent
    if (inner, outer) == (0.0, np.inf):  # no edge to look for
        return False
    contact = np.hypot(point.unknowns[CONTACT][[0, 3]], point.unknowns[CONTACT][[1, 4]])
    return bool(contact.max() > (1 - _AT_THE_EDGE) * outer or contact.min() < (1 + _AT_THE_EDGE) * inner)


def _follow_steps(equations: Steady, first: Point, longest: float, most: int) -> Iterator[Point]:
    """Yield a point and those that follow it, ignoring edges of the ground."""
    yield first
    distance, ended = min(_FIRST_STEP, longest), False
    largest = LARGEST_LEAN, largest_sigma(equations.bicycle), FARTHEST
    while most > 0 and not ended:
        unknowns, tangents = np.empty((2, min(_CHUNK, most) + 1, UNKNOWNS))
        unknowns[0], tangents[0] = first.unknowns, first.tangent
        try:
            filled, distance, ended = kernel.follow(distance, longest, largest, *equations.where, unknowns, tangents)
        except ZeroDivisionError:  # see `Steady.expand`
            return
        points = [Point(*row) for row in zip(unknowns[1:filled], tangents[1:filled], strict=True)]
        yield from points
        first, most = points[-1] if points else first, most - len(points)


def _interpolate_arc(equations: Steady, first: Point, second: Point) -> tuple[Callable[[float], Point], float]:
    """Interpolate the curve between two neighbours.

    Returns a function from the distance along the first one's tangent to the point of the curve there, and the distance
    of the second. Newton's method starts from the cubic through both, which has the curve's bend; a step from one of
    them has not.
    """
    covector = (metric(first.unknowns) * first.tangent)[kernel.CHOSEN]
    start, along, end, onward = (
        row[kernel.CHOSEN] for row in (first.unknowns, first.tangent, second.unknowns, second.tangent)
    )
    length = float(covector @ (end - start) / (covector @ along))
    onward = onward * (covector @ along) / (covector @ onward)
    chord = end - start
    left, right = length * along - chord, chord - length * onward
    points = {0.0: first, length: second}

    def at(distance: float) -> Point:
        if distance not in points:
            share = distance / length
            bend = share * (1 - share) * ((1 - share) * left + share * right)
            points[distance] = _correct_point(equations, start + share * chord + bend, covector)
        return points[distance]

    return at, length


def _correct_point(equations: Steady, guess: np.ndarray, covector: np.ndarray) -> Point:
    """Solve for the point of the curve in the plane through a guess (9,) perpendicular to a covector (9,)."""
    chosen, direction, (unknowns, along) = guess.copy(), np.empty(len(guess)), np.empty((2, UNKNOWNS))
    if not kernel.correct(chosen, covector, *equations.where, direction)[0]:
        raise ValueError("no circular motion is found along the curve")
    kernel.unit(chosen, direction, *equations.where[1:], unknowns, along)
    return Point(unknowns, along)


def root_between(equations: Steady, first: Point, second: Point, function: Callable[[Point], float]) -> Point:
    """Solve function = 0 between two neighbours of a followed curve where it has opposite signs.

    Parameters
    ----------
    equations : Steady
    first, second : Point
        Neighbours, in the order in which they were followed.
    function : callable
        Maps a `Point`, with its tangent in the direction followed, to a number.

    Returns
    -------
    Point
        To round-off of the arc's length.
    """
    at, length = _interpolate_arc(equations, first, second)
    return at(find_root(lambda distance: function(at(distance)), 0.0, length, tolerance=1e-15))


def sign_changes(values: Sequence[float] | np.ndarray, zero: float = 0.0) -> list[tuple[int, int]]:
    """Return the pairs of indices between which a sequence of numbers changes its sign.

    Parameters
    ----------
    values : sequence of float, shape (n,)
    zero : float
        Magnitude up to which a number counts as zero because of round-off. Zeros have no sign and are skipped.

    Returns
    -------
    list of (int, int)
        Indices of opposite signs; only zeros lie between the two.
    """
    numbers = np.asarray(values, float)
    signed = np.flatnonzero(np.abs(numbers) > zero)
    turns = np.flatnonzero(np.diff(numbers[signed] > 0))
    return [(int(signed[k]), int(signed[k + 1])) for k in turns]


def roots_along(
    equations: Steady,
    points: Sequence[Point],
    function: Callable[[Point], float],
    values: Sequence[float] | np.ndarray | None = None,
    zero: float = 0.0,
) -> Iterator[tuple[int, Point]]:
    """Yield the points at which a function changes its sign along a followed curve.

    Parameters
    ----------
    equations : Steady
    points : sequence of Point, length n
        In the order followed.
    function : callable
        Maps a `Point`, with its tangent in the direction followed, to a number.
    values : sequence of float, shape (n,), optional
        Values of the function at the points, where they are known already.
    zero : float
        See `sign_changes`.

    Yields
    ------
    place : int
        Index of the last of the points before the root.
    root : Point
        Accurate to round-off of the arc's length; one of the points where the function is zero there.
    """
    numbers = [function(point) for point in points] if values is None else values
    for i, j in sign_changes(numbers, zero):
        yield i, points[(i + j) // 2] if j > i + 1 else root_between(equations, points[i], points[j], function)


def crossings(
    equations: Steady, points: Iterable[Point], condition: Callable[[np.ndarray], Condition]
) -> Iterator[np.ndarray]:
    """Yield the solutions on a followed curve that fulfil a condition.

    Between two neighbours there may be two solutions, one on either side of an extremum of the condition's value along
    the curve. The extremum is solved for first.

    Parameters
    ----------
    equations : Steady
    points : iterable of Point
        In the order followed.
    condition : callable
        Maps unknowns to a `velodrome.reference.circular.Condition` of order one.

    Yields
    ------
    ndarray, shape (22,)
        In the order along the curve.
    """

    def slope(point: Point) -> float:
        return float(condition(point.unknowns).gradient @ point.tangent)

    last = None
    for first, second in pairwise(points):
        nodes = [first.unknowns, second.unknowns]
        if slope(first) * slope(second) < 0:
            nodes.insert(1, root_between(equations, first, second, slope).unknowns)
        for a, b in pairwise(nodes):
            fa, fb = condition(a).value, condition(b).value
            if abs(fa) < _FULFILLED:
                yield _refine(equations, a, condition)
            elif fa * fb < 0 and abs(fb) >= _FULFILLED:
                yield newton(equations, a + (b - a) * fa / (fa - fb), condition, most=30)[0]
        last = second
    if last is not None and abs(condition(last.unknowns).value) < _FULFILLED:
        yield _refine(equations, last.unknowns, condition)


def _refine(equations: Steady, unknowns: np.ndarray, condition: Callable[[np.ndarray], Condition]) -> np.ndarray:
    """Return the solution next to one (22,) that fulfils a condition but for round-off.

    Newton's method has no step where the condition has no slope, as the squared rear rate at the pivoting motion. What
    is solved for there may have a rear speed of exactly zero, or one that is round-off.
    """
    if not condition(unknowns).gradient.any():
        return unknowns
    return newton(equations, unknowns, condition, most=30)[0]


def least_between(equations: Steady, first: Point, second: Point, function: Callable[[Point], float]) -> Point:
    """Find the minimum of a function between two near points of a followed curve, to about 1e-6 of their distance."""
    from scipy.optimize import minimize_scalar  # takes half a second

    at, length = _interpolate_arc(equations, first, second)
    found: Any = minimize_scalar(
        lambda distance: function(at(distance)),
        bounds=(0.0, length),
        method="bounded",
        options={"xatol": 1e-6 * length},
    )
    return at(float(found.x))
