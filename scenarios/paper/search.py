"""All circular motions on a surface, without the families' anchors: curves followed from a grid of starts."""

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

_MOST = 25  # Newton steps
_SAME = 1e-5  # two solutions of one start's condition; each is known to round-off
_ON_CURVE = 0.1  # from a followed curve's nearest point: curves are followed in steps of as much
# Unknowns that mirroring left and right turns about: y, lean, steer, yaw speed, and at both contacts the
# position and the force across.
_ACROSS = [1, 3, 5, 6, 11, 14, 17, 20]


@dataclass(frozen=True)
class Grid:
    """Starts: angles on a grid, at rest, pivoting and at some rear rates that curves of benchmark size pass.

    Attributes
    ----------
    lean, steer : tuple
        Least, largest [rad], and number.
    rates : tuple of float
        [rad/s].
    """

    lean: tuple[float, float, int]
    steer: tuple[float, float, int]
    rates: tuple[float, ...]

    @property
    def described(self) -> str:
        """The starts in words."""
        (least, largest, leans), (first, last, steers) = self.lean, self.steer
        rates = ", ".join(f"{rate:g}" for rate in self.rates)
        return (
            f"Newton's method from {leans} leans of {least:g} to {largest:g} and {steers} steers of {first:g} to "
            f"{last:g} rad, at rest, pivoting, and at rear rates of {rates} rad/s, and the whole curves through what "
            "it finds; what no start leads to is not found"
        )


GRID = Grid((-1.2, 1.2, 7), (0.05, 3.09, 7), (4.0, 12.0, 18.0, 24.0))
# Starts of which none is one of the other grid's, nor at one of its rates: what both find is not a grid's chance.
OTHER_GRID = Grid((-1.3, 1.3, 6), (0.02, 3.12, 6), (2.0, 7.0, 15.0, 30.0))


@dataclass(frozen=True)
class FoundMotion:
    """What a search has found, with the steer in [0, pi].

    Attributes
    ----------
    equations : Steady
    static, pivoting : list of ndarray, shape (22,)
        Static equilibria and pivoting motions that circular motions lead to.
    curves : list of ndarray, shape (n, 22)
        Each from one end to the other, through a pivoting motion where it has one.
    described : str
        How it was searched.
    """

    equations: Steady
    static: list[np.ndarray]
    pivoting: list[np.ndarray]
    curves: list[np.ndarray]
    described: str

    @property
    def families(self) -> int:
        """Number of families: curves, cut where a wheel's rate changes sign in a pivoting motion."""
        return len(self.curves) + sum(_pivots(curve) for curve in self.curves)


def search_motions(equations: Steady, grid: Grid = GRID) -> FoundMotion:
    """Look for all circular motions of a bicycle on a surface."""
    static = list(_distinct(_solutions(equations, unknown_condition(SIGMA, 0.0), grid)))
    pivoting = list(_distinct(_solutions(equations, unknown_condition(REAR_SPEED, 0.0), grid)))
    starts = [*static, *pivoting]
    for rate in grid.rates:
        starts += _solutions(equations, rear_rate_condition(rate), grid)
    curves: list[np.ndarray] = []
    for start in starts:
        if all(distance(curve, start) > _ON_CURVE for curve in curves):
            curves.append(_whole(equations, start))
    return FoundMotion(equations, static, pivoting, curves, grid.described)


def find_missing(one: FoundMotion, other: FoundMotion) -> int:
    """Number of equilibria, pivoting motions and curves that one of two searches has and the other has not."""
    lone = sum(abs(len(getattr(one, what)) - len(getattr(other, what))) for what in ("static", "pivoting", "curves"))
    for first, second in ((one, other), (other, one)):
        for what in ("static", "pivoting"):
            known = [search_coordinates(u) for u in getattr(second, what)]
            lone += sum(
                all(np.abs(search_coordinates(u) - k).max() > _SAME for k in known) for u in getattr(first, what)
            )
        # In the middle of a curve: at their ends two followed curves may differ by a step.
        middles = [curve[len(curve) // 2] for curve in first.curves]
        lone += sum(all(distance(curve, u) > _ON_CURVE for curve in second.curves) for u in middles)
    return lone


def mirrored(unknowns: np.ndarray) -> np.ndarray:
    """The same solution with left and right exchanged."""
    other = unknowns.copy()
    other[_ACROSS] *= -1
    return other


def search_coordinates(unknowns: np.ndarray) -> np.ndarray:
    """Where solutions (..., 22) lie: lean, steer, pitch, and angles of bounded size for radius and speed."""
    radius = np.hypot(unknowns[..., 0], unknowns[..., 1])
    parts = (*np.moveaxis(unknowns[..., [LEAN, STEER, PITCH]], -1, 0), np.arctan(radius / 5))
    return np.stack([*parts, np.arctan(unknowns[..., SIGMA])], axis=-1)


def distance(curve: np.ndarray, unknowns: np.ndarray) -> float:
    """Distance of a solution from the points of a curve (n, 22), in `search_coordinates`."""
    return float(np.linalg.norm(search_coordinates(curve) - search_coordinates(unknowns), axis=1).min())


def _pivots(curve: np.ndarray) -> int:
    return len(sign_changes(curve[:, REAR_SPEED], STANDING))


def _solutions(equations: Steady, condition: Callable, grid: Grid) -> Iterator[np.ndarray]:
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
            if _possible(equations, unknowns):
                yield unknowns


def _possible(equations: Steady, unknowns: np.ndarray) -> bool:
    """Whether a solution is a motion of a bicycle that stands on its wheels, above the ground."""
    return bool(unknowns[SIGMA] >= -1e-9) and above_ground(equations, unknowns)


def _distinct(solutions: Iterator[np.ndarray]) -> Iterator[np.ndarray]:
    seen: list[np.ndarray] = []
    for unknowns in solutions:
        if all(np.abs(search_coordinates(unknowns) - other).max() > _SAME for other in seen):
            seen.append(search_coordinates(unknowns))
            yield unknowns


def _whole(equations: Steady, start: np.ndarray) -> np.ndarray:
    """The curve through a solution, followed both ways."""
    along = np.eye(UNKNOWNS)[STEER]
    one, other = ([p.unknowns for p in follow_curve(equations, start, s * along, _ON_CURVE)] for s in (1, -1))
    return np.array([*reversed(other), *one[1:]])
