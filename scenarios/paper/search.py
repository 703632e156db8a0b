"""Search for all circular motions on a surface without the families' anchors, from a grid of starts."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from ...reference.anchors import above_ground, start_on_plane
from ...reference.circular import (
    LEAN,
    PITCH,
    REAR_SPEED,
    SIGMA,
    STEER,
    Steady,
    newton,
    rear_rate_condition,
    unknown_condition,
)
from ...reference.continuation import follow_curve, sign_changes
from ...reference.kernels.steady import STANDING, UNKNOWNS

_MOST = 25  # largest number of Newton steps
_SAME = 1e-5  # distance of solutions of one start's condition that are the same; each is accurate to round-off
_ON_CURVE = 0.1  # distance from a curve's nearest point at which a solution is on it: the step of following curves
# Unknowns whose sign changes with left and right exchanged: y, lean, steer, yaw speed, and at both contacts the
# lateral position and force.
_ACROSS = [1, 3, 5, 6, 11, 14, 17, 20]


@dataclass(frozen=True)
class Grid:
    """Starts of a search: angles on a grid, at rest, pivoting and at rear rates of curves of the benchmark's size.

    Attributes
    ----------
    lean, steer : tuple
        Smallest, largest [rad], and number.
    rates : tuple of float
        [rad/s].
    """

    lean: tuple[float, float, int]
    steer: tuple[float, float, int]
    rates: tuple[float, ...]

    @property
    def described(self) -> str:
        """The starts as text."""
        (least, largest, leans), (first, last, steers) = self.lean, self.steer
        rates = ", ".join(f"{rate:g}" for rate in self.rates)
        return (
            f"Newton's method from {leans} leans of {least:g} to {largest:g} and {steers} steers of {first:g} to "
            f"{last:g} rad, at rest, pivoting, and at rear rates of {rates} rad/s, and the whole curves through what "
            "it finds; what no start leads to is not found"
        )


GRID = Grid((-1.2, 1.2, 7), (0.05, 3.09, 7), (4.0, 12.0, 18.0, 24.0))
# None of these starts, nor any of the rates, is in the other grid: what both find does not depend on the grid.
OTHER_GRID = Grid((-1.3, 1.3, 6), (0.02, 3.12, 6), (2.0, 7.0, 15.0, 30.0))


@dataclass(frozen=True)
class FoundMotion:
    """Result of a search, with the steer in [0, pi].

    Attributes
    ----------
    equations : Steady
    static, pivoting : list of ndarray, shape (22,)
        Static equilibria and pivoting motions that circular motions lead to.
    curves : list of ndarray, shape (n, 22)
        Each from one end to the other, through a pivoting motion where it has one.
    described : str
        Description of the search.
    """

    equations: Steady
    static: list[np.ndarray]
    pivoting: list[np.ndarray]
    curves: list[np.ndarray]
    described: str

    @property
    def families(self) -> int:
        """Number of families: curves, cut where a wheel's rate changes sign in a pivoting motion."""
        return len(self.curves) + sum(_count_pivots(curve) for curve in self.curves)


def search_motions(equations: Steady, grid: Grid = GRID) -> FoundMotion:
    """Search for all circular motions of a bicycle on a surface."""
    static = list(_drop_repeated(_solve_from_grid(equations, unknown_condition(SIGMA, 0.0), grid)))
    pivoting = list(_drop_repeated(_solve_from_grid(equations, unknown_condition(REAR_SPEED, 0.0), grid)))
    starts = [*static, *pivoting]
    for rate in grid.rates:
        starts += _solve_from_grid(equations, rear_rate_condition(rate), grid)
    curves: list[np.ndarray] = []
    for start in starts:
        if all(distance(curve, start) > _ON_CURVE for curve in curves):
            curves.append(_follow_both_ways(equations, start))
    return FoundMotion(equations, static, pivoting, curves, grid.described)


def find_missing(one: FoundMotion, other: FoundMotion) -> int:
    """Count the equilibria, pivoting motions and curves that only one of two searches has found."""
    lone = sum(abs(len(getattr(one, what)) - len(getattr(other, what))) for what in ("static", "pivoting", "curves"))
    for first, second in ((one, other), (other, one)):
        for what in ("static", "pivoting"):
            known = [search_coordinates(u) for u in getattr(second, what)]
            lone += sum(
                all(np.abs(search_coordinates(u) - k).max() > _SAME for k in known) for u in getattr(first, what)
            )
        # The middle of a curve is compared: at their ends two followed curves may differ by a step.
        middles = [curve[len(curve) // 2] for curve in first.curves]
        lone += sum(all(distance(curve, u) > _ON_CURVE for curve in second.curves) for u in middles)
    return lone


def mirrored(unknowns: np.ndarray) -> np.ndarray:
    """Return the same solution with left and right exchanged."""
    other = unknowns.copy()
    other[_ACROSS] *= -1
    return other


def search_coordinates(unknowns: np.ndarray) -> np.ndarray:
    """Return coordinates of solutions (..., 22): lean, steer, pitch, and bounded angles for radius and speed."""
    radius = np.hypot(unknowns[..., 0], unknowns[..., 1])
    parts = (*np.moveaxis(unknowns[..., [LEAN, STEER, PITCH]], -1, 0), np.arctan(radius / 5))
    return np.stack([*parts, np.arctan(unknowns[..., SIGMA])], axis=-1)


def distance(curve: np.ndarray, unknowns: np.ndarray) -> float:
    """Return the distance of a solution from the points of a curve (n, 22), in `search_coordinates`."""
    return float(np.linalg.norm(search_coordinates(curve) - search_coordinates(unknowns), axis=1).min())


def _count_pivots(curve: np.ndarray) -> int:
    return len(sign_changes(curve[:, REAR_SPEED], STANDING))


def _solve_from_grid(equations: Steady, condition: Callable, grid: Grid) -> Iterator[np.ndarray]:
    for lean in np.linspace(*grid.lean):
        for steer in np.linspace(*grid.steer):
            try:
                start = start_on_plane(equations.bicycle, float(lean), float(steer))
                unknowns, _ = newton(equations, start, condition, most=_MOST)
            except ValueError:
                continue
            unknowns[[LEAN, PITCH, STEER]] = (unknowns[[LEAN, PITCH, STEER]] + np.pi) % (2 * np.pi) - np.pi
            if unknowns[STEER] < 0:
                unknowns = mirrored(unknowns)
            if _is_possible(equations, unknowns):
                yield unknowns


def _is_possible(equations: Steady, unknowns: np.ndarray) -> bool:
    """Return whether a solution is a motion of a bicycle that stands on its wheels, above the ground."""
    return bool(unknowns[SIGMA] >= -1e-9) and above_ground(equations, unknowns)


def _drop_repeated(solutions: Iterator[np.ndarray]) -> Iterator[np.ndarray]:
    known: list[np.ndarray] = []
    for unknowns in solutions:
        if all(np.abs(search_coordinates(unknowns) - other).max() > _SAME for other in known):
            known.append(search_coordinates(unknowns))
            yield unknowns


def _follow_both_ways(equations: Steady, start: np.ndarray) -> np.ndarray:
    """Follow the curve through a solution both ways."""
    along = np.eye(UNKNOWNS)[STEER]
    forward, backward = ([p.unknowns for p in follow_curve(equations, start, s * along, _ON_CURVE)] for s in (1, -1))
    return np.array([*reversed(backward), *forward[1:]])
