"""Time integration of y = (q, qd, p), 24 states, with the contact parameters p carried along.

Dormand and Prince's method of order 8 with error estimates of orders 5 and 3 and a dense output of
order 7 (Hairer, Norsett, Wanner 1993, II.5 and II.6), and the modified Euler (Heun) method of Xiong
et al. (2020), section 4.2.
"""

from __future__ import annotations

import math

import numpy as np

from . import lean
from .lean import derivative
from .pose import aligned
from .projection import project
from .vector import jit

SIZE = 24
DONE, MORE, FAILED = 0, 1, 2
# Nothing that rolls changes within 10 ns: a smaller step means that a singularity is being crept up to
# (a wheel flat on the ground, lean = +-pi/2), which would take millions of steps.
SMALLEST_STEP = 1e-8


@jit
def _combine(y, h, weights, count, stages, out):
    """Fill out = y + h sum_j weights[j] stages[j]."""
    for i in range(SIZE):
        out[i] = y[i]
    for j in range(count):
        a = h * weights[j]
        if a != 0.0:
            for i in range(SIZE):
                out[i] += a * stages[j, i]


@jit
def _error(y, new, h, stages, e3, e5, tolerance, error3, error5):
    """Error norm of a step in units of the tolerance, which is relative above 1 and absolute below.

    ``error3`` and ``error5`` (24,) are overwritten.
    """
    for i in range(SIZE):
        error3[i] = error5[i] = 0.0
    for j in range(13):
        for i in range(SIZE):
            error3[i] += e3[j] * stages[j, i]
            error5[i] += e5[j] * stages[j, i]
    norm5 = norm3 = 0.0
    for i in range(SIZE):
        unit = tolerance * (1 + max(abs(y[i]), abs(new[i])))
        norm5 += (error5[i] / unit) ** 2
        norm3 += (error3[i] / unit) ** 2
    denominator = norm5 + 0.01 * norm3
    return 0.0 if denominator == 0 else abs(h) * norm5 / math.sqrt(denominator * SIZE)


@jit
def _dense(y, new, h, stages, a_extra, d, function, parameters, bicycle, work, out):
    """Fill ``out`` (7, 24), the coefficients of the dense output; ``stages`` gets its three extra rows."""
    for s in range(3):
        _combine(y, h, a_extra[s], 13 + s, stages, work)
        derivative(work, function, parameters, bicycle, stages[13 + s])
    for i in range(SIZE):
        delta = new[i] - y[i]
        out[0, i] = delta
        out[1, i] = h * stages[0, i] - delta
        out[2, i] = 2 * delta - h * (stages[12, i] + stages[0, i])
        for k in range(4):
            total = 0.0
            for j in range(16):
                total += d[k, j] * stages[j, i]
            out[3 + k, i] = h * total


@jit
def _interpolate(y, coefficients, x, out):
    """Fill out = the dense output at the fraction x of the step."""
    for i in range(SIZE):
        value = 0.0
        for k in range(7):
            value += coefficients[6 - k, i]
            value *= x if k % 2 == 0 else 1 - x
        out[i] = y[i] + value


@jit
def dop853(y, times, index, t, h, tolerance, most_steps, tableau, function, parameters, c, out):
    """Advance ``y`` in place and fill rows ``index``... of ``out`` (n, 24) at ``times``.

    Each accepted step and each output is projected onto gaps, contact equations and rolling. Stops at
    the last time, after ``most_steps`` steps (call again with what it returns) or where the step
    shrinks to nothing or a contact is lost.

    Returns ``(status, index, t, h, steps, evaluations)``.
    """
    a, b, e3, e5, a_extra, d = tableau
    bicycle = aligned(c)
    stages, coefficients = np.empty((16, SIZE)), np.empty((7, SIZE))
    new, work, error5 = np.empty(SIZE), np.empty(SIZE), np.empty(SIZE)
    derivative(y, function, parameters, bicycle, stages[0])
    steps, evaluations, rejected = 0, 1, False
    while index < times.size and steps < most_steps:
        if not SMALLEST_STEP < h < 1e300:
            return FAILED, index, t, h, steps, evaluations
        for s in range(1, 12):
            _combine(y, h, a[s], s, stages, work)
            derivative(work, function, parameters, bicycle, stages[s])
        _combine(y, h, b, 12, stages, new)
        derivative(new, function, parameters, bicycle, stages[12])
        evaluations += 12
        error = _error(y, new, h, stages, e3, e5, tolerance, work, error5)
        if not error < 1:  # also where it is not a number
            h *= max(0.2, 0.9 * error ** (-1 / 8)) if error < 1e300 else 0.2
            rejected = True
            continue
        if times[index] <= t + h:
            _dense(y, new, h, stages, a_extra, d, function, parameters, bicycle, work, coefficients)
            evaluations += 3
            while index < times.size and times[index] <= t + h:
                _interpolate(y, coefficients, (times[index] - t) / h, out[index])
                if not project(out[index], function, parameters, c, bicycle):
                    return FAILED, index, t, h, steps, evaluations
                index += 1
        factor = 10.0 if error == 0 else min(10.0, 0.9 * error ** (-1 / 8))
        for i in range(SIZE):
            y[i] = new[i]
        if not project(y, function, parameters, c, bicycle):
            return FAILED, index, t, h, steps, evaluations
        derivative(y, function, parameters, bicycle, stages[0])
        evaluations += 1
        t += h
        h *= min(1.0, factor) if rejected else factor
        steps, rejected = steps + 1, False
    return (DONE if index == times.size else MORE), index, t, h, steps, evaluations


@jit
def modified_euler(y, step, count, stride, function, parameters, c, out):
    """Take ``count`` steps y += step (f(y) + f(y + step f(y))) / 2; every ``stride``-th fills a row of ``out``.

    Nothing is projected: the constraints drift with the method's error. Returns the rows filled, fewer
    than count / stride where the state stops being finite.
    """
    bicycle = aligned(c)
    first, second, work = np.empty(SIZE), np.empty(SIZE), np.empty(SIZE)
    rows = 0
    for n in range(1, count + 1):
        derivative(y, function, parameters, bicycle, first)
        for i in range(SIZE):
            work[i] = y[i] + step * first[i]
        derivative(work, function, parameters, bicycle, second)
        total = 0.0
        for i in range(SIZE):
            y[i] += 0.5 * step * (first[i] + second[i])
            total += y[i]
        if not abs(total) < 1e300:
            return rows
        if n % stride == 0:
            out[rows] = y
            rows += 1
    return rows


@jit
def contact_forces(rows, function, parameters, c, force):
    """Fill ``force`` (n, 6), the multipliers along a trajectory ``rows`` (n, 24)."""
    bicycle = aligned(c)
    for n in range(rows.shape[0]):
        lean.contact_forces(rows[n], function, parameters, bicycle, force[n])
