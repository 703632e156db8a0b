"""Solution families: curves of circular motions, reached from the paper's named points.

Random starts land on spurious roots, and the families reconnect as a bowl deepens. So every family is
a curve with an *anchor*: a point of the benchmark bicycle on the level plane, reached from a named
one, carried by continuation to the wanted bicycle and surface; from there the curve is followed by
pseudo-arclength. Where families have joined or exchanged parts, an anchor stays on its part: family 3
has two, since its part of forward circles joins family 1 on steep bowls (paraboloids from alpha = 0.384).
Where an anchor cannot be carried, as into a trough that has no ground for so small a circle, its family
starts on the circle half-way between the edges of the ground.

=======  =====================================  ============================================
family   anchor                                 followed towards
=======  =====================================  ============================================
1        on the curve from A (static), at a     both ends: A and B on small curvature
         rear rate of 15
2        on the curve from D, away from its     both ends: E and, through the cusp D, C on
         cusp, at a rear rate of 20             small curvature
3        on the curve from G to F, at a rear    both ends; the steer falling, to F
         rate of 20; and G, pivoting
4        H = G                                  the steer growing, through the cusp I
=======  =====================================  ============================================
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from functools import cache
from itertools import pairwise

import numpy as np

from .bicycle import Bicycle
from .circular import (
    CONTACT,
    FRONT_SPEED,
    LEAN,
    REAR_SPEED,
    SIGMA,
    STEER,
    CircularMotion,
    Condition,
    Steady,
    nearest_condition,
    newton,
    rear_rate_condition,
    unknown_condition,
)
from .continuation import FARTHEST, LONGEST_STEP, Point, follow, root_between
from .kernels import dynamics as kernel
from .kernels.steady import UNKNOWNS
from .kinematics import constants
from .surface import Plane, SurfaceOfRevolution, is_level

FAMILIES = (1, 2, 3, 4)

# (lean, steer) of A, D and G on the level plane, as printed (Xiong et al. 2020, section 3.2).
_POINT_A, _POINT_D, _POINT_G = (0.0, 1.33973991149), (0.62, 2.78), (-0.01206, 1.6019)
# Rear rates of each family's anchors; None is the pivoting motion. The last one's curve is the family's.
ANCHORS: dict[int, tuple[float | None, ...]] = {1: (15.0,), 2: (20.0,), 3: (20.0, None), 4: (None,)}
_LARGEST_MOVE = 0.05  # of an unknown of order one, in a step of carrying an anchor
# Of the radius where the ground ends. Towards the rim of a sphere derivatives of the height lose digits like
# the inverse of the distance, and steps of the arc can only creep: within a thousandth a curve is at its end.
_AT_THE_EDGE = 1e-3
_NEAR_ENOUGH = 0.2  # rad: a motion further from what was asked for is another one


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
    surface, c = Plane(), constants(bicycle)
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


def _carry(
    path: Callable[[float], Steady], u: np.ndarray, condition: Callable, what: str, step: float = 0.02
) -> np.ndarray:
    """Carry a solution along a path of equations, 0 to 1, at a fixed condition; steps as long as converge.

    Newton's method may well converge to another branch: a step that moves an angle or a speed by much
    more than a step should is taken again, shorter.
    """
    reached = 0.0
    while reached < 1:
        wanted = min(1.0, reached + step)
        carried = _step_on(path(wanted), u, condition)
        if carried is None:
            step /= 2
            if step < 1e-6:
                raise ValueError(f"its anchor is lost {100 * reached:.4g} % of the way to {what}")
            continue
        (u, iterations), reached = carried, wanted
        step *= 1.5 if iterations <= 5 else 1.0
    if u[SIGMA] < 0:
        raise ValueError(f"its anchor is no motion at {what}: the squared speed would be negative")
    return u


def _step_on(equations: Steady, u: np.ndarray, condition: Callable) -> tuple[np.ndarray, int] | None:
    """Solution of neighbouring equations and the iterations it took; None where it fails or jumps."""
    try:
        new, iterations = newton(equations, u, condition, most=8)
    except ValueError:
        return None
    moved = np.abs(new - u)[LEAN : SIGMA + 1] / (1 + np.abs(u[LEAN : SIGMA + 1]))
    return (new, iterations) if moved.max() <= _LARGEST_MOVE else None


def _between(bicycle: Bicycle, fraction: float) -> Bicycle:
    """Bicycle between the benchmark and another; rigid bodies stay so, since their inertias are a convex set."""
    one, other = asdict(Bicycle()), asdict(bicycle)
    return Bicycle(**{name: (1 - fraction) * one[name] + fraction * other[name] for name in one})


@cache
def _on_the_plane(family: int, rear_rate: float | None) -> np.ndarray:
    """The benchmark's anchor on the level plane, from the paper's named points."""
    level = Steady(Bicycle(), Plane())
    if rear_rate is None or family == 3:
        start, _ = newton(level, start_on_plane(level.bicycle, *_POINT_G), unknown_condition(REAR_SPEED, 0.0), most=30)
        towards = -np.eye(UNKNOWNS)[STEER]
    elif family == 1:
        start, _ = newton(level, start_on_plane(level.bicycle, *_POINT_A), unknown_condition(SIGMA, 0.0), most=30)
        towards = np.eye(UNKNOWNS)[SIGMA]
    else:
        start, _ = newton(level, start_on_plane(level.bicycle, *_POINT_D), nearest_condition(), most=30)
        towards = np.eye(UNKNOWNS)[LEAN]
    return start if rear_rate is None else next(_crossings(level, follow(level, start, towards), rear_rate))


def _anchored(rear_rate: float | None) -> Callable[[np.ndarray], Condition]:
    return unknown_condition(REAR_SPEED, 0.0) if rear_rate is None else rear_rate_condition(rear_rate)


def _directions(family: int, rear_rate: float | None) -> list[np.ndarray]:
    steer = np.eye(UNKNOWNS)[STEER]
    if rear_rate is None:
        return [steer if family == 4 else -steer]
    return [steer, -steer]


def anchor(
    bicycle: Bicycle, surface: SurfaceOfRevolution, family: int, rear_rate: float | None
) -> tuple[Steady, np.ndarray, list[np.ndarray]]:
    """Carry an anchor of a family to a bicycle and a surface.

    Parameters
    ----------
    bicycle : Bicycle
    surface : SurfaceOfRevolution
    family : int
        1 to 4.
    rear_rate : float or None
        One of the family's `ANCHORS`.

    Returns
    -------
    equations : Steady
    unknowns : ndarray, shape (22,)
    directions : list of ndarray, shape (22,)
        In which the family's curve runs from there.

    Raises
    ------
    ValueError
        If the anchor is lost on the way.
    """
    u, condition, directions = _on_the_plane(family, rear_rate), _anchored(rear_rate), _directions(family, rear_rate)
    if bicycle != Bicycle():
        u = _carry(lambda s: Steady(_between(bicycle, s), Plane()), u, condition, "this bicycle")
    if not is_level(surface):
        try:
            u = _carry(lambda s: Steady(bicycle, surface.flattened(s)), u, condition, str(surface))
        except ValueError as error:
            if rear_rate is None:
                u = _other_pivot(bicycle, surface)
            else:
                u = _on_middle_circle(bicycle, surface, u, directions, error)
    return Steady(bicycle, surface), u, directions


def next_anchor(
    path: Callable[[float], Steady], family: int, rear_rate: float | None, unknowns: np.ndarray
) -> tuple[Steady, np.ndarray, list[np.ndarray]]:
    """Carry an anchor from neighbouring equations, the path at 0, to those at 1; arguments and results as of `anchor`.

    Raises
    ------
    ValueError
        If the anchor is lost on the way.
    """
    there = path(1.0)
    u = _carry(path, unknowns, _anchored(rear_rate), str(there.surface), step=1.0)
    return there, u, _directions(family, rear_rate)


def _other_pivot(bicycle: Bicycle, surface: SurfaceOfRevolution) -> np.ndarray:
    """The pivoting motion in which family 2 ends on steep bowls.

    The one known from the plane comes to rest as a bowl deepens (the benchmark's on a paraboloid at
    alpha = 0.42); another appears further on (at 0.46), first infinitely fast.
    """
    branch = trace(bicycle, surface, 2)
    for end, point in zip(branch.ends, (branch.points[0], branch.points[-1]), strict=True):
        if end == "pivot":
            return point.unknowns
    raise ValueError(f"there is no pivoting motion on {surface}")


def _radius_condition(radius: float) -> Callable[[np.ndarray], Condition]:
    """Condition of a given radius of D's circle, in units of its square."""

    def condition(u: np.ndarray) -> Condition:
        gradient = np.zeros(UNKNOWNS)
        gradient[:2] = 2 * u[:2] / radius**2
        return Condition(float(u[:2] @ u[:2]) / radius**2 - 1, gradient)

    return condition


def _on_middle_circle(
    bicycle: Bicycle, surface: SurfaceOfRevolution, u: np.ndarray, directions: list[np.ndarray], lost: ValueError
) -> np.ndarray:
    """Carry a family from the plane on the circle half-way between the edges of the ground.

    An anchor rides on a small circle: around a trough there is no ground for it. The ``lost`` one's error
    is raised where the family has no such circle on the plane, or where it is lost on the way too.
    """
    radius, level = sum(surface.extent) / 2, Steady(bicycle, Plane())
    if not np.isfinite(radius):
        raise lost
    condition = _radius_condition(radius)
    for towards in directions:
        for first, second in pairwise(follow(level, u, towards)):
            if condition(first.unknowns).value * condition(second.unknowns).value < 0:
                start, _ = newton(level, second.unknowns, condition, most=30)
                try:
                    return _carry(lambda s: Steady(bicycle, surface.flattened(s)), start, condition, str(surface))
                except ValueError:
                    raise lost from None
    raise lost


def rear_rate_slope(point: Point) -> float:
    """Derivative of the squared rear rate along the curve; zero at a fold in it and at the pivot."""
    return _squared_rate_slope(point, REAR_SPEED)


def front_rate_slope(point: Point) -> float:
    """Derivative of the squared front rate along the curve; zero at a cusp of the paper's figures."""
    return _squared_rate_slope(point, FRONT_SPEED)


def _squared_rate_slope(point: Point, wheel: int) -> float:
    u, t = point.unknowns, point.tangent
    return float(t[SIGMA] * u[wheel] ** 2 + 2 * u[SIGMA] * u[wheel] * t[wheel])


def _crossings(equations: Steady, points: Iterator[Point], rear_rate: float) -> Iterator[np.ndarray]:
    """Solutions of a given rear rate on a followed curve, in the order met."""
    condition = rear_rate_condition(rear_rate)
    for first, second in pairwise(points):
        nodes = [first.unknowns, second.unknowns]
        if rear_rate_slope(first) * rear_rate_slope(second) < 0:
            nodes.insert(1, root_between(equations, first, second, rear_rate_slope).unknowns)
        for a, b in pairwise(nodes):
            fa, fb = condition(a).value, condition(b).value
            # An anchor may lie on the wanted rate itself, to round-off.
            if abs(fa) < 1e-11:
                yield newton(equations, a, condition, most=30)[0]
            elif fa * fb < 0 and abs(fb) >= 1e-11:
                yield newton(equations, a + (b - a) * fa / (fa - fb), condition, most=30)[0]


@dataclass(frozen=True)
class Family:
    """A solution family, end to end.

    Attributes
    ----------
    number : int
    equations : Steady
    points : list of Point
        In the order of one direction; all tangents point that way.
    """

    number: int
    equations: Steady
    points: list[Point]

    @property
    def ends(self) -> tuple[str, str]:
        """What it ends in: ``static``, ``pivot``, ``edge``, ``large circle``, ``flat`` or ``fast front wheel``.

        At the ``edge`` a wheel has come to where the ground ends.
        """
        surface = self.equations.surface
        return _kind_of_end(surface, self.points[0]), _kind_of_end(surface, self.points[-1])


def _at_edge(surface: SurfaceOfRevolution, point: Point) -> bool:
    """Whether a wheel stands where the ground ends."""
    inner, outer = surface.extent
    contact = np.hypot(point.unknowns[CONTACT][[0, 3]], point.unknowns[CONTACT][[1, 4]])
    return bool(contact.max() > (1 - _AT_THE_EDGE) * outer or contact.min() < (1 + _AT_THE_EDGE) * inner)


def _kind_of_end(surface: SurfaceOfRevolution, point: Point) -> str:
    u = point.unknowns
    # Static and pivot are solved for: their unknown is zero to round-off.
    if abs(u[SIGMA]) < 1e-12:
        return "static"
    if abs(u[REAR_SPEED]) < 1e-12:
        return "pivot"
    if _at_edge(surface, point):
        return "edge"
    if np.linalg.norm(u[:3]) > 0.3 * FARTHEST:
        return "large circle"
    return "flat" if abs(u[LEAN]) > 1.0 else "fast front wheel"


def trace(bicycle: Bicycle, surface: SurfaceOfRevolution, family: int, longest: float = LONGEST_STEP) -> Family:
    """Follow a family through its anchor to both ends.

    A curve ends at the static equilibrium, at the pivoting motion (where families 3 and 4 meet), near
    a lean of +-pi/2, at the edge of the ground, on a very large circle or at a very large speed.

    Parameters
    ----------
    bicycle : Bicycle
    surface : SurfaceOfRevolution
    family : int
        1 to 4.
    longest : float
        Longest step of the arc.

    Returns
    -------
    Family

    Raises
    ------
    ValueError
        If the family's anchor cannot be reached on this surface.
    """
    return trace_from(family, *anchor(bicycle, surface, family, ANCHORS[family][-1]), longest)


def trace_from(
    family: int, equations: Steady, start: np.ndarray, directions: list[np.ndarray], longest: float = LONGEST_STEP
) -> Family:
    """Follow a family from an anchor to both ends, see `anchor` and `trace`."""
    forward = _end_exactly(equations, list(_to_an_end(equations, follow(equations, start, directions[0], longest))))
    if len(directions) == 1:
        return Family(family, equations, _turning_alike(forward))
    backward = _end_exactly(equations, list(_to_an_end(equations, follow(equations, start, directions[1], longest))))
    turned = [Point(point.unknowns, -point.tangent) for point in reversed(backward[1:])]
    return Family(family, equations, _turning_alike(turned + forward))


def _turning_alike(points: list[Point]) -> list[Point]:
    """Let a pivoting motion at an end turn as its neighbour does.

    Its rear speed is zero to round-off, of either sign; motions are run so that the rear wheel rolls forward.
    """
    points = list(points)
    for end, neighbour in ((0, 1), (-1, -2)) if len(points) > 1 else ():
        u = points[end].unknowns.copy()
        if abs(u[REAR_SPEED]) < 1e-12:
            u[REAR_SPEED] = np.copysign(max(abs(u[REAR_SPEED]), 1e-300), points[neighbour].unknowns[REAR_SPEED])
            points[end] = Point(u, points[end].tangent)
    return points


def _on_ground(equations: Steady, points: Iterator[Point]) -> Iterator[Point]:
    """Points up to and with the first at the edge of the ground."""
    if equations.surface.extent == (0.0, np.inf):  # no edge to look for
        yield from points
        return
    for point in points:
        yield point
        if _at_edge(equations.surface, point):
            return


def _to_an_end(equations: Steady, points: Iterator[Point]) -> Iterator[Point]:
    """Points up to and with the first beyond the pivoting motion or at the edge, or to the end of the curve."""
    start = 0.0
    for point in _on_ground(equations, points):
        yield point
        speed = point.unknowns[REAR_SPEED]
        if start * speed < 0:
            return
        if abs(speed) > 1e-9:  # not yet: the curve may start at the pivot
            start = speed


def _end_exactly(equations: Steady, points: list[Point]) -> list[Point]:
    """Replace a last point beyond the static equilibrium or the pivoting motion by that end itself."""
    for unknown in (SIGMA, REAR_SPEED):
        first, last = points[-2:] if len(points) > 1 else (points[0], points[0])
        if first.unknowns[unknown] * last.unknowns[unknown] < 0:
            end = root_between(equations, first, last, lambda point, k=unknown: float(point.unknowns[k]))
            return [*points[:-1], end]
    return points


def motions(bicycle: Bicycle, surface: SurfaceOfRevolution, family: int, rear_rate: float) -> list[CircularMotion]:
    """All motions of a family at a rear-wheel rate, nearest to the family's anchor first.

    Parameters
    ----------
    bicycle : Bicycle
    surface : SurfaceOfRevolution
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
        If none of the family's anchors can be reached on this surface.
    """
    found: list[CircularMotion] = []
    failures = []
    for anchor_rate in ANCHORS[family]:
        try:
            equations, start, directions = anchor(bicycle, surface, family, anchor_rate)
        except ValueError as error:
            failures.append(error)
            continue
        for direction in directions:
            for u in _crossings(equations, _to_an_end(equations, follow(equations, start, direction)), rear_rate):
                motion = equations.motion(u)
                if not any(np.hypot(motion.lean - m.lean, motion.steer - m.steer) < 1e-7 for m in found):
                    found.append(motion)
    if len(failures) == len(ANCHORS[family]):
        raise failures[-1]
    return found


def find_motion(
    bicycle: Bicycle,
    surface: SurfaceOfRevolution,
    rear_rate: float,
    family: int | None = None,
    near: tuple[float, float] | None = None,
) -> tuple[int, CircularMotion]:
    """One circular motion by its family, by the angles it is near to, or by both.

    Parameters
    ----------
    bicycle : Bicycle
    surface : SurfaceOfRevolution
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
            found += [(number, motion) for motion in motions(bicycle, surface, number, rear_rate)]
        except ValueError as error:
            failures.append(f"family {number}: {error}")
    wanted = f"rear rate {rear_rate!r} rad/s on {surface}"
    if not found:
        reason = "; ".join(failures) or "their curves, as followed from their anchors, do not reach it"
        where = f"family {family}" if family is not None else "any family"
        raise ValueError(f"no circular motion found with {wanted} in {where}: {reason}")
    if near is None:
        return found[0]

    def distance(item: tuple[int, CircularMotion]) -> float:
        return float(np.hypot(item[1].lean - near[0], item[1].steer - near[1]))

    nearest = min(found, key=distance)
    if distance(nearest) > _NEAR_ENOUGH:
        place = f"{nearest[1].lean:.6g}, {nearest[1].steer:.6g}"
        raise ValueError(
            f"no circular motion found with {wanted} within {_NEAR_ENOUGH} rad of near; the nearest is at {place}"
        )
    return nearest
