"""Roots of a function of one variable between two bounds, by Brent's method.

The method is that of `scipy.optimize.brentq`, operation by operation, whose import takes longer than all the roots of a
command.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

_RELATIVE = 4 * float(np.finfo(float).eps)
_MOST = 100  # iterations; bisection alone takes fewer than 70 to round-off


def find_root(function: Callable[[float], float], low: float, high: float, tolerance: float = 2e-12) -> float:
    """Solve function(x) = 0 between two bounds by Brent's method.

    Parameters
    ----------
    function : callable
        Continuous, of opposite signs at the bounds.
    low, high : float
        Bounds.
    tolerance : float
        The root is within this and 4 units of round-off of its size of a change of sign.

    Returns
    -------
    float

    Raises
    ------
    ValueError
        If the signs at the bounds are the same, or a value is nan.
    RuntimeError
        If it does not converge, as where the function jumps about.

    References
    ----------
    R. P. Brent: Algorithms for Minimization Without Derivatives. Prentice-Hall, 1973, chapter 4.
    """
    before, x = float(low), float(high)
    value_before, value = _evaluate(function, before), _evaluate(function, x)
    if value_before == 0:
        return before
    if value == 0:
        return x
    if (value_before < 0) == (value < 0):
        raise ValueError(f"the function has the same sign at {low!r} and {high!r}")
    # The root lies between x, the better one, and `across`.
    across, value_across, step, step_before = 0.0, 0.0, 0.0, 0.0
    for _ in range(_MOST):
        if (value_before < 0) != (value < 0):
            across, value_across = before, value_before
            step = step_before = x - before
        if abs(value_across) < abs(value):
            before, x, across = x, across, x
            value_before, value, value_across = value, value_across, value
        least = (tolerance + _RELATIVE * abs(x)) / 2
        half = (across - x) / 2
        if value == 0 or abs(half) < least:
            return x
        if abs(step_before) > least and abs(value) < abs(value_before):
            trial = _interpolate((before, x, across), (value_before, value, value_across))
            if 2 * abs(trial) < min(abs(step_before), 3 * abs(half) - least):
                step_before, step = step, trial
            else:
                step_before = step = half
        else:
            step_before = step = half
        before, value_before = x, value
        x += step if abs(step) > least else (least if half > 0 else -least)
        value = _evaluate(function, x)
    raise RuntimeError(f"no root is found between {low!r} and {high!r} in {_MOST} iterations")


def _evaluate(function: Callable[[float], float], x: float) -> float:
    value = float(function(x))
    if np.isnan(value):
        raise ValueError(f"the function is nan at {x!r}")
    return value


def _interpolate(x: tuple[float, float, float], values: tuple[float, float, float]) -> float:
    """Return the step from the second point to the root of the secant, or of the inverse parabola through all three.

    It is infinite where differences are lost to underflow.
    """
    (before, here, across), (value_before, value, value_across) = x, values
    if before == across:
        return -value * (here - before) / (value - value_before)
    slope_before = (value_before - value) / (before - here)
    slope_across = (value_across - value) / (across - here)
    numerator = value_across * slope_across - value_before * slope_before
    denominator = slope_across * slope_before * (value_across - value_before)
    return -value * numerator / denominator if denominator else math.inf
