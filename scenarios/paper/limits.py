"""Limits of flat bicycles: families followed towards a lean of +-pi/2, at fixed leans."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...reference.circular import LEAN, STEER, Steady, newton, unknown_condition

_NEAREST = 2e-3  # [rad] from +-pi/2: nearer, forces are so large that their round-off affects the other rows
_MOST = 40


@dataclass(frozen=True)
class FlatLimit:
    """The last motion of a sequence in which the lean's distance from +-pi/2 is halved in each step.

    Attributes
    ----------
    distance : float
        Distance of the lean from its limit [rad].
    front_rate : float
        [rad/s].
    rate_exponent, steer_exponent : float
        Exponents of the powers of the distance by which the front rate and the steer's distance from its limit change.
    steer : float
        Limit of the steer, extrapolated from the last three motions [rad].
    radius : float
        Radius of D's circle [m].
    residual : float
        Largest residual of the equations on the way, relative to the largest force.
    """

    distance: float
    front_rate: float
    rate_exponent: float
    steer_exponent: float
    steer: float
    radius: float
    residual: float


def find_limit(equations: Steady, ends: Sequence[np.ndarray], side: int) -> FlatLimit:
    """Follow the flat end among a curve's two ends (22,) towards a lean of pi/2 (side 1) or -pi/2 (side -1).

    Raises
    ------
    ValueError
        If neither end is flat to that side, or Newton's method fails on the way.
    """
    unknowns = max(ends, key=lambda u: side * u[LEAN])
    distance = np.pi / 2 - side * unknowns[LEAN]
    if distance > 1:
        raise ValueError("the curve has no flat end there")
    rows: list[tuple[float, float, float, float]] = []
    residual = 0.0
    while distance > _NEAREST or len(rows) < 3:
        distance /= 2
        condition = unknown_condition(LEAN, side * (np.pi / 2 - distance))
        unknowns, _ = newton(equations, unknowns, condition, most=_MOST)
        off = float(np.abs(equations.residual(unknowns)).max())
        residual = max(residual, off / (1 + float(np.abs(unknowns).max())))
        rate = equations.motion(unknowns).front_rate
        rows.append((distance, rate, float(unknowns[STEER]), float(np.hypot(*unknowns[:2]))))
    (_, _, s0, _), (_, r1, s1, _), (d2, r2, s2, radius) = rows[-3:]
    # The distance is halved, so an error of first order is halved too.
    steer = 2 * s2 - s1
    return FlatLimit(
        distance=d2,
        front_rate=r2,
        rate_exponent=float(np.log2(abs(r1 / r2))),
        steer_exponent=float(np.log2(abs((s0 - s1) / (s1 - s2)))),
        steer=steer,
        radius=radius,
        residual=residual,
    )
