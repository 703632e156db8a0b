"""Solution families: curves of circular motions, reached from the paper's named points.

Random starts land on spurious roots, and the families reconnect as alpha grows. So every family is
a curve with an *anchor*: a named point on the level plane, carried to the wanted alpha by
continuation; from there the curve is followed by pseudo-arclength.

=======  ===================  ==========================================================
family   anchor               followed towards
=======  ===================  ==========================================================
1        A, static            growing rear rate, to B
2        D's branch at a      both ends: E (the lean grows) and, through the cusp, C
         rear rate of 20
3        G, pivoting          the forward-rolling rear wheel with the steer falling, to F
4        H = G, run backward  the reversed front wheel, through the cusp I
=======  ===================  ==========================================================
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from .bicycle import Bicycle
from .circular import (
    CONTACT,
    FORCE,
    LEAN,
    REAR_SPEED,
    SIGMA,
    STEER,
    CircularMotion,
    Steady,
    nearest_condition,
    newton,
    plane_condition,
    rear_rate_condition,
    unknown_condition,
)
from .kernels import dynamics as kernel
from .kernels.steady import UNKNOWNS
from .kinematics import constants
from .surface import Paraboloid

FAMILIES = (1, 2, 3, 4)

# (lean, steer) of A, D and G on the level plane, as printed (Xiong et al. 2020, section 3.2).
_POINT_A, _POINT_D, _POINT_G = (0.0, 1.33973991149), (0.62, 2.78), (-0.01206, 1.6019)
_ANCHOR_REAR_RATE = 20.0
_LARGEST_RADIUS = 1e3
_LARGEST_LEAN = 1.5
_LARGEST_SIGMA = 100.0  # 200 rad/s: a curve can run off to infinite speed at finite angles


def _metric(u: np.ndarray) -> np.ndarray:
    """Diagonal of the arclength's metric at a point: unknowns that grow without bound count relatively."""
    reach = 0.3 / (1 + 0.3 * np.hypot(u[0], u[1]))
    scale = np.ones(UNKNOWNS)
    scale[[0, 1, 10, 11, 13, 14]] = reach
    scale[2] = 1 / (1 + abs(u[2]))
    scale[SIGMA] = 1 / (1 + abs(u[SIGMA]))
    scale[FORCE] = 1 / (1 + np.abs(u[FORCE]).max())
    return scale**2


@dataclass(frozen=True)
class Point:
    """A solution on a curve with the curve's direction there."""

    unknowns: np.ndarray
    tangent: np.ndarray


def start_on_plane(bicycle: Bicycle, lean: float, steer: float) -> np.ndarray:
    """Guess of the 22 unknowns on the level plane from two angles alone.

    At fixed lean and steer the bicycle can roll in exactly one circle: the null vector of the rolling
    rows gives the directions of all speeds and the circle's centre. The speed and the forces then fit
    the equations of motion best in the least-squares sense.

    Parameters
    ----------
    bicycle : Bicycle
    lean, steer : float
        Angles [rad].

    Returns
    -------
    ndarray, shape (22,)

    Raises
    ------
    ValueError
        If the wheels cannot both touch the plane at these angles.
    """
    surface, c = Paraboloid(0.0), constants(bicycle)
    function, parameters = surface.function.real, surface.parameters
    q, p = np.zeros(9), np.empty(6)
    q[[2, 4, 6]] = bicycle.front_wheel_radius * np.cos(lean), lean, steer
    kernel.guess_contacts(q, p, function, parameters, c)
    if not kernel.settle(q, p, function, parameters, c):
        raise ValueError(f"both wheels cannot touch the plane at lean = {lean!r}, steer = {steer!r}")
    rows = np.empty((6, 9))
    kernel.rolling(q, np.zeros(9), p, function, parameters, c, rows, np.empty(6), np.empty(6))
    speeds = np.linalg.svd(rows[:, [0, 1, 2, 3, 7, 8]])[2][-1]
    speeds = speeds / np.linalg.norm(speeds[3:])
    centre = np.array([speeds[1], -speeds[0]]) / speeds[3]
    u = np.zeros(UNKNOWNS)
    u[:6] = *centre, q[2], lean, q[5], steer
    u[6:9] = speeds[3:]
    u[CONTACT] = p + np.array([*centre, 0, *centre, 0])
    equations, linear = Steady(bicycle, surface), [SIGMA, *range(16, 22)]
    u[linear] = np.linalg.lstsq(equations.jacobian(u)[:9, linear], -equations.residual(u)[:9], rcond=None)[0]
    return u


def follow(equations: Steady, start: np.ndarray, towards: np.ndarray, most: int = 4000) -> Iterator[Point]:
    """Pseudo-arclength continuation along the curve through a solution.

    Parameters
    ----------
    equations : Steady
    start : ndarray, shape (22,)
        A solution.
    towards : ndarray, shape (22,)
        Direction whose scalar product with the first tangent is to be positive.
    most : int
        Number of points at the most.

    Yields
    ------
    Point
        The start, then points along the curve, until its physical end (sigma < 0, the lean near
        +-pi/2, a very large circle) or until steps of 1e-6 no longer converge.
    """
    u, distance = start, 0.02
    tangent = _tangent(equations, u)
    tangent = tangent if tangent @ towards > 0 else -tangent
    yield Point(u, tangent)
    for _ in range(most):
        while (step := _step(equations, Point(u, tangent), distance)) is None:
            distance /= 2
            if distance < 1e-6:
                return
        (u, tangent), iterations = (step[0].unknowns, step[0].tangent), step[1]
        distance = min(0.15, distance * (1.4 if iterations <= 4 else 0.8))
        if not -1e-9 < u[SIGMA] < _LARGEST_SIGMA or abs(u[LEAN]) > _LARGEST_LEAN:
            return
        if np.hypot(u[0], u[1]) > _LARGEST_RADIUS:
            return
        yield Point(u, tangent)


def _step(equations: Steady, point: Point, distance: float) -> tuple[Point, int] | None:
    """One step along the arc and the iterations it took; None where it fails or turns too sharply."""
    covector = _metric(point.unknowns) * point.tangent
    guess = point.unknowns + distance * point.tangent
    try:
        u, iterations = newton(equations, guess, plane_condition(point.unknowns, covector, distance), most=7)
    except ValueError:
        return None
    tangent = _tangent(equations, u)
    turn = float(tangent @ covector)
    # A sharp turn means that the step jumped to another branch or over a bend.
    return (Point(u, tangent * np.sign(turn)), iterations) if abs(turn) > 0.9 else None


def _tangent(equations: Steady, u: np.ndarray) -> np.ndarray:
    """Null vector of the Jacobian, of unit length in the arclength's metric."""
    # Rank 21 of 22: the singular vector of the smallest singular value.
    null = np.linalg.svd(equations.jacobian(u))[2][-1]
    return null / np.sqrt(null @ (_metric(u) * null))


def _carry(bicycle: Bicycle, u: np.ndarray, alpha: float, condition: Callable) -> np.ndarray:
    """Carry a solution from the level plane to alpha at a fixed condition, with steps as long as converge."""
    reached, step = 0.0, min(alpha, 0.01)
    while reached < alpha:
        wanted = min(alpha, reached + step)
        try:
            u, iterations = newton(Steady(bicycle, Paraboloid(wanted)), u, condition, most=8)
        except ValueError:
            step /= 2
            if step < 1e-7:
                raise ValueError(f"the family's named point cannot be followed beyond alpha = {reached:.6g}") from None
        else:
            reached, step = wanted, step * (1.5 if iterations <= 5 else 1.0)
    return u


def _squared_rear_rate_slope(point: Point) -> float:
    """Derivative of sigma b^2 along the curve; zero at a fold in the rear rate."""
    u, t = point.unknowns, point.tangent
    return t[SIGMA] * u[REAR_SPEED] ** 2 + 2 * u[SIGMA] * u[REAR_SPEED] * t[REAR_SPEED]


def anchors(bicycle: Bicycle, alpha: float, family: int) -> tuple[Steady, np.ndarray, list[np.ndarray]]:
    """Anchor of a family at alpha and the directions in which its curve runs.

    Returns
    -------
    equations : Steady
    unknowns : ndarray, shape (22,)
    directions : list of ndarray, shape (22,)

    Raises
    ------
    ValueError
        If this bicycle has no such point.
    """
    level = Steady(bicycle, Paraboloid(0.0))
    axis = np.eye(UNKNOWNS)
    if family == 1:
        condition = unknown_condition(SIGMA, 0.0)
        u, _ = newton(level, start_on_plane(bicycle, *_POINT_A), condition, most=30)
        directions = [axis[SIGMA]]
    elif family == 2:
        u, _ = newton(level, start_on_plane(bicycle, *_POINT_D), nearest_condition(), most=30)
        points = follow(level, u, axis[LEAN])
        crossing = next(_crossings(level, points, _ANCHOR_REAR_RATE), None)
        if crossing is None:
            raise ValueError("family 2 of this bicycle does not reach its anchor")
        u, condition = crossing, rear_rate_condition(_ANCHOR_REAR_RATE)
        directions = [axis[LEAN], -axis[LEAN]]
    else:
        condition = unknown_condition(REAR_SPEED, 0.0)
        u, _ = newton(level, start_on_plane(bicycle, *_POINT_G), condition, most=30)
        directions = [-axis[STEER] if family == 3 else axis[STEER]]
    return Steady(bicycle, Paraboloid(alpha)), _carry(bicycle, u, alpha, condition), directions


def _crossings(equations: Steady, points: Iterator[Point], rear_rate: float) -> Iterator[np.ndarray]:
    """Solutions of a given rear rate on a followed curve, in the order met."""
    condition = rear_rate_condition(rear_rate)
    for first, second in pairwise(points):
        nodes = [first.unknowns, second.unknowns]
        if _squared_rear_rate_slope(first) * _squared_rear_rate_slope(second) < 0:
            nodes.insert(1, _fold(equations, first, second))
        for a, b in pairwise(nodes):
            fa, fb = condition(a).value, condition(b).value
            if fa == 0 or fa * fb < 0:
                yield newton(equations, a + (b - a) * fa / (fa - fb), condition, most=30)[0]


def _fold(equations: Steady, first: Point, second: Point) -> np.ndarray:
    """Point between two others where the rear rate is extreme, by bisection on the slope along the arc."""
    covector = _metric(first.unknowns) * first.tangent
    low, high, u = 0.0, float(covector @ (second.unknowns - first.unknowns)), first.unknowns
    # The extreme value is quadratic in the position: half the digits of the arc give all of the rate's.
    while high - low > 1e-8:
        middle = 0.5 * (low + high)
        guess = first.unknowns + middle * first.tangent
        u, _ = newton(equations, guess, plane_condition(first.unknowns, covector, middle))
        tangent = _tangent(equations, u)
        point = Point(u, tangent * np.sign(tangent @ covector))
        if _squared_rear_rate_slope(point) * _squared_rear_rate_slope(first) > 0:
            low = middle
        else:
            high = middle
    return u


def motions(bicycle: Bicycle, alpha: float, family: int, rear_rate: float) -> list[CircularMotion]:
    """All motions of a family at a rear-wheel rate, nearest to the family's anchor first.

    Parameters
    ----------
    bicycle : Bicycle
    alpha : float
        Shape of the paraboloid [1/m].
    family : int
        1 to 4.
    rear_rate : float
        Positive [rad/s].

    Returns
    -------
    list of CircularMotion
        Empty where the family has none.

    Raises
    ------
    ValueError
        If the family's anchor cannot be reached at this alpha.
    """
    equations, anchor, directions = anchors(bicycle, alpha, family)
    found = []
    for direction in directions:
        for u in _crossings(equations, follow(equations, anchor, direction), rear_rate):
            motion = equations.motion(u)
            if not any(np.hypot(motion.lean - m.lean, motion.steer - m.steer) < 1e-7 for m in found):
                found.append(motion)
    return found


def find_motion(
    bicycle: Bicycle,
    alpha: float,
    rear_rate: float,
    family: int | None = None,
    near: tuple[float, float] | None = None,
) -> tuple[int, CircularMotion]:
    """One circular motion by its family, by the angles it is near to, or by both.

    Parameters
    ----------
    bicycle : Bicycle
    alpha : float
        Shape of the paraboloid [1/m].
    rear_rate : float
        Rear-wheel rate, positive [rad/s].
    family : int, optional
        1 to 4. Where the family has several solutions and ``near`` is not given, the one nearest to the
        family's anchor along the curve.
    near : tuple of float, optional
        Lean and steer [rad]; of all solutions (of the family, if given) the nearest is taken.

    Returns
    -------
    family : int
    motion : CircularMotion

    Raises
    ------
    ValueError
        If there is no such motion, or the input is not one.
    """
    if not (np.isfinite(rear_rate) and rear_rate > 0):
        raise ValueError(f"rear rate is {rear_rate!r}; it must be a positive number of rad/s")
    if family is None and near is None:
        raise ValueError("a circular motion needs a family (1 to 4) or the lean and steer that it is near to")
    if family is not None and family not in FAMILIES:
        raise ValueError(f"family is {family!r}; it must be 1, 2, 3 or 4")
    if near is not None and not np.all(np.isfinite(near)):
        raise ValueError(f"near is {near!r}; it must be two finite angles, lean and steer in rad")
    found, failures = [], []
    for number in FAMILIES if family is None else (family,):
        try:
            found += [(number, motion) for motion in motions(bicycle, alpha, number, rear_rate)]
        except ValueError as error:
            failures.append(f"family {number}: {error}")
    if not found:
        reason = "; ".join(failures) or "the curve does not reach that rear rate"
        where = f"family {family}" if family is not None else "any family"
        wanted = f"rear rate {rear_rate!r} rad/s at alpha = {alpha!r} in {where}"
        raise ValueError(f"no circular motion with {wanted}: {reason}")
    if near is None:
        return found[0]
    return min(found, key=lambda item: np.hypot(item[1].lean - near[0], item[1].steer - near[1]))
