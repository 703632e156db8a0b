"""Newton's method for one circular motion: the eight equations of `circle` and one condition.

The condition is that one of the 22 unknowns of `steady` has a given value, or that the rear wheel has a given rate,
sigma b^2 = rate^2. `canonical` makes the bits of a solution independent of the guess that led to it.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from .arrays import copy_array
from .circle import COORDINATES, FULL, ROWS, circle_and_unknowns
from .compilation import jit
from .curve import REAR_SPEED, SIGMA, expanded
from .linear import invert
from .steady import steady_residual

REAR_RATE = -1  # index of a condition on the rear wheel's rate
# Rows are of order one: the round-off of a solution is about 1e-14, times the heights on large circles.
LARGEST_RESIDUAL = 1e-12

# Unit to which `canonical` rounds an unknown below one. Newton's steps from there leave errors of about 1e-10, with the
# same inverse 1e-15, and then round-off.
_UNIT = 2.0**-16
_CHORD_STEPS = 4
# Bound of a solution's error, in units. The error is about `LARGEST_RESIDUAL` times the condition, which is below 100.
_BAND = 1e-10 / _UNIT
_SETTLED = 1e-12  # of the last step
CANONICAL, AMBIGUOUS, UNSETTLED = 0, 1, 2


class PointCondition(NamedTuple):
    """One more equation that picks a motion of a curve, value = 0.

    With the index of an unknown the value is scale (unknown - target), with `REAR_RATE` scale (sigma b^2 - target).
    """

    index: Any
    target: Any
    scale: Any


@jit
def condition_value(condition, full):
    """Return the value of a `PointCondition` at the unknowns ``full`` (22,)."""
    if condition.index == REAR_RATE:
        return condition.scale * (full[SIGMA] * full[REAR_SPEED] * full[REAR_SPEED] - condition.target)
    return condition.scale * (full[condition.index] - condition.target)


@jit
def _fill_gradient(condition, full, basis, row):
    """Fill the gradient (9,) of a condition in the nine unknowns; ``basis`` (22, 9) are all unknowns' derivatives."""
    for j in range(COORDINATES):
        if condition.index == REAR_RATE:
            b = full[REAR_SPEED]
            row[j] = condition.scale * (b * b * basis[SIGMA, j] + 2 * full[SIGMA] * b * basis[REAR_SPEED, j])
        else:
            row[j] = condition.scale * basis[condition.index, j]


@jit
def _fill_step(inverse, rows, value, step):
    """Fill Newton's step (9,)."""
    for i in range(COORDINATES):
        step[i] = -inverse[i, ROWS] * value
        for j in range(ROWS):
            step[i] -= inverse[i, j] * rows[j]


@jit
def _step_size(u, step):
    """Return the size of a step, relative for large unknowns; nan if it is not finite."""
    size = 0.0
    for i in range(COORDINATES):
        part = abs(step[i] / (1 + abs(u[i])))
        if not part < math.inf:
            return math.nan
        size = max(size, part)
    return size


@jit
def _invert_here(u, condition, function, parameters, a, rows, full, inverse):
    """Fill rows (8,), all unknowns (22,) and the inverse (9, 9) of equations and condition.

    Returns the condition's value and the determinant's sign.
    """
    basis = np.empty((FULL, COORDINATES))
    expanded(u, function, parameters, a, rows, inverse[:ROWS], full, basis)
    _fill_gradient(condition, full, basis, inverse[ROWS])
    return condition_value(condition, full), invert(inverse, COORDINATES)


@jit
def solve_motion(u, condition, most, real, function, parameters, a, c, full):
    """Solve the equations and a condition from the guess ``u`` (9,), which is overwritten; fill ``full`` (22,).

    ``real`` and ``function`` are the surface's functions for real and for complex numbers, ``c`` and ``a`` the
    `kinematics.Constants` and the result of `pose.aligned` for them. Returns the number of iterations, 0 on failure,
    and the sign of the determinant.
    """
    rows, inverse, step = np.empty(ROWS), np.empty((COORDINATES, COORDINATES)), np.empty(COORDINATES)
    for iteration in range(1, most + 1):
        value, sign = _invert_here(u, condition, function, parameters, a, rows, full, inverse)
        _fill_step(inverse, rows, value, step)
        size = _step_size(u, step)
        if not size < math.inf:
            return 0, 0.0
        share = min(1.0, 0.5 / size) if size > 0 else 1.0
        for i in range(COORDINATES):
            u[i] += share * step[i]
        # Where convergence is quadratic, the step after one of 1e-9 is round-off. It is linear where the rear wheel
        # nearly stands, sigma b^2 = 0, and round-off is larger next to a fold.
        if size < _SETTLED or (size < 1e-9 and iteration == most):
            circle_and_unknowns(u, real, parameters, a, rows, full)
            return (iteration, sign) if is_solution(full, real, parameters, c) else (0, 0.0)
    return 0, 0.0


@jit
def is_solution(full, real, parameters, c):
    """Return whether unknowns ``full`` (22,) solve all equations of `steady`."""
    out, largest, size = np.empty(FULL), 0.0, 0.0
    steady_residual(full, real, parameters, c, out)
    for i in range(FULL):
        if not abs(out[i]) < math.inf:
            return False
        largest, size = max(largest, abs(out[i])), max(size, abs(full[i]))
    return largest <= LARGEST_RESIDUAL * (1 + size)


@jit
def _round_unknown(value):
    """Round an unknown; return it, and whether its error might lead to another result."""
    _, exponent = math.frexp(value)
    unit = _UNIT * 2.0 ** max(exponent, 0)
    scaled = value / unit
    return unit * np.floor(scaled + 0.5), abs(scaled - np.floor(scaled) - 0.5) < _BAND


@jit
def canonical(u, condition, real, function, parameters, a, c, full):
    """Compute a solution ``u`` (9,) anew from its rounding, in place; fill ``full`` (22,).

    Returns `CANONICAL` where the bits depend on nothing but the equations and the condition; `AMBIGUOUS` where an
    unknown lies so near to the middle between two roundings that its error may decide, with both filled all the same;
    and `UNSETTLED`, with both left as they are, where the steps from the rounding do not settle, as next to a fold.
    """
    v, step, rows, new = np.empty(COORDINATES), np.empty(COORDINATES), np.empty(ROWS), np.empty(FULL)
    inverse, doubtful = np.empty((COORDINATES, COORDINATES)), False
    for i in range(COORDINATES):
        v[i], near = _round_unknown(u[i])
        doubtful = doubtful or near
    value, _ = _invert_here(v, condition, function, parameters, a, rows, new, inverse)
    size = math.inf
    for k in range(_CHORD_STEPS):
        if k > 0:
            circle_and_unknowns(v, real, parameters, a, rows, new)
            value = condition_value(condition, new)
        _fill_step(inverse, rows, value, step)
        size = _step_size(v, step)
        if not size < math.inf:
            return UNSETTLED
        for i in range(COORDINATES):
            v[i] += step[i]
    if not size < _SETTLED:
        return UNSETTLED
    circle_and_unknowns(v, real, parameters, a, rows, new)
    if not is_solution(new, real, parameters, c):
        return UNSETTLED
    copy_array(v, u)
    copy_array(new, full)
    return AMBIGUOUS if doubtful else CANONICAL
