"""All circular motions on a surface, without the families' anchors: curves followed from a grid of starts."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from reference.anchors import above_ground, start_on_plane
from reference.circular import (
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
from reference.continuation import follow, sign_changes
from reference.kernels.steady import STANDING, UNKNOWNS

# Starts: angles on a grid, at rest, pivoting and at some rear rates that curves of benchmark size pass.
_LEANS, _STEERS, _RATES = np.linspace(-1.2, 1.2, 7), np.linspace(0.05, 3.09, 7), (4.0, 12.0, 18.0, 24.0)
_MOST = 25  # Newton steps
_SAME = 1e-5  # two solutions of one start's condition; each is known to round-off
_ON_CURVE = 0.1  # from a followed curve's nearest point: curves are followed in steps of as much
# Unknowns that mirroring left and right turns about: y, lean, steer, yaw speed, and at both contacts the
# position and the force across.
_ACROSS = [1, 3, 5, 6, 11, 14, 17, 20]


@dataclass(frozen=True)
class Found:
    """What a search has found, with the steer in [0, pi].

    Attributes
    ----------
    equations : Steady
    static, pivoting : list of ndarray, shape (22,)
        Static equilibria and pivoting motions that circular motions lead to.
    curves : list of ndarray, shape (n, 22)
        Each from one end to the other, through a pivoting motion where it has one.
    """

    equations: Steady
    static: list[np.ndarray]
    pivoting: list[np.ndarray]
    curves: list[np.ndarray]

    @property
    def families(self) -> int:
        """Number of families: curves, cut where a wheel's rate changes sign in a pivoting motion."""
        return len(self.curves) + sum(_pivots(curve) for curve in self.curves)


def search(equations: Steady) -> Found:
    """Look for all circular motions of a bicycle on a surface."""
    static = list(_distinct(_solutions(equations, unknown_condition(SIGMA, 0.0))))
    pivoting = list(_distinct(_solutions(equations, unknown_condition(REAR_SPEED, 0.0))))
    starts = [*static, *pivoting]
    for rate in _RATES:
        starts += _solutions(equations, rear_rate_condition(rate))
    curves: list[np.ndarray] = []
    for start in starts:
        if all(distance(curve, start) > _ON_CURVE for curve in curves):
            curves.append(_whole(equations, start))
    return Found(equations, static, pivoting, curves)


def mirrored(unknowns: np.ndarray) -> np.ndarray:
    """The same solution with left and right exchanged."""
    other = unknowns.copy()
    other[_ACROSS] *= -1
    return other


def coordinates(unknowns: np.ndarray) -> np.ndarray:
    """Where solutions (..., 22) lie: lean, steer, pitch, and angles of bounded size for radius and speed."""
    radius = np.hypot(unknowns[..., 0], unknowns[..., 1])
    parts = (*np.moveaxis(unknowns[..., [LEAN, STEER, PITCH]], -1, 0), np.arctan(radius / 5))
    return np.stack([*parts, np.arctan(unknowns[..., SIGMA])], axis=-1)


def distance(curve: np.ndarray, unknowns: np.ndarray) -> float:
    """Distance of a solution from the points of a curve (n, 22), in `coordinates`."""
    return float(np.linalg.norm(coordinates(curve) - coordinates(unknowns), axis=1).min())


def _pivots(curve: np.ndarray) -> int:
    return len(sign_changes(curve[:, REAR_SPEED], STANDING))


def _solutions(equations: Steady, condition: Callable) -> Iterator[np.ndarray]:
    for lean in _LEANS:
        for steer in _STEERS:
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
        if all(np.abs(coordinates(unknowns) - other).max() > _SAME for other in seen):
            seen.append(coordinates(unknowns))
            yield unknowns


def _whole(equations: Steady, start: np.ndarray) -> np.ndarray:
    """The curve through a solution, followed both ways."""
    along = np.eye(UNKNOWNS)[STEER]
    one, other = ([p.unknowns for p in follow(equations, start, s * along, _ON_CURVE)] for s in (1, -1))
    return np.array([*reversed(other), *one[1:]])
