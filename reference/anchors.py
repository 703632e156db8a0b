"""Anchors of the solution families: the points from which their curves are followed.

Newton's method from random starts finds spurious roots, and the families reconnect as a bowl deepens. Every family
therefore has *anchors*: points of the benchmark bicycle's curves on the level plane, reached from a point named in
the paper and carried by continuation to the wanted bicycle and surface. Where families have joined or exchanged
parts, an anchor stays on its part: the curve of a family's last anchor bears the family's number, the other anchors
stay on parts that it may have lost.

=======  =====================================  ============================================
family   anchors                                followed towards
=======  =====================================  ============================================
1        on the curve from A (static), at a     both ends: A and B on small curvature
         rear rate of 15
2        on the curve from D, away from its     both ends: E and, through the cusp D, C on
         cusp, at a rear rate of 20             small curvature
3        on the curve from G to F, at a rear    both ends; the steer falling, to F
         rate of 20; and G, pivoting
4        on the curve from D to C, on a         both ends; the steer growing, through the
         circle of 6 m; and H = G, pivoting     cusp I
=======  =====================================  ============================================

The circles that tend to C belong to family 2 until the cusps D and I collide, then to family 4 (on paraboloids from
alpha = 0.017), and form a curve of their own where the pivoting motion has left them (from 0.42). Some curves are
reached from no anchor: curves of slow circles that begin in a static equilibrium. Steep paraboloids have some of
them that the plane does not have (with the handlebar reversed from alpha = 0.34, otherwise from 0.40).

Where an anchor cannot be carried, for instance to a trough that has no ground for so small a circle, another point
of its curve is carried instead: the circle half-way between the edges of the ground.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import cache

import numpy as np

from .bicycle import Bicycle
from .circular import (
    CONTACT,
    LEAN,
    PITCH,
    REAR_SPEED,
    SIGMA,
    STEER,
    Condition,
    Steady,
    as_solved,
    nearest_condition,
    newton,
    rear_rate_condition,
    reverse_speeds,
    unknown_condition,
)
from .continuation import LARGEST_LEAN, crossings, follow_curve, tangent
from .inputs import NO_INPUTS, Inputs
from .kernels import dynamics as kernel
from .kernels.curve import CHOSEN
from .kernels.steady import STANDING, UNKNOWNS
from .kinematics import body_positions, constants
from .missing_motion import NoSuchMotion, SearchFailed
from .surface import Plane, SurfaceOfRevolution, evaluate, is_level

# (lean, steer) of A, D and G on the level plane, as printed (Xiong et al. 2020, section 3.2).
_POINT_A, _POINT_D, _POINT_G = (0.0, 1.33973991149), (0.62, 2.78), (-0.01206, 1.6019)
# Rear rates of each family's anchors; None is the pivoting motion. The last one's curve is the family's.
ANCHORS: dict[int, tuple[float | None, ...]] = {1: (15.0,), 2: (20.0,), 3: (20.0, None), 4: (None,)}
# Radius of D's circle on the way to C [m]: larger than at the cusps D and I, where families exchange their parts,
# and at angles that change little with the bowl.
_TOWARDS_C = 6.0
# Guesses of static equilibria: as a bowl deepens, their pitch falls to -0.8.
_STEERS, _PITCHES = np.pi * (np.arange(8) + 0.5) / 8, (0.0, -0.3, -0.6)
_SMALLEST_CIRCLE = 1e-100  # [m]: the squares of smaller ones underflow
_SHORTEST_STEP = 1e-6  # of carrying an anchor
_LARGEST_MOVE = 0.05  # largest change of an unknown of order one in one step of carrying an anchor
# Two solutions of one condition are the same below this. Round-off, 1e-14, splits a double root by its square root.
_SAME = 1e-6
# Yaw rate relative to the root of the sum of the squared rates. Circles of more than 1e8 m lie below it, which nothing
# follows, and round-off, 1e-16 times the rolling rows' condition of 1e3 or so, far below.
_STRAIGHT = 1e-9


@dataclass(frozen=True)
class Anchor:
    """A solution that a curve is followed from.

    Attributes
    ----------
    family : int or None
        None for a solution that is not on the curve of a family.
    equations : Steady
    unknowns : ndarray, shape (22,)
    directions : tuple of ndarray, shape (22,)
        One or two directions in which the curve is followed from there.
    condition : callable
        Condition that singles the solution out on its curve: maps unknowns to a
        `velodrome.reference.circular.Condition`.
    """

    family: int | None
    equations: Steady
    unknowns: np.ndarray
    directions: tuple[np.ndarray, ...]
    condition: Callable[[np.ndarray], Condition]

    def is_same_as(self, unknowns: np.ndarray) -> bool:
        """Return whether another solution is the anchor itself, with its wheels running either way."""
        return are_same_solution(unknowns, self.unknowns)


def are_same_solution(unknowns: np.ndarray, other: np.ndarray) -> bool:
    """Return whether two solutions (22,) of one condition are the same, with the wheels running either way."""
    change = np.abs(unknowns - other) / (1 + np.abs(other))
    return bool(max(change[: STEER + 1].max(), change[SIGMA]) < _SAME)


def start_on_plane(bicycle: Bicycle, lean: float, steer: float, inputs: Inputs = NO_INPUTS) -> np.ndarray:
    """Guess the 22 unknowns on the level plane from two angles alone.

    At fixed lean and steer the bicycle can roll in exactly one circle: the null vector of the rolling
    rows gives the directions of all speeds and the circle's centre. The speed and the forces then fit
    the equations of motion best in the least-squares sense.

    Parameters
    ----------
    bicycle : Bicycle
    lean, steer : float
        Angles [rad].
    inputs : Inputs

    Returns
    -------
    ndarray, shape (22,)

    Raises
    ------
    ValueError
        If the wheels cannot both touch the plane at these angles, or roll straight on.
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
    if abs(speeds[3]) < _STRAIGHT:
        raise ValueError(f"the wheels roll straight on at lean = {lean!r}, steer = {steer!r}")
    centre = np.array([speeds[1], -speeds[0]]) / speeds[3]
    u = np.zeros(UNKNOWNS)
    u[:6] = *centre, q[2], lean, q[5], steer
    u[6:9] = speeds[3:]
    u[CONTACT] = p + np.array([*centre, 0, *centre, 0])
    equations, linear = Steady(bicycle, surface, inputs), [SIGMA, *range(16, 22)]
    u[linear] = np.linalg.lstsq(equations.jacobian(u)[:9, linear], -equations.residual(u)[:9], rcond=None)[0]
    return u


def _carry(
    path: Callable[[float], Steady],
    u: np.ndarray,
    condition: Callable,
    describe_place: Callable[[float], str],
    step: float = 0.02,
) -> np.ndarray:
    """Carry a solution along a path of equations, from 0 to 1, at a fixed condition.

    Newton's method may well converge to another branch. A step that moves an angle or a speed too far is therefore
    repeated with half its length; the step grows again while Newton's method converges fast. ``describe_place`` names
    the goal, and where on the way a fraction of it is, for the message of an error.
    """
    reached = 0.0
    u = as_solved(u)
    regular = _least_singular_value(path(0.0), u, condition)
    while reached < 1:
        wanted = min(1.0, reached + step)
        carried = _take_step(path(wanted), u, condition)
        if carried is None:
            step /= 2
            if step < _SHORTEST_STEP:
                # At a distance d before a fold the smallest singular value has fallen by the root of d.
                fold = _least_singular_value(path(reached), u, condition) < 0.05 * regular
                way = f"{100 * reached:.4g} % of the way to {describe_place(reached)}"
                if fold:
                    raise NoSuchMotion(f"its anchor ends in a fold {way}")
                raise SearchFailed(f"its anchor is lost {way}")
            continue
        (u, iterations), reached = carried, wanted
        step *= 1.5 if iterations <= 5 else 1.0
    if u[SIGMA] < 0:
        raise NoSuchMotion(f"its anchor is no motion at {describe_place(1.0)}: the squared speed would be negative")
    return u


def _least_singular_value(equations: Steady, u: np.ndarray, condition: Callable[[np.ndarray], Condition]) -> float:
    """Return the smallest singular value of the equations with a condition at a solution (22,)."""
    here = equations.expand(u[CHOSEN])
    matrix = np.vstack([here.jacobian, condition(here.full).gradient @ here.basis])
    return float(np.linalg.svd(matrix, compute_uv=False)[-1])


def _take_step(equations: Steady, u: np.ndarray, condition: Callable) -> tuple[np.ndarray, int] | None:
    """Return the solution of neighbouring equations and its iterations; None where it fails or jumps."""
    try:
        new, iterations = newton(equations, u, condition, most=8)
    except ValueError:
        return None
    moved = np.abs(new - u)[LEAN : SIGMA + 1] / (1 + np.abs(u[LEAN : SIGMA + 1]))
    return (new, iterations) if moved.max() <= _LARGEST_MOVE else None


def _interpolate_bicycle(bicycle: Bicycle, fraction: float) -> Bicycle:
    """Interpolate between the benchmark and another bicycle.

    Rigid bodies remain rigid bodies, since the inertias of rigid bodies form a convex set.
    """
    benchmark, wanted = asdict(Bicycle()), asdict(bicycle)
    return Bicycle(**{name: (1 - fraction) * benchmark[name] + fraction * wanted[name] for name in benchmark})


@cache
def _named_point(name: str) -> np.ndarray:
    """Return point A, D or G of the benchmark on the level plane."""
    angles, condition = {
        "A": (_POINT_A, unknown_condition(SIGMA, 0.0)),
        "D": (_POINT_D, nearest_condition()),
        "G": (_POINT_G, unknown_condition(REAR_SPEED, 0.0)),
    }[name]
    return newton(Steady(Bicycle(), Plane()), start_on_plane(Bicycle(), *angles), condition, most=30)[0]


@cache
def _plane_anchor(family: int, rear_rate: float | None) -> np.ndarray:
    """Return the benchmark's anchor on the level plane, found from the paper's named points."""
    name, towards = {1: ("A", _unit(SIGMA)), 2: ("D", _unit(LEAN))}.get(family, ("G", -_unit(STEER)))
    start = _named_point(name)
    return start if rear_rate is None else _first_crossing(start, towards, _anchor_condition(rear_rate))


def _first_crossing(start: np.ndarray, towards: np.ndarray, condition: Callable[[np.ndarray], Condition]) -> np.ndarray:
    """Return the first solution of a condition on the benchmark's curve on the plane."""
    level = Steady(Bicycle(), Plane())
    return next(crossings(level, follow_curve(level, start, towards), condition))


def _unit(index: int) -> np.ndarray:
    return np.eye(UNKNOWNS)[index]


def _anchor_condition(rear_rate: float | None) -> Callable[[np.ndarray], Condition]:
    return unknown_condition(REAR_SPEED, 0.0) if rear_rate is None else rear_rate_condition(rear_rate)


def _directions(family: int, rear_rate: float | None) -> tuple[np.ndarray, ...]:
    steer = _unit(STEER)
    if rear_rate is None:
        return (steer if family == 4 else -steer,)
    return steer, -steer


def anchor(bicycle: Bicycle, surface: SurfaceOfRevolution, family: int, rear_rate: float | None) -> Anchor:
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
    Anchor

    Raises
    ------
    ValueError
        If the anchor is lost on the way.
    """
    condition, directions = _anchor_condition(rear_rate), _directions(family, rear_rate)
    u = _to_bicycle(bicycle, _plane_anchor(family, rear_rate), condition)
    if rear_rate is None:
        try:
            u = _to_surface(bicycle, surface, u, condition)
        except ValueError:
            u = _find_other_pivot(bicycle, surface)
    else:
        u, condition = _to_surface_or_middle(bicycle, surface, u, condition, directions)
    return _anchor_at(family, Steady(bicycle, surface), u, directions, condition)


def _anchor_at(
    family: int,
    equations: Steady,
    unknowns: np.ndarray,
    directions: tuple[np.ndarray, ...],
    condition: Callable[[np.ndarray], Condition],
) -> Anchor:
    """Make an anchor at a solution; a pivoting motion turns as its neighbours in the anchor's direction do."""
    u = unknowns
    if abs(u[REAR_SPEED]) < STANDING:
        along = tangent(equations, u)
        if along[REAR_SPEED] * (along @ directions[0]) < 0:
            u = reverse_speeds(u)
    return Anchor(family, equations, u, directions, condition)


def next_anchor(path: Callable[[float], Steady], family: int, rear_rate: float | None, unknowns: np.ndarray) -> Anchor:
    """Carry an anchor from neighbouring equations, at 0 on the path, to those at 1; see `anchor` for the arguments.

    Raises
    ------
    ValueError
        If the anchor is lost on the way.
    """
    there, condition = path(1.0), _anchor_condition(rear_rate)
    u = _carry(path, unknowns, condition, lambda _: str(there.surface), step=1.0)
    return _anchor_at(family, there, u, _directions(family, rear_rate), condition)


def further_anchors(bicycle: Bicycle, surface: SurfaceOfRevolution) -> Iterator[Anchor]:
    """Yield anchors of further curves that may hold parts of the families.

    The families' anchors other than their last come first, then every static equilibrium. The curve that begins in a
    static equilibrium ends in circles of growing radius, as family 1 does, and bears its number.

    Yields
    ------
    Anchor
        Anchors that can be carried to the bicycle and the surface.
    """
    for family, rates in ANCHORS.items():
        for rate in rates[:-1]:
            with suppress(ValueError):
                yield anchor(bicycle, surface, family, rate)
    with suppress(ValueError):
        yield _anchor_towards_c(bicycle, surface)
    equations = Steady(bicycle, surface)
    for u in static_equilibria(equations):
        yield Anchor(1, equations, u, (_unit(SIGMA),), unknown_condition(SIGMA, 0.0))


def _anchor_towards_c(bicycle: Bicycle, surface: SurfaceOfRevolution) -> Anchor:
    """Return the anchor on the circles that tend to C; raise ValueError where it is lost."""
    condition, directions = _radius_condition(_TOWARDS_C), (_unit(STEER), -_unit(STEER))
    u = _to_bicycle(bicycle, _first_crossing(_named_point("D"), -_unit(LEAN), condition), condition)
    u, condition = _to_surface_or_middle(bicycle, surface, u, condition, directions)
    return Anchor(4, Steady(bicycle, surface), u, directions, condition)


def static_equilibria(equations: Steady) -> list[np.ndarray]:
    """Find static equilibria of the bicycle upright on its wheels and steered to the left, from a grid of guesses.

    Parameters
    ----------
    equations : Steady

    Returns
    -------
    list of ndarray, shape (22,)
        In order of rising steer.
    """
    found: list[np.ndarray] = []
    for steer in _STEERS:
        try:
            level = start_on_plane(equations.bicycle, 0.0, float(steer))
        except ValueError:
            continue
        for pitch in _PITCHES:
            start = level.copy()
            start[[PITCH, SIGMA]] = pitch, 0.0
            try:
                u, _ = newton(equations, start, unknown_condition(SIGMA, 0.0), most=25)
            except ValueError:
                continue
            if _is_standing(equations, u) and not any(np.abs(u - other)[: STEER + 1].max() < _SAME for other in found):
                found.append(u)
    return sorted(found, key=lambda u: float(u[STEER]))


def _is_standing(equations: Steady, unknowns: np.ndarray) -> bool:
    """Return whether the bicycle stands on its wheels, above the ground and steered to the left.

    Other roots of the equations are no equilibria of a real bicycle.
    """
    return bool(0 < unknowns[STEER] < np.pi) and above_ground(equations, unknowns)


def above_ground(equations: Steady, unknowns: np.ndarray) -> bool:
    """Return whether a solution (22,) lies above the ground, with a lean and a pitch that a bicycle can have."""
    if np.abs(unknowns[[LEAN, PITCH]]).max() > LARGEST_LEAN:
        return False
    q = np.zeros((1, 9))
    q[0, :3], q[0, 4:7] = unknowns[:3], unknowns[3:6]
    centres = body_positions(equations.bicycle, q)[0]
    # The wheels may as well touch the ground from below.
    return bool(np.all(centres[:, 2] > evaluate(equations.surface, centres[:, 0], centres[:, 1])[:, 0]))


def _to_bicycle(bicycle: Bicycle, u: np.ndarray, condition: Callable[[np.ndarray], Condition]) -> np.ndarray:
    """Carry the benchmark's solution on the plane to a bicycle."""
    if bicycle == Bicycle():
        return u
    benchmark, wanted = asdict(Bicycle()), asdict(bicycle)
    changed = [name for name in wanted if wanted[name] != benchmark[name]]

    def describe_place(reached: float) -> str:
        between = asdict(_interpolate_bicycle(bicycle, reached))
        values = ", ".join(f"{name} = {between[name]:.6g}" for name in changed[:3])
        return f"this bicycle, at {values}{', ...' if len(changed) > 3 else ''}"

    return _carry(lambda s: Steady(_interpolate_bicycle(bicycle, s), Plane()), u, condition, describe_place)


def _to_surface(
    bicycle: Bicycle, surface: SurfaceOfRevolution, u: np.ndarray, condition: Callable[[np.ndarray], Condition]
) -> np.ndarray:
    """Carry a bicycle's solution on the plane to a surface."""
    if is_level(surface):
        return u
    return _carry(lambda s: Steady(bicycle, surface.flattened(s)), u, condition, lambda _: str(surface))


def _to_surface_or_middle(
    bicycle: Bicycle,
    surface: SurfaceOfRevolution,
    u: np.ndarray,
    condition: Callable[[np.ndarray], Condition],
    directions: tuple[np.ndarray, ...],
) -> tuple[np.ndarray, Callable[[np.ndarray], Condition]]:
    """Carry a solution to a surface; where it is lost, carry the circle half-way between the ground's edges.

    An anchor rides on a small circle, and a trough may have no ground for it. The first error is raised where the curve
    on the plane, followed in the ``directions``, has no circle half-way, or where that circle is lost as well.
    """
    try:
        return _to_surface(bicycle, surface, u, condition), condition
    except ValueError as error:
        lost = error
    radius, plane = sum(surface.extent) / 2, Steady(bicycle, Plane())
    if not _SMALLEST_CIRCLE < radius < np.inf:
        raise lost
    halfway = _radius_condition(radius)
    for towards in directions:
        for start in crossings(plane, follow_curve(plane, u, towards), halfway):
            try:
                return _to_surface(bicycle, surface, start, halfway), halfway
            except ValueError:
                raise lost from None
    raise lost


def _find_other_pivot(bicycle: Bicycle, surface: SurfaceOfRevolution) -> np.ndarray:
    """Return the pivoting motion in which family 2 ends on steep bowls.

    The pivoting motion known from the plane comes to rest as a bowl deepens (the benchmark's on a paraboloid at
    alpha = 0.42). Another one appears further on (at 0.46), at first infinitely fast.
    """
    branch = anchor(bicycle, surface, 2, ANCHORS[2][-1])
    for towards in branch.directions:
        points = follow_curve(branch.equations, branch.unknowns, towards)
        for u in crossings(branch.equations, points, _anchor_condition(None)):
            return u
    raise NoSuchMotion(f"there is no pivoting motion on {surface}")


def _radius_condition(radius: float) -> Callable[[np.ndarray], Condition]:
    """Make the condition of a given radius of D's circle, in units of its square."""

    def condition(u: np.ndarray) -> Condition:
        gradient = np.zeros(UNKNOWNS)
        gradient[:2] = 2 * u[:2] / radius**2
        return Condition(float(u[:2] @ u[:2]) / radius**2 - 1, gradient)

    return condition
