"""Height of the rear frame's centre of mass above that at which a bicycle counts as fallen."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .compilation import jit
from .vector import add, combine, cross


class FallCriterion(NamedTuple):
    """What decides whether a bicycle has fallen.

    Attributes
    ----------
    x, z : float
        Centre of mass of the rear frame from D, in its own axes [m].
    limit : float
        Height above the ground at which the bicycle counts as fallen [m].
    watched : bool
        Whether a ride ends there.
    """

    x: float
    z: float
    limit: float
    watched: bool


@jit
def height_above_fallen(y, fall, function, parameters):
    """Return the height of the centre of mass above ``fall.limit`` and its rate, for y = (q, qd, ...)."""
    cy, sy, cl, sl = np.cos(y[3]), np.sin(y[3]), np.cos(y[4]), np.sin(y[4])
    cp, sp = np.cos(y[5]), np.sin(y[5])
    ahead, left, up = (cy, sy, 0.0), (-sy * cl, cy * cl, sl), (sy * sl, -cy * sl, cl)
    across, along = fall.x * cp + fall.z * sp, fall.z * cp - fall.x * sp
    arm = combine(across, ahead, along, up)
    spin = add((0.0, 0.0, y[12]), combine(y[13], ahead, y[14], left))
    velocity = add((y[9], y[10], y[11]), cross(spin, arm))
    ground, fx, fy, _, _, _ = function(y[0] + arm[0], y[1] + arm[1], parameters)
    height = y[2] + arm[2] - ground - fall.limit
    return height, velocity[2] - fx * velocity[0] - fy * velocity[1]


@jit
def may_fall_within(h, before, after):
    """Return whether a height may become negative within a step of length h.

    ``before`` and ``after`` are (height, rate) at its ends. Between them the height is close to the cubic polynomial
    with these values and rates; where it turns from falling to rising, it stays above both tangents' meeting point.
    """
    if not (before[0] > 0 and after[0] > 0):
        return True
    if not (before[1] < 0 and after[1] > 0):
        return False
    # The tangents meet below the curve: max over the step of the lower bounds before + rate t and after - rate (h - t).
    meeting = (after[0] - before[0] - after[1] * h) / (before[1] - after[1])
    return not before[0] + before[1] * min(max(meeting, 0.0), h) > 0


@jit
def measure_heights(states, fall, function, parameters, height, rate):
    """Fill ``height`` and ``rate`` (n,) for states (n, 18)."""
    for n in range(states.shape[0]):
        height[n], rate[n] = height_above_fallen(states[n], fall, function, parameters)
