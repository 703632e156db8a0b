"""The rear rate at which an engine's own circles lose their stability, located without a law for it.

From the reference's Hopf point on, steps along the family lead to the circle whose weave neither grows nor dies out in
the engine's own flow. They are Newton's with the slope of the reference's growth rate: where the engine's slope differs
by the relative amount e, the error after n steps is e^n of the shift.
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

_STEPS = 3


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
    last_step : float
        Size of the last step [rad/s]; the error is smaller.
    """

    rear_rate: float
    frequency: float
    first: OwnCircle
    last_step: float


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
    """
    flow, (q, qd) = flow_near(point), point.motion.state()
    slope = eigenvalue_slope(flow, q, qd, 1j * point.frequency)
    rate, circles = point.motion.rear_rate, []
    for _ in range(_STEPS):
        circle = measure(circle_problem(point, rate))
        circles.append(circle)
        rate -= circle.eigenvalue.real / slope.real
    last = circles[-1]
    step = -last.eigenvalue.real / slope.real
    frequency = last.eigenvalue.imag + step * slope.imag
    return StabilityBoundary(last.rear_rate + step, frequency, circles[0], abs(step))


def circle_problem(point: HopfPoint, rear_rate: float) -> Problem:
    """Return a problem that starts on the circle of a rear rate [rad/s] near a Hopf point; its times are not used."""
    equations = point.level.equations
    q, qd = circle_of_rate(flow_near(point), *point.motion.state(), rear_rate)
    return Problem(equations.bicycle, equations.surface, q, qd, np.array([0.0, 1.0]))
