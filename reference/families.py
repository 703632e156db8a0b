"""Solution families: curves of circular motions, followed from their anchors to both ends.

See `velodrome.reference.anchors` for the points from which curves are followed, by pseudo-arclength continuation.
On steep bowls families join and leave parts behind: these are further curves, each under the number of the
family that it was a part of.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import islice

import numpy as np

from .anchors import ANCHORS, Anchor, above_ground, anchor, further_anchors
from .bicycle import Bicycle
from .circular import (
    FRONT_SPEED,
    LEAN,
    REAR_SPEED,
    SIGMA,
    YAW_SPEED,
    CircularMotion,
    Steady,
    as_solved,
    make_canonical,
    mirror_motion,
    newton,
    plane_condition,
    rear_rate_condition,
    reverse_speeds,
)
from .continuation import (
    FARTHEST,
    LARGEST_LEAN,
    LONGEST_STEP,
    Point,
    at_edge,
    crossings,
    follow_curve,
    largest_sigma,
    metric,
    roots_along,
    tangent,
)
from .inputs import NO_INPUTS, Inputs
from .kernels.circle import SIGMA_UNIT
from .kernels.steady import STANDING, direction
from .missing_motion import NoSuchMotion, SearchFailed
from .rideability import assess_motions
from .search import describe_search, guesses_at, is_on_curve, search_starts
from .steady_turn import solve_steady_turn, straight_motions
from .surface import SurfaceOfRevolution, has_tip, is_level

FAMILIES = (1, 2, 3, 4)

_MEANT = 1e-3  # rad: so near to what was asked for, no other motion is searched for
_SAME_ANGLES = 1e-7  # rad
NEAR_ENOUGH = 0.2  # rad: a motion further from the requested angles is another one


def rear_rate_slope(point: Point) -> float:
    """Return the derivative of the squared rear rate along the curve; zero at a fold in it and at the pivot."""
    return _squared_rate_slope(point, REAR_SPEED)


def front_rate_slope(point: Point) -> float:
    """Return the derivative of the squared front rate along the curve; zero at a cusp of the paper's figures."""
    return _squared_rate_slope(point, FRONT_SPEED)


def _squared_rate_slope(point: Point, wheel: int) -> float:
    u, t = point.unknowns, point.tangent
    return float(t[SIGMA] * u[wheel] ** 2 + 2 * u[SIGMA] * u[wheel] * t[wheel])


@dataclass(frozen=True)
class Family:
    """A solution family from end to end.

    Attributes
    ----------
    number : int or None
        1 to 4; None for a curve that does not hang together with one of the benchmark's families on the plane.
    equations : Steady
    points : list of Point
        In order along the curve; all tangents point in that direction. At a pivoting end the speeds have the sign
        with which the motion turns as its neighbours on the curve do.
    joined : tuple of int
        Numbers of further families that have joined this curve.
    """

    number: int | None
    equations: Steady
    points: list[Point]
    joined: tuple[int, ...] = ()

    @property
    def numbers(self) -> tuple[int, ...]:
        """Numbers of all families on the curve; empty if there is none."""
        return () if self.number is None else (self.number, *self.joined)

    @property
    def ends(self) -> tuple[str, str]:
        """Kinds of both ends.

        ``static``, ``pivot``, ``edge`` (a wheel is at the edge of the ground), ``tip`` (the rear wheel has reached
        the axis where the ground has no normal), ``large circle``, ``flat`` or ``fast front wheel``.
        """
        return _kind_of_end(self.equations, self.points[0]), _kind_of_end(self.equations, self.points[-1])


def _kind_of_end(equations: Steady, point: Point) -> str:
    u, surface = point.unknowns, equations.surface
    if _is_zero(u, SIGMA):
        return "static"
    if _is_zero(u, REAR_SPEED):
        return "pivot"
    if at_edge(surface, point):
        return "edge"
    # A curve that breaks off inside all limits ends before a tip, if there is one.
    slow = u[SIGMA] < largest_sigma(equations.bicycle)
    within = abs(u[LEAN]) < LARGEST_LEAN and slow and np.linalg.norm(u[:3]) < FARTHEST
    if within and has_tip(surface):
        return "tip"
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
    return trace_from(anchor(bicycle, surface, family, ANCHORS[family][-1]), longest)


def trace_from(start: Anchor, longest: float = LONGEST_STEP) -> Family:
    """Follow a curve from an anchor to both ends; see `velodrome.reference.anchors.anchor` and `trace`."""
    halves = []
    for towards in start.directions:
        points = list(up_to_end(follow_curve(start.equations, start.unknowns, towards, longest)))
        halves.append(_replace_last_by_end(start.equations, points))
    forward, *backward = halves
    before = [Point(point.unknowns, -point.tangent) for half in backward for point in reversed(half[1:])]
    points = before + forward
    for end, neighbour in ((0, 1), (-1, -2)) if len(points) > 1 else ():
        points[end] = _clear_end(points[end], points[neighbour])
    return Family(start.family, start.equations, points)


def trace_through(equations: Steady, unknowns: np.ndarray) -> Family:
    """Follow the curve through a circular motion, given as its 22 unknowns, to both ends; it has no number."""
    u = as_solved(unknowns)
    return trace_from(_make_anchor(equations, Point(u, tangent(equations, u))))


def trace_all(
    bicycle: Bicycle, surface: SurfaceOfRevolution, longest: float = LONGEST_STEP, inputs: Inputs = NO_INPUTS
) -> tuple[list[Family], dict[int, str]]:
    """Follow every curve of circular motions that is found: those of the families, and those without a number.

    Parameters
    ----------
    bicycle : Bicycle
    surface : SurfaceOfRevolution
    longest : float
        Longest step of the arc.
    inputs : Inputs
        With a steer torque no curve has a number: the families are numbered by hands-free motions.

    Returns
    -------
    curves : list of Family
        Each once: the curves of `trace_families`, then those of `search_curves`.
    absent : dict
        Reasons why families have no curve, by the family's number.

    Raises
    ------
    ValueError
        If there is a torque on the rear wheel, with which there is no circular motion.
    """
    equations = Steady(bicycle, surface, inputs)
    if inputs.steer_torque != 0:
        curves = search_curves(bicycle, surface, [], longest, inputs)
        return curves, {number: _explain_numbers(inputs) for number in FAMILIES}
    curves, absent = trace_families(bicycle, surface, longest)
    curves += search_curves(bicycle, surface, curves, longest)
    # Damping changes the eigenvalues of the motions, not the curves.
    return [replace(curve, equations=equations) for curve in curves], absent


def _explain_numbers(inputs: Inputs) -> str:
    """Explain why no family of motions under a steer torque has a number."""
    return f"families are numbered by their hands-free motions; with {inputs.describe()} no curve has a number"


def trace_families(
    bicycle: Bicycle, surface: SurfaceOfRevolution, longest: float = LONGEST_STEP
) -> tuple[list[Family], dict[int, str]]:
    """Follow every curve that holds a family or a part of one.

    Parameters
    ----------
    bicycle : Bicycle
    surface : SurfaceOfRevolution
    longest : float
        Longest step of the arc.

    Returns
    -------
    curves : list of Family
        Each once: first the curves of the families' last anchors, by their smallest number, then curves of further
        anchors, under the number of the family that each was a part of.
    absent : dict
        Reasons why families have no curve, by the family's number.
    """
    curves: list[Family] = []
    absent = {}
    for number in FAMILIES:
        try:
            start = anchor(bicycle, surface, number, ANCHORS[number][-1])
        except ValueError as error:
            absent[number] = str(error)
            continue
        same = next((k for k, curve in enumerate(curves) if _passes_through(curve, start)), None)
        if same is None:
            curves.append(trace_from(start, longest))
        else:
            curves[same] = replace(curves[same], joined=(*curves[same].joined, number))
    for start in further_anchors(bicycle, surface):
        if not any(_passes_through(curve, start) for curve in curves):
            curves.append(trace_from(start, longest))
    numbers = {number for curve in curves for number in curve.numbers}
    return curves, {number: why for number, why in absent.items() if number not in numbers}


def search_curves(
    bicycle: Bicycle,
    surface: SurfaceOfRevolution,
    families: Sequence[Family],
    longest: float = LONGEST_STEP,
    inputs: Inputs = NO_INPUTS,
) -> list[Family]:
    """Search for the curves without a number that can be ridden somewhere.

    Parameters
    ----------
    bicycle : Bicycle
    surface : SurfaceOfRevolution
    families : sequence of Family
        The curves of `trace_families`; with a steer torque there are none.
    longest : float
        Longest step of the arc.
    inputs : Inputs

    Returns
    -------
    list of Family
        Each once, in the order of `velodrome.reference.search.search_starts`.
    """
    found: list[Family] = []
    for start in search_starts(bicycle, surface, inputs):
        known = [*families, *found]
        if not any(is_on_curve(curve.equations, curve.points, start) for curve in known):
            curve = trace_from(_make_anchor(Steady(bicycle, surface, inputs), start), longest)
            # A followed curve may have ended a step before a motion that lies on it.
            if not any(_is_part_of(other, curve) for other in known) and _is_ridden_somewhere(curve):
                found.append(curve)
    return found


def _is_part_of(other: Family, curve: Family) -> bool:
    """Return whether a curve passes through the middle of another."""
    return is_on_curve(curve.equations, curve.points, other.points[len(other.points) // 2])


def _make_anchor(equations: Steady, found: Point) -> Anchor:
    """Make an anchor, without a family, of a motion."""
    covector = metric(found.unknowns) * found.tangent
    condition = plane_condition(found.unknowns, covector, 0.0)
    return Anchor(None, equations, found.unknowns, (found.tangent, -found.tangent), condition)


def _is_ridden_somewhere(curve: Family) -> bool:
    """Return whether a motion on a curve can be ridden."""
    unknowns = np.array([point.unknowns for point in curve.points])
    return bool(assess_motions(curve.equations.bicycle, curve.equations.surface, unknowns).physical.any())


def _passes_through(curve: Family, start: Anchor) -> bool:
    """Return whether a followed curve passes through an anchor, as one of its solutions of the anchor's condition.

    Two curves may end in the same pivoting motion. A curve with a single direction from its anchor must leave it in
    that direction.
    """
    if not any(start.is_same_as(u) for u in crossings(curve.equations, curve.points, start.condition)):
        return False
    direction, *others = start.directions
    if others:
        return True
    ends = [(curve.points[k].unknowns, curve.points[n].unknowns) for k, n in ((0, 1), (-1, -2))]
    inward = [as_solved(neighbour) - as_solved(end) for end, neighbour in ends if start.is_same_as(end)]
    return any(float(change @ direction) > 0 for change in inward)


def _is_zero(unknowns: np.ndarray, unknown: int) -> bool:
    """Return whether the squared speed or the rear speed is zero, as it is at a static equilibrium or at a pivot."""
    return abs(float(unknowns[unknown])) < STANDING


def _clear_end(end: Point, neighbour: Point) -> Point:
    """Set the zero of a curve's end exactly to zero; a pivoting motion there turns as its neighbour does."""
    u, along = end.unknowns.copy(), end.tangent
    for unknown in (SIGMA, REAR_SPEED):
        if _is_zero(u, unknown):
            u[unknown] = 0.0
    turning = neighbour.unknowns[YAW_SPEED] * direction(neighbour.unknowns[REAR_SPEED])
    if _is_zero(u, REAR_SPEED) and u[YAW_SPEED] * turning < 0:
        u, along = reverse_speeds(u), reverse_speeds(along)
    return Point(u, along)


def up_to_end(points: Iterable[Point]) -> Iterator[Point]:
    """Yield the points up to and including the first beyond the pivoting motion, or to the end of the curve."""
    start = 0.0
    for point in points:
        yield point
        speed = point.unknowns[REAR_SPEED]
        if start * speed < 0:
            return
        if abs(speed) > 1e-9:  # the curve may start at the pivot
            start = speed


def _replace_last_by_end(equations: Steady, points: list[Point]) -> list[Point]:
    """Replace a last point beyond the static equilibrium or the pivoting motion by that end itself."""
    for unknown in (SIGMA, REAR_SPEED):
        last = max(len(points) - 3, 0)  # a point may be the end itself, and the next one lie beyond it
        ends = roots_along(equations, points[last:], lambda point, k=unknown: float(point.unknowns[k]), zero=STANDING)
        for place, end in ends:
            return [*points[: last + place + 1], end]
    # A curve that starts in its static equilibrium has no change of sign there.
    if len(points) > 1 and _is_zero(points[-2].unknowns, SIGMA) and points[-1].unknowns[SIGMA] < 0:
        return points[:-1]
    return points


# Both are cached, since motions of many rates are searched for on the same ground.
@lru_cache(maxsize=8)
def _follow_families(bicycle: Bicycle, surface: SurfaceOfRevolution) -> Sequence[Family]:
    return trace_families(bicycle, surface)[0]


@lru_cache(maxsize=8)
def _follow_other_curves(bicycle: Bicycle, surface: SurfaceOfRevolution, inputs: Inputs) -> Sequence[Family]:
    families = _follow_families(bicycle, surface) if inputs == NO_INPUTS else []  # type: ignore[arg-type]
    return search_curves(bicycle, surface, families, inputs=inputs)


def find_motions(bicycle: Bicycle, surface: SurfaceOfRevolution, family: int, rear_rate: float) -> list[CircularMotion]:
    """Find all motions of a family at a rear-wheel rate, the one nearest to the family's anchor first.

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
        Empty where the family has no such motion.

    Raises
    ------
    ValueError
        If the family has no curve on this surface.
    """
    return list(_yield_motions(bicycle, surface, family, rear_rate))


def _yield_motions(
    bicycle: Bicycle, surface: SurfaceOfRevolution, family: int, rear_rate: float
) -> Iterator[CircularMotion]:
    """Yield the motions as they are found; other families are followed only after the family's own anchors."""
    found: list[CircularMotion] = []
    anchors, failures = [], []
    for anchor_rate in ANCHORS[family]:
        try:
            start = anchor(bicycle, surface, family, anchor_rate)
        except ValueError as error:
            failures.append(error)
            continue
        anchors.append(start)
        for towards in start.directions:
            points = up_to_end(follow_curve(start.equations, start.unknowns, towards))
            yield from _append_new_motions(found, start.equations, points, rear_rate)
    others = follow_other_parts(bicycle, surface, family, anchors)
    for curve in others:
        yield from _append_new_motions(found, curve.equations, curve.points, rear_rate)
    if not anchors and not others:
        raise failures[-1]


def follow_other_parts(
    bicycle: Bicycle, surface: SurfaceOfRevolution, family: int, anchors: Sequence[Anchor]
) -> list[Family]:
    """Return the curves with parts of a family that pass through none of its anchors."""
    every = _follow_families(bicycle, surface)  # type: ignore[arg-type]
    return [c for c in every if family in c.numbers and not any(_passes_through(c, start) for start in anchors)]


def _append_new_motions(
    found: list[CircularMotion], equations: Steady, points: Iterable[Point], rear_rate: float
) -> Iterator[CircularMotion]:
    """Yield motions of a rear rate along a curve that are not in ``found``, and append them to it."""
    condition = rear_rate_condition(rear_rate)
    for u in crossings(equations, points, condition):
        motion = equations.motion(make_canonical(equations, u, condition)[0])
        if not any(_same_angles(motion, other) for other in found):
            found.append(motion)
            yield motion


def find_motion(
    bicycle: Bicycle,
    surface: SurfaceOfRevolution,
    rear_rate: float,
    family: int | None = None,
    near: tuple[float, float] | None = None,
    inputs: Inputs = NO_INPUTS,
) -> tuple[int | None, CircularMotion]:
    """Find one circular motion by its family, by angles near to it, or by both.

    Parameters
    ----------
    bicycle : Bicycle
    surface : SurfaceOfRevolution
    rear_rate : float
        Rear-wheel rate, positive [rad/s].
    family : int, optional
        1 to 4. Without ``near``, the solution nearest to the family's anchor along the curve is returned.
    near : tuple of float, optional
        Lean and steer [rad]. The nearest of all solutions (of the family, if given) is returned. Without ``family``
        it may be on a curve that has no number, or straight.
    inputs : Inputs
        Held constant. With a steer torque no curve has a number, and no motion is straight.

    Returns
    -------
    family : int or None
        None on a curve without a number, and for a straight motion.
    motion : CircularMotion
        On level ground it may be straight, upright with a steer of 0 or pi. Whether it can be ridden says
        `velodrome.reference.rideability.explain_motion`.

    Raises
    ------
    NoSuchMotion
        If the search is complete and finds no such motion.
    SearchFailed
        If it finds none, and the curve of a family could not be searched.
    ValueError
        If an argument is invalid.
    """
    Steady(bicycle, surface, inputs)  # refuses inputs with which there is no circular motion
    held = Inputs(steer_torque=inputs.steer_torque)  # damping acts in no circular motion
    _check_request(rear_rate, family, near, held)
    numbers = FAMILIES if held == NO_INPUTS else ()
    found, failures = _search_families(bicycle, surface, rear_rate, numbers if family is None else (family,), near)
    unsearched = _list_unsearched(bicycle, surface, rear_rate, near)
    wanted = f"rear rate {rear_rate!r} rad/s on {surface}"
    if held != NO_INPUTS:
        wanted += f" under {held.describe()}"
    if near is None:
        if found:
            return found[0]
        reason = _join_failures(failures) or "its curves, as followed from their anchors, do not reach it"
        raise _not_found(f"{wanted} in family {family}", [reason, *unsearched], failures, not unsearched)

    def distance(item: tuple[int | None, CircularMotion]) -> float:
        return float(np.hypot(wrap_angle(item[1].lean - near[0]), wrap_angle(item[1].steer - near[1])))

    if family is None:
        equations = Steady(bicycle, surface, held)
        if is_level(surface) and held == NO_INPUTS:
            found += [(None, motion) for motion in straight_motions(bicycle, surface, rear_rate)]
        found += _motions_from(equations, rear_rate, near, [motion for _, motion in found])
        if all(distance(item) > _MEANT for item in found):
            found += _motions_without_number(equations, rear_rate)
    least = min(map(distance, found), default=np.inf)
    # A motion may be on the curves of several families: then it is of the first.
    nearest = next((item for item in found if distance(item) < least + _SAME_ANGLES), None)
    if nearest is not None and distance(nearest) <= NEAR_ENOUGH:
        return nearest
    curves = "the curves of the families, and " if numbers else "and "
    searched = f"Newton's method from there, {curves}{describe_search(held)}"
    if family is not None:
        searched = f"the curves of family {family}"
    reasons = [f"searched were {searched}, on circles of up to {FARTHEST:g} m", *unsearched]
    if nearest is not None:
        reasons.insert(0, f"the nearest is at {nearest[1].lean:.6g}, {nearest[1].steer:.6g}")
    if _is_near_straight(near) and not is_level(surface):
        reasons.insert(0, "no motion is straight on ground that is not level")
    if failures:
        reasons.append(_join_failures(failures))
    wanted += f" within {NEAR_ENOUGH} rad of near = {near[0]:g}, {near[1]:g}"
    raise _not_found(wanted, reasons, failures, not unsearched)


def _check_request(rear_rate: float, family: int | None, near: tuple[float, float] | None, held: Inputs) -> None:
    """Raise a ValueError where what `find_motion` is asked for is no motion; ``held`` are the torques alone."""
    if not (np.isfinite(rear_rate) and rear_rate > 0):
        raise ValueError(f"rear rate is {rear_rate!r}; it must be a positive number of rad/s")
    if family is None and near is None:
        raise ValueError("a circular motion needs a family (1 to 4) or the lean and steer that it is near to")
    if family is not None and family not in FAMILIES:
        raise ValueError(f"family is {family!r}; it must be 1, 2, 3 or 4")
    if near is not None and not np.all(np.isfinite(near)):
        raise ValueError(f"near is {near!r}; it must be two finite angles, lean and steer in rad")
    if family is not None and held != NO_INPUTS:
        raise ValueError(f"{_explain_numbers(held)}; give the lean and steer that the motion is near to, and no family")


def _search_families(
    bicycle: Bicycle,
    surface: SurfaceOfRevolution,
    rear_rate: float,
    numbers: Sequence[int],
    near: tuple[float, float] | None,
) -> tuple[list[tuple[int | None, CircularMotion]], dict[int, ValueError]]:
    """Return the hands-free motions of a rear rate in families, by number, and why families could not be followed.

    Without ``near`` they are the first of each family; with it, all of them and their mirror images.
    """
    found: list[tuple[int | None, CircularMotion]] = []
    failures: dict[int, ValueError] = {}
    for number in numbers:
        try:
            met = _yield_motions(bicycle, surface, number, rear_rate)
            found += [(number, motion) for motion in (islice(met, 1) if near is None else met)]
        except ValueError as error:
            failures[number] = error
    if near is not None:
        # Left and right are exchanged freely; the families' curves turn to the left.
        found += [(number, mirror_motion(motion)) for number, motion in found]
    return found, failures


def _list_unsearched(
    bicycle: Bicycle, surface: SurfaceOfRevolution, rear_rate: float, near: tuple[float, float] | None
) -> list[str]:
    """List the motions that may be those asked for and that no search reaches: nearly straight ones, and fast ones."""
    unsearched = []
    bounded = is_level(surface) or surface.extent[1] <= FARTHEST
    if near is not None and not bounded and _is_near_straight(near):
        unsearched.append("larger ones, which are nearly straight, were not")
    # The front wheel's rate is about that at which its rim runs as fast as the rear one.
    largest = np.sqrt(SIGMA_UNIT * largest_sigma(bicycle))
    if not rear_rate * np.hypot(1.0, bicycle.rear_wheel_radius / bicycle.front_wheel_radius) < largest:
        unsearched.append(f"motions whose wheels turn faster than {largest:.4g} rad/s together were not searched")
    return unsearched


def _is_near_straight(near: tuple[float, float]) -> bool:
    """Return whether angles are near those of upright straight motion, the handlebar forward or reversed."""
    return min(np.hypot(wrap_angle(near[0]), wrap_angle(near[1] - steer)) for steer in (0.0, np.pi)) <= NEAR_ENOUGH


def wrap_angle(angle: float) -> float:
    """Return an angle without whole turns, from -pi to pi."""
    return float(np.arctan2(np.sin(angle), np.cos(angle)))


def _join_failures(failures: Mapping[int, ValueError]) -> str:
    return "; ".join(f"family {number}: {error}" for number, error in failures.items())


def _not_found(
    wanted: str, reasons: Sequence[str], failures: Mapping[int, ValueError], complete: bool
) -> NoSuchMotion | SearchFailed:
    """Return the error of a search without a result.

    Where an anchor was lost, its curve has not been searched. Where it ended in a fold, this bicycle has no such curve.
    """
    if complete and all(isinstance(error, NoSuchMotion) for error in failures.values()):
        return NoSuchMotion("; ".join([f"no circular motion found with {wanted}", *reasons]))
    found = f"no circular motion found with {wanted}, but the search is not complete"
    return SearchFailed("; ".join([found, *reasons]))


def _motions_from(
    equations: Steady, rear_rate: float, near: tuple[float, float], known: Sequence[CircularMotion]
) -> Iterator[tuple[None, CircularMotion]]:
    """Yield motions of a rear rate that Newton's method finds from two angles, other than the known ones."""
    condition = rear_rate_condition(rear_rate)
    bicycle, surface, inputs = equations.bicycle, equations.surface, equations.inputs
    reached: list[CircularMotion] = []
    if is_level(surface):
        turn = solve_steady_turn(bicycle, surface, rear_rate, *near, inputs)
        reached += [] if turn is None else [turn]
    for guess in guesses_at(bicycle, surface, *near, inputs):
        try:
            unknowns, _ = newton(equations, guess, condition, most=25)
            motion = equations.motion(unknowns)
        except ValueError:
            continue
        # In these unknowns, positions from the centre, a larger circle is not determined by the plane, and need not be
        # a solution; the steady turn above is.
        too_large = is_level(surface) and np.hypot(*unknowns[:2]) > FARTHEST
        if above_ground(equations, unknowns) and not too_large:
            reached.append(motion)
    for k, motion in enumerate(reached):
        if not any(_same_angles(motion, other) for other in (*known, *reached[:k])):
            yield None, motion


def _motions_without_number(equations: Steady, rear_rate: float) -> Iterator[tuple[None, CircularMotion]]:
    """Yield motions of a rear rate on the curves without a number."""
    where = equations.bicycle, equations.surface, equations.inputs
    for curve in _follow_other_curves(*where):  # type: ignore[arg-type]
        for motion in _append_new_motions([], curve.equations, curve.points, rear_rate):
            yield None, motion


def _same_angles(one: CircularMotion, other: CircularMotion) -> bool:
    return bool(np.hypot(wrap_angle(one.lean - other.lean), wrap_angle(one.steer - other.steer)) < _SAME_ANGLES)
