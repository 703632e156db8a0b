"""Stability along a family: eigenvalues and the Lyapunov-stable sections."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .circular import CircularMotion, Steady
from .continuation import Point, least_between, roots_along
from .curve import Samples, sample_curve
from .families import Family
from .stability import Linearisation, free_eigenvalues, linearise


@dataclass(frozen=True)
class SectionEnd:
    """One end of a stable section.

    Attributes
    ----------
    cause : str
        ``hopf`` where a pair of eigenvalues crosses the imaginary axis, ``energy`` where a real eigenvalue crosses
        zero (there the energy is extreme along the family), ``end`` where the family itself ends stable.
    motion : CircularMotion
    eigenvalue : complex
        The crossing eigenvalue, of positive imaginary part [1/s].
    point : Point
    place : int
        Index of the last of the family's points before it.
    """

    cause: str
    motion: CircularMotion
    eigenvalue: complex
    point: Point
    place: int


def linearise_point(equations: Steady, point: Point) -> tuple[CircularMotion, Linearisation]:
    """Return the motion and the reduced linear system at a point of a family."""
    motion = equations.motion(point.unknowns)
    return motion, linearise(equations.bicycle, equations.surface, *motion.state(), equations.inputs)


def growth_along(equations: Steady, point: Point) -> float:
    """Return the growth rate of disturbances at a point of a family [1/s]."""
    return float(sample_curve(equations, point.unknowns[None]).growth_rate[0])


def sample_family(family: Family) -> Samples:
    """Evaluate all points of a family."""
    return sample_curve(family.equations, np.array([point.unknowns for point in family.points]))


def stable_sections(family: Family, growth: np.ndarray | None = None) -> list[tuple[SectionEnd, SectionEnd]]:
    """Find the Lyapunov-stable sections of a family, both ends solved to round-off.

    A section may lie between two points that are both unstable. Where the growth rate has a minimum among the points
    and falls steeply enough to reach zero, the minimum between the points is therefore searched for.

    Parameters
    ----------
    family : Family
    growth : ndarray, shape (n,), optional
        Growth rates of its points, where they are known already.

    Returns
    -------
    list of (SectionEnd, SectionEnd)
        In the order of the family's points.
    """
    equations = family.equations
    points, rates, places = _insert_minima(family, sample_family(family).growth_rate if growth is None else growth)
    ends = [
        _make_end(equations, root, places[i])
        for i, root in roots_along(equations, points, lambda point: growth_along(equations, point), rates)
    ]
    signed = [rate for rate in rates if rate != 0] or [0.0]
    if signed[0] < 0:
        ends.insert(0, _make_end(equations, points[0], 0, "end"))
    if signed[-1] < 0:
        ends.append(_make_end(equations, points[-1], len(family.points) - 2, "end"))
    return list(zip(ends[::2], ends[1::2], strict=True))


def _insert_minima(family: Family, growth: np.ndarray) -> tuple[list[Point], list[float], list[int]]:
    """Return the points and growth rates of a family, with points added where the growth rate dips below zero.

    The third list has the index of the last of the family's own points up to each.
    """
    equations = family.equations
    points, rates, places = [family.points[0]], [float(growth[0])], [0]
    for i in range(1, len(growth)):
        before, here = family.points[i - 1], family.points[i]
        if _may_dip(growth, i):
            low = least_between(equations, before, here, lambda point: growth_along(equations, point))
            rate = growth_along(equations, low)
            if rate < 0:
                points.append(low)
                rates.append(rate)
                places.append(i - 1)
        points.append(here)
        rates.append(float(growth[i]))
        places.append(i)
    return points, rates, places


def _may_dip(growth: np.ndarray, i: int) -> bool:
    """Return whether the growth rate may be negative between the positive ones at i - 1 and i.

    The dip lies on one side of a minimum among the points or the other. The growth rate is the largest of several
    smooth functions, so it stays above the continuation from each side; three times the slope leaves room for
    curvature.
    """
    if min(growth[i - 1], growth[i]) <= 0 or not (_is_minimum(growth, i - 1) or _is_minimum(growth, i)):
        return False
    before, after = growth[max(i - 2, 0)], growth[min(i + 1, len(growth) - 1)]
    return max(growth[i - 1] - 3 * (before - growth[i - 1]), growth[i] - 3 * (after - growth[i])) < 0


def _is_minimum(values: np.ndarray, i: int) -> bool:
    return 0 < i < len(values) - 1 and values[i] <= min(values[i - 1], values[i + 1])


def _make_end(equations: Steady, point: Point, place: int, cause: str | None = None) -> SectionEnd:
    motion, reduced = linearise_point(equations, point)
    free = free_eigenvalues(equations.surface, reduced.eigenvalues, motion.yaw_rate)
    critical = max(free, key=lambda value: (value.real, value.imag))
    # A double zero splits by the square root of round-off, 1e-7; the slowest pair that crosses has about 1 rad/s.
    turning = abs(critical.imag) > 1e-3
    eigenvalue = complex(critical.real, abs(critical.imag) if turning else 0.0)
    return SectionEnd(cause or ("hopf" if turning else "energy"), motion, eigenvalue, point, place)
