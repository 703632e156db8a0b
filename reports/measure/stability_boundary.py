"""The rear rate at which an engine's own circles lose their stability, located without a law for it.

From the reference's Hopf point on, steps along the family lead to the circle whose weave neither grows nor dies out in
the engine's own flow. They are Newton's with the slope of the reference's growth rate: where the engine's slope differs
by the relative amount e, each step is e times the one before, and what remains after a step s is s e / (1 - e).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...engines.engine import Problem
from ...reference.bifurcations.hopf import HopfPoint
from ...reference.bifurcations.near_circles import circle_of_rate
from ...reference.bifurcations.small_orbits import flow_near
from ...reference.bifurcations.step_shift import eigenvalue_slope
from .own_circle import OwnCircle

_FEWEST, _MOST = 3, 10  # steps: two are needed for e
# Error at which the search ends, relative to the shift: a third digit of its ratio to a law.
_PRECISE = 1e-3


@dataclass(frozen=True)
class StabilityBoundary:
    """Where an engine's own circles lose their stability.

    Attributes
    ----------
    rear_rate : float
        In the engine's own rates [rad/s].
    frequency : float
        Of the weave there [rad/s].
    first : OwnCircle
        The engine's circle next to the reference's Hopf point.
    error : float
        Estimate of the error of the search [rad/s].
    """

    rear_rate: float
    frequency: float
    first: OwnCircle
    error: float


def locate_boundary(point: HopfPoint, measure: Callable[[Problem], OwnCircle]) -> StabilityBoundary:
    """Locate the end of an engine's stable section next to a Hopf point of the reference.

    Parameters
    ----------
    point : HopfPoint
    measure : callable
        Maps a problem that starts on a circular motion of the reference to the engine's circle there.

    Returns
    -------
    StabilityBoundary

    Raises
    ------
    ValueError
        If the search does not converge, or leaves the family of circles.
    """
    flow, (q, qd) = flow_near(point), point.motion.state()
    slope = eigenvalue_slope(flow, q, qd, 1j * point.frequency)
    rate, before = point.motion.rear_rate, np.inf
    circles: list[OwnCircle] = []
    for _ in range(_MOST):
        try:
            start = circle_problem(point, rate)
        except ValueError as error:
            if not circles:
                raise
            here, growth = circles[-1].rear_rate, circles[-1].eigenvalue.real
            raise ValueError(
                f"the search leaves the circles of the family: at {here:.6g} rad/s the growth rate is {growth:.3g} 1/s"
            ) from error
        circle = measure(start)
        circles.append(circle)
        step = -circle.eigenvalue.real / slope.real
        rate += step
        found = circle.rear_rate + step
        share = abs(step / before)
        error = abs(step) * (share / (1 - share) if share < 0.5 else 1.0)
        if len(circles) >= _FEWEST and error <= _PRECISE * abs(found - point.motion.rear_rate):
            frequency = circle.eigenvalue.imag + step * slope.imag
            return StabilityBoundary(found, frequency, circles[0], error)
        before = step
    raise ValueError(f"the search for the end does not converge: its last step is {before:.3g} rad/s")


def circle_problem(point: HopfPoint, rear_rate: float) -> Problem:
    """Return a problem that starts on the circle of a rear rate [rad/s] near a Hopf point; its times are not used."""
    equations = point.level.equations
    q, qd = circle_of_rate(flow_near(point), *point.motion.state(), rear_rate)
    return Problem(equations.bicycle, equations.surface, q, qd, np.array([0.0, 1.0]))
