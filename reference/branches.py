"""Motions of many rear rates and bowls, each with the bits that `velodrome.reference.families.find_motion` gives.

A family's curve is followed on a few bowls only, the nodes of a lattice, and divided into branches along which the rear
rate is monotone. A motion between two nodes is predicted from both and corrected.

The result must be the motion that the full search finds: the first of its rate along the curve from the family's
anchor, or the nearest to given angles. It is taken only where this is clear:

- On both nodes the same branches, in the same order, have the rate clearly inside or clearly outside. The ends of
  branches, which are folds and ends of the curve, keep a distance from the rate of twice their change between the nodes
  and a thousandth of the rate.
- On both nodes the same motion is the nearest, by more than the distances change between the nodes.
- Prediction and correction differ by a quarter of the change between the nodes at most, and the determinant of the
  equations, whose sign is that of the rate's slope along the curve, has the branch's sign.

Everything else is left to the full search. Both results are made canonical
(`velodrome.reference.circular.make_canonical`), so that they have the same bits, and a motion where this is in doubt is
left to the full search too.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np

from .anchors import ANCHORS, anchor
from .bicycle import Bicycle
from .circular import LEAN, REAR_SPEED, SIGMA, STEER, CircularMotion, Steady, mirror_motion, rear_rate_condition
from .continuation import Point, follow_curve, root_between
from .families import NEAR_ENOUGH, follow_other_parts, rear_rate_slope, up_to_end, wrap_angle
from .kernels.branches import BranchPoints, carry_motions, motion_at
from .kernels.circle import SIGMA_UNIT
from .kernels.curve import CHOSEN
from .kernels.newton import solve_motion
from .kernels.steady import UNKNOWNS
from .surface import Paraboloid, SurfaceOfRevolution

_SHARE = 1e-3  # of the rate's square: its least distance from the ends of a branch
_VISITS = 3  # so many different motions between two nodes make the nodes worth their time
_MOST_VISITS = 4096
# Nodes lie a sixteenth of an octave of alpha + _FINEST apart: a bowl changes most, relatively, near the plane.
_FINEST, _NODES_AN_OCTAVE = 2.0**-8, 16
_SMALLEST = 2.0**-9  # width of a cell, relative to its alpha, below which it is not halved
_SAME = 1e-6  # below this, motions on two branches are the same


@dataclass(frozen=True)
class MotionRequest:
    """A hands-free circular motion of a family.

    Attributes
    ----------
    bicycle : Bicycle
    surface : SurfaceOfRevolution
    rear_rate : float
        Positive [rad/s].
    family : int
    near : tuple of float or None
        Lean and steer [rad]. As in `velodrome.reference.families.find_motion`.
    """

    bicycle: Bicycle
    surface: SurfaceOfRevolution
    rear_rate: float
    family: int
    near: tuple[float, float] | None = None

    @property
    def square(self) -> float:
        """Squared rear rate, in the unit of sigma b^2."""
        return float(rear_rate_condition(self.rear_rate).terms.target)


@dataclass(frozen=True, eq=False)
class _Branch:
    """A part of a followed curve along which the squared rear rate is monotone.

    Attributes
    ----------
    kind : tuple of int
        Which curve it is on, and whether the rate rises along it.
    points : BranchPoints
    ends : tuple of float
        Least and largest squared rate, at its folds where it ends in some.
    sign : float
        See `kernels.branches.carry_motions`.
    """

    kind: tuple[int, bool]
    points: BranchPoints
    ends: tuple[float, float]
    sign: float


@dataclass(frozen=True)
class _Cell:
    """Two neighbouring nodes, and what is asked for between them."""

    bicycle: Bicycle
    nodes: tuple[SurfaceOfRevolution, SurfaceOfRevolution]
    family: int
    every: bool


_visits: Counter[_Cell] = Counter()


def find_family_motions(requests: Sequence[MotionRequest]) -> list[CircularMotion | None]:
    """Find many motions of families.

    Parameters
    ----------
    requests : sequence of MotionRequest
        All different.

    Returns
    -------
    list of CircularMotion or None
        In the order of the requests: what `velodrome.reference.families.find_motion` returns, with the same bits, or
        None where it has to be asked.
    """
    cells: dict[_Cell, list[int]] = {}
    for i, request in enumerate(requests):
        cells.setdefault(_locate(request), []).append(i)
    found: list[CircularMotion | None] = [None] * len(requests)
    if len(_visits) > _MOST_VISITS:
        _visits.clear()
    for cell, indices in cells.items():
        _visits[cell] += len(indices)
        if _visits[cell] >= _VISITS:
            for i, motion in _search_cell(cell, {i: requests[i] for i in indices}):
                found[i] = motion
    return found


def _locate(request: MotionRequest) -> _Cell:
    """Return the cell of a request; ground of no lattice is both nodes itself."""
    nodes = request.surface, request.surface
    if isinstance(request.surface, Paraboloid):
        spacing = 2.0 ** np.floor(np.log2(request.surface.alpha + _FINEST)) / _NODES_AN_OCTAVE
        low = float(np.floor(request.surface.alpha / spacing) * spacing)
        nodes = Paraboloid(low), Paraboloid(low + float(spacing))
    return _Cell(request.bicycle, nodes, request.family, request.near is not None)


def _search_cell(cell: _Cell, requests: dict[int, MotionRequest]) -> Iterator[tuple[int, CircularMotion]]:
    """Yield the motions of a cell that are clear, by their key in ``requests``."""
    charts = [_follow_branches(cell.bicycle, node, cell.family, cell.every) for node in cell.nodes]  # type: ignore[arg-type]
    if any(chart is None for chart in charts):
        return
    halves = _halve_cell(cell) if _list_kinds(charts[0]) != _list_kinds(charts[1]) else None  # type: ignore[arg-type]
    if halves is not None:
        for half in halves:
            inside = {
                i: request for i, request in requests.items() if 0 <= _share_between(half.nodes, request.surface) < 1
            }
            if inside:
                yield from _search_cell(half, inside)
        return
    pairs = list(zip(*charts, strict=False))  # type: ignore[arg-type]
    by_branch: dict[tuple[int, bool], list[int]] = {}
    for i, request in requests.items():
        whole = len(charts[0]) == len(charts[1])  # type: ignore[arg-type]
        chosen = _choose_first(pairs, request.square) if request.near is None else _choose_nearest(pairs, request)
        if chosen is not None and (whole or request.near is None):
            by_branch.setdefault(chosen, []).append(i)
    for (k, mirrored), indices in by_branch.items():
        first, second = pairs[k]
        for i, motion in _carry(cell, first, second, {i: requests[i] for i in indices}):
            yield i, mirror_motion(motion) if mirrored else motion


def _list_kinds(chart: Sequence[_Branch]) -> list[tuple[tuple[int, bool], float]]:
    return [(branch.kind, branch.sign) for branch in chart]


def _halve_cell(cell: _Cell) -> tuple[_Cell, _Cell] | None:
    """Return both halves of a cell in which a curve changes its branches; None for a small one.

    The change lies in one of them, so that the full search is left with fewer motions.
    """
    low, high = cell.nodes
    if not (
        isinstance(low, Paraboloid) and isinstance(high, Paraboloid) and high.alpha - low.alpha > _SMALLEST * high.alpha
    ):
        return None
    middle = Paraboloid(0.5 * (low.alpha + high.alpha))
    return replace(cell, nodes=(low, middle)), replace(cell, nodes=(middle, high))


def _carry(
    cell: _Cell, first: _Branch, second: _Branch, requests: dict[int, MotionRequest]
) -> Iterator[tuple[int, CircularMotion]]:
    """Yield the motions on a branch that are certain."""
    asked, n = list(requests.values()), len(requests)
    terms = [rear_rate_condition(request.rear_rate).terms for request in asked]
    function, full, found = asked[0].surface.function, np.empty((n, 22)), np.empty(n, bool)
    _, _, _, aligned, constants = Steady(cell.bicycle, cell.nodes[0]).all_arguments
    try:
        carry_motions(
            first.points,
            second.points,
            first.sign,
            np.array([term.target for term in terms]),
            np.array([term.scale for term in terms]),
            np.array([_share_between(cell.nodes, request.surface) for request in asked]),
            np.array([request.surface.parameters for request in asked]),
            function.real,
            function.complex,
            aligned,
            constants,
            full,
            found,
        )
    except ZeroDivisionError:  # see `Steady.expand`
        return
    for i, request, unknowns, certain in zip(requests, asked, full, found, strict=True):
        if certain:
            yield i, Steady(request.bicycle, request.surface).motion(unknowns)


def _share_between(nodes: tuple[SurfaceOfRevolution, SurfaceOfRevolution], surface: SurfaceOfRevolution) -> float:
    low, high = nodes
    if not (isinstance(low, Paraboloid) and isinstance(high, Paraboloid) and isinstance(surface, Paraboloid)):
        return 0.0
    return (surface.alpha - low.alpha) / (high.alpha - low.alpha)


_Pairs = Sequence[tuple[_Branch, _Branch]]


def _place_rate(first: _Branch, second: _Branch, square: float) -> bool | None:
    """Return whether a squared rate is on a branch; None if that is not clear, or the branches differ in kind."""
    if first.kind != second.kind or first.sign != second.sign:
        return None
    (low1, high1), (low2, high2) = first.ends, second.ends
    margin_low = 2 * abs(low1 - low2) + _SHARE * square
    margin_high = 2 * abs(high1 - high2) + _SHARE * square
    if square < min(low1, low2) - margin_low or square > max(high1, high2) + margin_high:
        return False
    points = first.points.squares, second.points.squares
    if square < max(low1, low2) + margin_low or square > min(high1, high2) - margin_high:
        return None
    return True if all(len(each) > 1 and each[0] < square < each[-1] for each in points) else None


def _choose_first(pairs: _Pairs, square: float) -> tuple[int, bool] | None:
    """Return the index of the first branch with a squared rate; None if that is not clear."""
    for k, (first, second) in enumerate(pairs):
        placed = _place_rate(first, second, square)
        if placed is None:
            return None
        if placed:
            return k, False
    return None


def _choose_nearest(pairs: _Pairs, request: MotionRequest) -> tuple[int, bool] | None:
    """Return the branch with the nearest motion, and whether its mirror image is meant; None if that is not clear."""
    found: list[tuple[float, float, tuple[int, bool], np.ndarray]] = []
    for k, (first, second) in enumerate(pairs):
        placed = _place_rate(first, second, request.square)
        if placed is None:
            return None
        if placed:
            motions = np.empty((2, len(CHOSEN)))
            for branch, u in zip((first, second), motions, strict=True):
                motion_at(branch.points, request.square, u)
            for mirrored in (False, True):
                distances = [_distance(u, mirrored, request.near) for u in motions]
                found.append((min(distances), max(distances), (k, mirrored), motions))
    if not found:
        return None
    best = min(found, key=lambda each: each[1])
    least, largest, chosen, motions = best
    for other in found:
        same = other[2][1] == chosen[1] and np.abs(other[3] - motions).max() < _SAME
        if other is not best and not same and other[0] <= largest + (largest - least) + (other[1] - other[0]) + _SAME:
            return None
    return chosen if largest + (largest - least) + _SAME < NEAR_ENOUGH else None


def _distance(u: np.ndarray, mirrored: bool, near: Any) -> float:
    """Return the distance [rad] of a motion's angles from given ones; ``u`` are the nine unknowns."""
    side = -1.0 if mirrored else 1.0
    lean, steer = side * float(u[LEAN]), side * float(u[STEER])
    return float(np.hypot(wrap_angle(lean - near[0]), wrap_angle(steer - near[1])))


@lru_cache(maxsize=256)
def _follow_branches(
    bicycle: Bicycle, surface: SurfaceOfRevolution, family: int, every: bool
) -> Sequence[_Branch] | None:
    """Return a family's branches in the order in which the full search meets them; None where it cannot.

    Without ``every`` those of its first anchor only.
    """
    found: list[_Branch] = []
    anchors = []
    for k, rate in enumerate(ANCHORS[family]):
        try:
            start = anchor(bicycle, surface, family, rate)
            anchors.append(start)
            for j, towards in enumerate(start.directions):
                points = list(up_to_end(follow_curve(start.equations, start.unknowns, towards)))
                found += _divide(start.equations, points, 2 * k + j)
        except ValueError:
            return None
        if not every:
            return found
    for k, curve in enumerate(follow_other_parts(bicycle, surface, family, anchors)):
        found += _divide(curve.equations, curve.points, 100 + k)
    return found


def _divide(equations: Steady, points: Sequence[Point], curve: int) -> Iterator[_Branch]:
    """Divide a followed curve at the extrema of its rear rate; yield the branches in their order."""
    slopes = np.array([rear_rate_slope(point) for point in points])
    # The slope is zero at an end that stands.
    signs = np.where(slopes[1:-1] > 0, 1, -1) if len(points) > 2 else np.ones(0)
    folds = [int(k) + 1 for k in np.flatnonzero(np.diff(signs))]
    values = [_square(point) for point in points]
    extrema = [_square(root_between(equations, points[k], points[k + 1], rear_rate_slope)) for k in folds]
    ends = [values[0], *extrema, values[-1]]
    bounds = [0, *(k + 1 for k in folds), len(points)]
    for (begin, stop), (start, end) in zip(pairwise(bounds), pairwise(ends), strict=True):
        part, inner = points[begin:stop], values[begin:stop]
        rising = end > start
        order = slice(None) if rising else slice(None, None, -1)
        squares = np.array(inner[order])
        if len(part) < 2 or not np.all(np.diff(squares) > 0):
            squares = np.zeros(0)  # too short a branch for any motion to be clear
        yield _Branch(
            (curve, rising),
            BranchPoints(
                np.array([point.unknowns for point in part[order]]),
                np.array([point.tangent for point in part[order]]) * (1.0 if rising else -1.0),
                squares,
            ),
            (min(start, end), max(start, end)),
            _determinant_sign(equations, part[len(part) // 2]) if len(squares) else 0.0,
        )


def _square(point: Point) -> float:
    return float(point.unknowns[SIGMA] * point.unknowns[REAR_SPEED] ** 2)


def _determinant_sign(equations: Steady, point: Point) -> float:
    """Return the sign of the determinant of the equations and the rate's condition at a point; 0 if it is lost."""
    condition = rear_rate_condition(float(np.sqrt(SIGMA_UNIT * max(_square(point), 0.0))))
    u, full = point.unknowns[CHOSEN], np.empty(UNKNOWNS)
    iterations, sign = solve_motion(u, condition.terms, 8, *equations.all_arguments, full)
    return float(sign) if iterations else 0.0
