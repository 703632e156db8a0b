"""Critical shapes of the bowl: where families exchange parts, and where their last stable section vanishes.

Two curves touch where the Jacobian of the steady equations loses a rank. The eight equations
F(u, alpha) = 0 in nine unknowns (`velodrome.reference.kernels.circle`) have full rank on a curve, and the touching
point is a regular root of

    F(u, alpha) = 0,    w . dF/du = 0,    |w|^2 = 1

in u (9), alpha and w (8). A stable section vanishes where its two ends meet: where one pair of
eigenvalues touches the imaginary axis, or where two pairs cross it at the same point.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from .bicycle import Bicycle
from .circular import LEAN, SIGMA, STEER, CircularMotion, Steady, newton, plane_condition
from .continuation import Point, metric
from .families import FAMILIES, trace
from .kernels.circle import COORDINATES
from .kernels.curve import CHOSEN
from .rideability import explain_motion
from .sections import SectionEnd, linearise_point, stable_sections
from .stability import linearise
from .surface import Paraboloid

_STEP = 1e-6  # relative step of central differences; their errors affect only the convergence of Newton's method
_SCAN = np.linspace(0.0, 1.0, 41)
_BRACKET = 2e-3
_SECTION_BRACKET = 2e-7
_NEAR_BRACKET = 1e3 * _SECTION_BRACKET  # a section whose ends are too near to be seen is longer gone than the bracket


@dataclass(frozen=True)
class CriticalPoint:
    """A motion at a critical alpha.

    Attributes
    ----------
    families : tuple of int
    alpha : float
        [1/m].
    motion : CircularMotion
    residual : float
        Largest residual of the defining equations; the growth rate [1/s] where a section vanishes.
    kind : str
        ``reconnection``; ``tangency`` or ``crossing`` where a stable section vanishes.
    unphysical_because : tuple of str
        Why the motion cannot be ridden; empty if it can.
    """

    families: tuple[int, ...]
    alpha: float
    motion: CircularMotion
    residual: float
    kind: str
    unphysical_because: tuple[str, ...]


def reconnections(
    bicycle: Bicycle, progress: Callable[[float], None] = lambda _: None, largest: float = 1.0
) -> list[CriticalPoint]:
    """Find all alpha up to ``largest`` at which family 1 or 2 exchanges a part with another family.

    Parameters
    ----------
    bicycle : Bicycle
    progress : callable
        Called with the alpha reached.
    largest : float
        [1/m].

    Returns
    -------
    list of CriticalPoint
        In order of rising alpha.
    """
    found: list[CriticalPoint] = []
    for number in (1, 2):
        for low, high in _bracket_changes(bicycle, number, largest, progress):
            point = _find_touching_point(bicycle, number, low, high)
            # Both families of a pair lead to the same point.
            if point is not None and not any(abs(point.alpha - other.alpha) < 1e-9 for other in found):
                found.append(point)
    return sorted(found, key=lambda point: point.alpha)


def _passing_families(bicycle: Bicycle, motion: CircularMotion, low: float, high: float) -> tuple[int, ...]:
    """Return the families whose curves pass near a touching point on either side of its alpha."""
    passing = []
    for number in FAMILIES:
        gaps = []
        for alpha in (low, high):
            try:
                points = trace(bicycle, Paraboloid(alpha), number, 0.03).points
            except ValueError:
                continue
            gaps += [np.hypot(p.unknowns[LEAN] - motion.lean, p.unknowns[STEER] - motion.steer) for p in points]
        # Points lie 0.03 apart, and curves about the square root of the bracket from the touching point.
        if gaps and min(gaps) < 0.06:
            passing.append(number)
    return tuple(passing)


@lru_cache(maxsize=1024)
def _follow_at(bicycle: Bicycle, alpha: float, number: int) -> tuple[tuple[str, str] | None, str]:
    """Return the ends of a family, or None and the reason if it cannot be followed."""
    try:
        return trace(bicycle, Paraboloid(alpha), number).ends, ""
    except ValueError as error:
        return None, str(error)


def _trace_ends(bicycle: Bicycle, alpha: float, number: int) -> tuple[str, str] | None:
    return _follow_at(bicycle, alpha, number)[0]


def describe_gaps(bicycle: Bicycle, number: int, largest: float = 1.0) -> str | None:
    """Say at which of the scanned alpha a family cannot be followed, so that nothing critical of it is found there.

    Parameters
    ----------
    bicycle : Bicycle
    number : int
        Family.
    largest : float
        Largest alpha scanned [1/m].

    Returns
    -------
    str or None
        None where it is followed at every alpha.
    """
    grid = [float(alpha) for alpha in _SCAN if alpha <= largest]
    lost = [alpha for alpha in grid if _trace_ends(bicycle, alpha, number) is None]
    if not lost:
        return None
    reason = _follow_at(bicycle, lost[0], number)[1]
    if len(lost) == len(grid):
        return f"no curve at any alpha from 0 to {largest:g}: {reason}"
    return f"no curve at {len(lost)} of {len(grid)} alpha from {lost[0]:g} to {lost[-1]:g}: {reason}"


def _bracket_changes(
    bicycle: Bicycle, number: int, largest: float, progress: Callable[[float], None]
) -> Iterator[tuple[float, float]]:
    """Yield the brackets of alpha in which the ends of a family change."""
    grid = [float(alpha) for alpha in _SCAN if alpha <= largest]
    before = _trace_ends(bicycle, grid[0], number)
    for i in range(1, len(grid)):
        here = _trace_ends(bicycle, grid[i], number)
        progress(grid[i])
        if here != before:
            low, high = grid[i - 1], grid[i]
            while high - low > _BRACKET:
                middle = 0.5 * (low + high)
                low, high = (middle, high) if _trace_ends(bicycle, middle, number) == before else (low, middle)
            yield low, high
        before = here


def _find_touching_point(bicycle: Bicycle, number: int, low: float, high: float) -> CriticalPoint | None:
    """Solve for the touching point near a family; None where its ends change without such a point."""
    family = trace(bicycle, Paraboloid(low), number, 0.05)
    jacobians = [family.equations.expand(point.unknowns[CHOSEN]).jacobian for point in family.points]
    rank = [float(np.linalg.svd(jacobian)[1][-1]) for jacobian in jacobians]
    dips = [i for i in range(1, len(rank) - 1) if rank[i] <= min(rank[i - 1], rank[i + 1])]
    for i in sorted(dips, key=lambda i: rank[i]):
        try:
            unknowns, alpha, residual = _solve_touching(bicycle, family.points[i].unknowns, low)
        except (ValueError, np.linalg.LinAlgError):
            continue
        if low - 5 * _BRACKET < alpha < high + 5 * _BRACKET and unknowns[SIGMA] > 0:
            motion = Steady(bicycle, Paraboloid(alpha)).motion(unknowns)
            families, why = (
                _passing_families(bicycle, motion, low, high),
                explain_motion(bicycle, Paraboloid(alpha), motion),
            )
            return CriticalPoint(families, alpha, motion, residual, "reconnection", why)
    return None


def _solve_touching(bicycle: Bicycle, unknowns: np.ndarray, alpha: float) -> tuple[np.ndarray, float, float]:
    """Solve the 18 equations by Newton's method; return the unknowns, alpha and the residual."""

    def equations(x: np.ndarray) -> np.ndarray:
        here, w = Steady(bicycle, Paraboloid(float(x[COORDINATES]))).expand(x[:COORDINATES]), x[COORDINATES + 1 :]
        return np.concatenate([here.rows, w @ here.jacobian, [w @ w - 1]])

    start = Steady(bicycle, Paraboloid(alpha)).expand(unknowns[CHOSEN]).jacobian
    x = np.concatenate([unknowns[CHOSEN], [alpha], np.linalg.svd(start)[0][:, -1]])
    values = equations(x)
    for _ in range(30):
        step = np.linalg.solve(_difference_jacobian(equations, x), -values)
        size = float(np.abs(step / (1 + np.abs(x))).max())
        x = x + step * min(1.0, 0.2 / size)
        values = equations(x)
        # The equations' round-off, 1e-14, times their condition number, about 1e3, lies below.
        if size < 1e-10:
            alpha = float(x[COORDINATES])
            full = Steady(bicycle, Paraboloid(alpha)).expand(x[:COORDINATES]).full
            return full, alpha, float(np.abs(values).max())
    raise ValueError("no touching point near the guess")


def _difference_jacobian(function: Callable[[np.ndarray], np.ndarray], x: np.ndarray) -> np.ndarray:
    columns = []
    for j in range(len(x)):
        e = np.zeros(len(x))
        e[j] = _STEP * (1 + abs(x[j]))
        columns.append((function(x + e) - function(x - e)) / (2 * e[j]))
    return np.array(columns).T


def last_stable(bicycle: Bicycle, number: int, largest: float = 1.0) -> CriticalPoint | None:
    """Find where the last Lyapunov-stable section of a family vanishes as alpha grows.

    Parameters
    ----------
    bicycle : Bicycle
    number : int
        Family.
    largest : float
        Largest alpha scanned [1/m].

    Returns
    -------
    CriticalPoint or None
        None where the family has no stable section at any alpha of the scan.

    Raises
    ------
    ValueError
        If the family is still stable at the largest alpha, or `vanishing_between` raises it.
    """
    grid = [0.0, 0.0025, 0.005, 0.0075, *(float(alpha) for alpha in _SCAN[1:] if alpha <= largest)]
    grid = sorted({*grid, 0.01, 0.015, 0.02, 0.03, 0.035, 0.04})
    stable = [alpha for alpha in grid if _find_sections(bicycle, alpha, number)]
    if not stable:
        return None
    low = stable[-1]
    high = next((alpha for alpha in grid if alpha > low), None)
    if high is None:
        raise ValueError(f"it is stable beyond alpha = {largest:g}")
    return vanishing_between(bicycle, number, low, high)


def vanishing_between(bicycle: Bicycle, number: int, stable: float, unstable: float) -> CriticalPoint:
    """Find where a family's last stable section vanishes between an alpha that has one and an alpha that has none.

    Parameters
    ----------
    bicycle : Bicycle
    number : int
        Family.
    stable, unstable : float
        Alphas with and without a stable section [1/m].

    Returns
    -------
    CriticalPoint

    Raises
    ------
    ValueError
        If the family cannot be followed up to that point, or the point cannot be solved.
    """
    while abs(unstable - stable) > _SECTION_BRACKET:
        middle = 0.5 * (stable + unstable)
        stable, unstable = (middle, unstable) if _find_sections(bicycle, middle, number) else (stable, middle)
    where = f"its last stable section vanishes at alpha = {stable:.6g}"
    if _trace_ends(bicycle, unstable, number) is None:
        reason = _follow_at(bicycle, unstable, number)[1]
        raise ValueError(f"it is stable up to alpha = {stable:.6g}, beyond which it has no curve: {reason}")
    try:
        point = _solve_vanishing(bicycle, number, stable)
    except (ValueError, np.linalg.LinAlgError) as error:
        if _trace_ends(bicycle, unstable, number) != _trace_ends(bicycle, stable, number):
            raise ValueError(
                f"it loses its last stable section at alpha = {stable:.6g} with a part of its curve"
            ) from error
        how = "its equations are singular" if isinstance(error, np.linalg.LinAlgError) else str(error)
        raise ValueError(f"{where}, but the point is not solved: {how}") from error
    if abs(point.alpha - stable) > _NEAR_BRACKET:
        raise ValueError(f"{where}, but the point solved for is another one, at {point.alpha:.6g}")
    return point


def _find_sections(bicycle: Bicycle, alpha: float, number: int) -> list[tuple[SectionEnd, SectionEnd]]:
    try:
        return stable_sections(trace(bicycle, Paraboloid(alpha), number, 0.05))
    except ValueError:
        return []


def _solve_vanishing(bicycle: Bicycle, number: int, alpha: float) -> CriticalPoint:
    """Solve for the point where the ends of a section meet, starting from an alpha just before it vanishes."""
    from scipy.optimize import minimize_scalar  # takes half a second

    ends = _find_sections(bicycle, alpha, number)[-1]
    family = trace(bicycle, Paraboloid(alpha), number, 0.02)
    middle = 0.5 * (ends[0].motion.lean + ends[1].motion.lean), 0.5 * (ends[0].motion.steer + ends[1].motion.steer)
    near = min(family.points, key=lambda p: np.hypot(p.unknowns[LEAN] - middle[0], p.unknowns[STEER] - middle[1]))
    covector = metric(near.unknowns) * near.tangent

    def eigenvalues(distance: float, shape: float) -> tuple[CircularMotion, np.ndarray]:
        equations = Steady(bicycle, Paraboloid(shape))
        guess = near.unknowns + distance * near.tangent
        u, _ = newton(equations, guess, plane_condition(near.unknowns, covector, distance), most=30)
        motion, reduced = linearise_point(equations, Point(u, near.tangent))
        return motion, reduced.eigenvalues

    tracked = [end.eigenvalue.imag for end in ends]
    # A single pair that touches the axis has nearly the same frequency at both ends, far from the other pair's.
    surface = Paraboloid(alpha)
    others = [
        abs(value.imag - imaginary)
        for end, imaginary in zip(ends, tracked, strict=True)
        for value in linearise(bicycle, surface, *end.motion.state()).eigenvalues
        if value.imag > 1e-3 and abs(value.imag - imaginary) > 1e-6
    ]
    kind = "tangency" if abs(tracked[0] - tracked[1]) < 0.5 * min(others, default=np.inf) else "crossing"

    def growth(x: np.ndarray, imaginary: float) -> float:
        values = eigenvalues(float(x[0]), float(x[1]))[1]
        upper = [value for value in values if value.imag > 1e-3]
        return min(upper, key=lambda value: abs(value.imag - imaginary) + abs(value.real)).real

    def equations(x: np.ndarray) -> np.ndarray:
        if kind == "crossing":
            return np.array([growth(x, imaginary) for imaginary in tracked])
        mean, h = 0.5 * (tracked[0] + tracked[1]), np.array([1e-5, 0.0])
        return np.array([growth(x, mean), (growth(x + h, mean) - growth(x - h, mean)) / 2e-5])

    def worst(distance: float) -> float:
        return max(value.real for value in eigenvalues(distance, alpha)[1] if value.imag > 1e-3)

    # The section is shorter than the distance of the points: start where the growth rate is least near the point.
    rough = min(np.linspace(-0.03, 0.03, 61), key=worst)
    fine: Any = minimize_scalar(worst, bounds=(rough - 1e-3, rough + 1e-3), method="bounded", options={"xatol": 1e-8})
    x = np.array([float(fine.x), alpha])
    for _ in range(20):
        values = equations(x)
        step = np.linalg.solve(_difference_jacobian(equations, x), -values)
        x = x + step
        # The derivative along the arc is known to 1e-6; alpha depends on it in second order only.
        if abs(step[1]) < 1e-12 and abs(step[0]) < 1e-5:
            break
    else:
        raise ValueError("Newton's method does not converge")
    motion, _ = eigenvalues(float(x[0]), float(x[1]))
    # Growth rate at the point. At a tangency its slope is the other equation, whose round-off moves the point only
    # along the arc.
    left = equations(x)[:1] if kind == "tangency" else equations(x)
    why = explain_motion(bicycle, Paraboloid(float(x[1])), motion)
    return CriticalPoint((number,), float(x[1]), motion, float(np.abs(left).max()), kind, why)
