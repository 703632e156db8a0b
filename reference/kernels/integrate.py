"""Time integration of y = (q, qd, p), 24 states, with the contact parameters p integrated as well.

Dormand and Prince's method of order 8 with error estimates of orders 5 and 3 and a dense output of
order 7 (Hairer, Norsett, Wanner 1993, II.5 and II.6), and the modified Euler (Heun) method of Xiong
et al. (2020), section 4.2.
"""

from __future__ import annotations

import math

import numpy as np

from . import lean
from .arrays import copy_array
from .compilation import jit
from .dormand_prince import SIZE, error_norm, fill_dense_output, fill_extra_stage, fill_stage, fill_step
from .dynamics import wheels
from .fall import height_above_fallen, may_fall_within
from .lean import derivative
from .pose import aligned
from .projection import project
from .rim import bound, least_clearance

DONE, MORE, FAILED, REAR_TOUCHED, FRONT_TOUCHED, FELL = range(6)
_LOOKS = 8  # checks of the rims while a wheel rolls over a length of the ground's detail
_BISECTIONS = 60
# Looks at the height within a step in which the bicycle may fall, and halvings of the interval of a fall: the states at
# its ends are then so close that the time follows from them to round-off.
_FALL_LOOKS, _FALL_HALVINGS = 8, 20
_GOLDEN = (math.sqrt(5) - 1) / 2
# A rolling bicycle does not change within 10 ns: a smaller step means that the integration approaches a singularity
# (a wheel flat on the ground, lean = +-pi/2), which would take millions of steps.
SMALLEST_STEP = 1e-8


@jit
def _eighth_root(x):
    """Return x^(1/8): with the same bits on every machine, unlike a power."""
    return math.sqrt(math.sqrt(math.sqrt(x)))


@jit
def _complete_dense_output(y, new, h, stages, k, function, parameters, bicycle, work, out):
    """Fill ``out`` (7, 24), the coefficients of the dense output, and the last four rows of ``stages``."""
    derivative(new, function, parameters, bicycle, stages[12])
    for s in range(13, 16):
        fill_extra_stage(s, y, h, k, work)
        derivative(work, function, parameters, bicycle, stages[s])
    fill_dense_output(y, new, h, k, out)


@jit
def _interpolate(y, coefficients, x, out):
    """Fill ``out`` with the dense output at the fraction x of the step."""
    for i in range(SIZE):
        value = 0.0
        for k in range(7):
            value += coefficients[6 - k, i]
            value *= x if k % 2 == 0 else 1 - x
        out[i] = y[i] + value


@jit
def _rim_bounds(y, ground, function, parameters, c):
    """Return lower bounds of both rims' least clearances, from the contacts alone."""
    (c1, x1, _, z1, r1), (c2, x2, _, z2, r2) = wheels(y, c)
    rear = bound(c1, x1, z1, r1, y[20], ground, function, parameters)
    return rear, bound(c2, x2, z2, r2, y[23], ground, function, parameters)


@jit
def rim_clearance(y, ground, function, parameters, c):
    """Return (clearance, wheel): the smaller of both rims' clearances and its wheel."""
    (c1, x1, _, z1, r1), (c2, x2, _, z2, r2) = wheels(y, c)
    rear, _ = least_clearance(c1, x1, z1, r1, y[20], True, ground.samples, function, parameters)
    front, _ = least_clearance(c2, x2, z2, r2, y[23], True, ground.samples, function, parameters)
    return (rear, 0) if rear <= front else (front, 1)


@jit
def _are_clear(bounds, next_bounds):
    """Return whether bounds at both ends of a step show that the rims were clear throughout it.

    The bounds change with the lean and the ground, and little in a step: they must change by less than they are above
    zero.
    """
    change = abs(bounds[0] - next_bounds[0]) + abs(bounds[1] - next_bounds[1])
    return min(min(bounds[0], bounds[1]), min(next_bounds[0], next_bounds[1])) > change


@jit
def _clearance_within(y, coefficients, x, ground, function, parameters, c, work):
    _interpolate(y, coefficients, x, work)
    return rim_clearance(work, ground, function, parameters, c)


@jit
def _least_within(y, coefficients, low, high, ground, function, parameters, c, work):
    """Return the fraction of a step, in an interval, where the clearance is least, or the first found with one <= 0.

    Golden section; the clearance must have a single minimum in the interval.
    """
    x = low
    for _ in range(40):
        left, right = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
        at_left, _ = _clearance_within(y, coefficients, left, ground, function, parameters, c, work)
        at_right, _ = _clearance_within(y, coefficients, right, ground, function, parameters, c, work)
        x = left if at_left < at_right else right
        if min(at_left, at_right) <= 0:
            break
        if at_left < at_right:
            high = right
        else:
            low = left
    return x


@jit
def _first_touch(y, coefficients, clear, touching, ground, function, parameters, c, work):
    """Bisect a step between a fraction with both rims clear and one with a touch; return (fraction, wheel)."""
    _, wheel = _clearance_within(y, coefficients, touching, ground, function, parameters, c, work)
    for _ in range(_BISECTIONS):
        middle = 0.5 * (clear + touching)
        if not clear < middle < touching:
            break
        value, which = _clearance_within(y, coefficients, middle, ground, function, parameters, c, work)
        if value > 0:
            clear = middle
        else:
            touching, wheel = middle, which
    return clear, wheel


@jit
def _second_touch(y, new, coefficients, ground, function, parameters, c, work):
    """Return (fraction of a step at which a rim first touches a second place, wheel); (2, 0) if none does.

    The clearance is evaluated so often that no wheel rolls further than a part of the ground's detail in between. Where
    a touch may begin and end between two evaluations, the least clearance is searched for.
    """
    travel = math.sqrt((new[0] - y[0]) ** 2 + (new[1] - y[1]) ** 2 + (new[2] - y[2]) ** 2)
    looks = 2 + int(_LOOKS * travel / ground.detail)
    before, _ = _clearance_within(y, coefficients, 0.0, ground, function, parameters, c, work)
    here, after = before, before
    for k in range(1, looks + 2):
        # Nothing is known beyond the step's end, so the minimum may lie at the end.
        if k <= looks:
            after, _ = _clearance_within(y, coefficients, k / looks, ground, function, parameters, c, work)
            if after <= 0:
                return _first_touch(y, coefficients, (k - 1) / looks, k / looks, ground, function, parameters, c, work)
        if here <= before and here <= after and here < max(before, after) - here:
            low, high = max(k - 2, 0) / looks, min(k, looks) / looks
            x = _least_within(y, coefficients, low, high, ground, function, parameters, c, work)
            value, _ = _clearance_within(y, coefficients, x, ground, function, parameters, c, work)
            if value <= 0:
                return _first_touch(y, coefficients, low, x, ground, function, parameters, c, work)
        before, here = here, after
    return 2.0, 0


@jit
def _fall_within(y, coefficients, fall, function, parameters, work):
    """Return the fractions of a step just before and just after the first fall in it; (2, 2) if there is none."""
    standing = 0.0
    for k in range(1, _FALL_LOOKS + 1):
        lying = k / _FALL_LOOKS
        _interpolate(y, coefficients, lying, work)
        height, _ = height_above_fallen(work, fall, function, parameters)
        if not height > 0:
            for _ in range(_FALL_HALVINGS):
                middle = 0.5 * (standing + lying)
                _interpolate(y, coefficients, middle, work)
                height, _ = height_above_fallen(work, fall, function, parameters)
                if height > 0:
                    standing = middle
                else:
                    lying = middle
            return standing, lying
        standing = lying
    return 2.0, 2.0


@jit
def dop853(y, times, index, t, h, tolerance, most_steps, ground, fall, function, parameters, c, out, fallen, at):
    """Advance ``y`` in place and fill rows ``index``... of ``out`` (n, 24) at ``times``.

    Each accepted step and each output is projected onto gaps, contact equations and rolling. Stops at the last time,
    after ``most_steps`` steps (call again with the returned values), where the step becomes too small or a contact is
    lost, where a rim touches the ground at a second place, or where the bicycle falls, if ``fall`` says so
    (`fall.FallCriterion`). Both are searched for in the dense output, the touch with the `rim.RimSearch` ``ground``, so
    that they do not depend on the output times. The states just before and after a fall fill ``fallen`` (2, 24), and
    their times ``at`` (2,).

    Returns ``(status, index, t, h, steps, evaluations)``.
    """
    bicycle = aligned(c)
    stages, coefficients = np.empty((16, SIZE)), np.empty((7, SIZE))
    k = stages.reshape(-1)  # the same numbers
    new, work, work2 = np.empty(SIZE), np.empty(SIZE), np.empty(SIZE)
    ahead, ahead_derivative = np.empty(SIZE), np.empty(SIZE)
    derivative(y, function, parameters, bicycle, stages[0])
    steps, evaluations, rejected = 0, 1, False
    bounds = _rim_bounds(y, ground, function, parameters, c) if ground.curved else (1.0, 1.0)
    height = height_above_fallen(y, fall, function, parameters) if fall.watched else (1.0, 0.0)
    while index < times.size and steps < most_steps:
        if not SMALLEST_STEP < h < 1e300:
            return FAILED, index, t, h, steps, evaluations
        for s in range(1, 12):
            fill_stage(s, y, h, k, work)
            derivative(work, function, parameters, bicycle, stages[s])
        fill_step(y, h, k, new)
        evaluations += 11
        error, reached = error_norm(y, new, h, k, tolerance, work, work2), False
        if error < 1:
            copy_array(new, ahead)
            reached = project(ahead, function, parameters, c, bicycle)
            if reached:
                derivative(ahead, function, parameters, bicycle, ahead_derivative)
                evaluations += 1
                for i in range(SIZE):  # a step to where the equations are singular is too long
                    error += 0.0 * ahead_derivative[i]
        if not error < 1:  # also if it is not a number
            h *= max(0.2, 0.9 / _eighth_root(error)) if error < 1e300 else 0.2
            rejected = True
            continue
        next_bounds = _rim_bounds(new, ground, function, parameters, c) if ground.curved else bounds
        next_height = height_above_fallen(new, fall, function, parameters) if fall.watched else height
        clear, standing = _are_clear(bounds, next_bounds), not may_fall_within(h, height, next_height)
        end, status, before, after = t + h, MORE, 2.0, 2.0
        if times[index] <= end or not clear or not standing:
            _complete_dense_output(y, new, h, stages, k, function, parameters, bicycle, work, coefficients)
            evaluations += 4
            if not clear:
                touch, wheel = _second_touch(y, new, coefficients, ground, function, parameters, c, work)
                if touch <= 1:
                    end, status = t + touch * h, FRONT_TOUCHED if wheel else REAR_TOUCHED
            if not standing:
                before, after = _fall_within(y, coefficients, fall, function, parameters, work)
                if after <= 1 and t + after * h <= end:
                    end, status = t + before * h, FELL
            while index < times.size and times[index] <= end:
                _interpolate(y, coefficients, (times[index] - t) / h, out[index])
                if not project(out[index], function, parameters, c, bicycle):
                    return FAILED, index, t, h, steps, evaluations
                index += 1
            if status == FELL:
                for j, share in enumerate((before, after)):
                    _interpolate(y, coefficients, share, fallen[j])
                    at[j] = t + share * h
                    if not project(fallen[j], function, parameters, c, bicycle):
                        return FAILED, index, t, h, steps, evaluations
            if status != MORE:
                # What happens after the last time is not part of this motion.
                return (DONE if index == times.size else status), index, end, h, steps + 1, evaluations
        factor = 10.0 if error == 0 else min(10.0, 0.9 / _eighth_root(error))
        if not reached:
            return FAILED, index, t, h, steps, evaluations
        copy_array(ahead, y)
        copy_array(ahead_derivative, stages[0])
        t += h
        h *= min(1.0, factor) if rejected else factor
        steps, rejected, bounds, height = steps + 1, False, next_bounds, next_height
    return (DONE if index == times.size else MORE), index, t, h, steps, evaluations


@jit
def modified_euler(y, step, count, stride, ground, fall, function, parameters, c, out, fallen, at):
    """Take ``count`` steps y += step (f(y) + f(y + step f(y))) / 2; every ``stride``-th fills a row of ``out``.

    Nothing is projected: the constraints drift with the method's error. Stops where the state is no longer finite,
    in the step in which a rim touches the ground at a second place, and after the step in which the bicycle falls, if
    ``fall`` says so. The states before and after that step fill ``fallen`` (2, 24), and their times ``at`` (2,).

    Returns ``(status, rows filled, t)``, with t of a touch from linear interpolation of the clearance.
    """
    bicycle = aligned(c)
    first, second, work = np.empty(SIZE), np.empty(SIZE), np.empty(SIZE)
    rows = 0
    before, wheel = rim_clearance(y, ground, function, parameters, c) if ground.curved else (1.0, 0)
    for n in range(1, count + 1):
        derivative(y, function, parameters, bicycle, first)
        for i in range(SIZE):
            work[i] = y[i] + step * first[i]
        derivative(work, function, parameters, bicycle, second)
        total = 0.0
        for i in range(SIZE):
            work[i] = y[i]
            y[i] += 0.5 * step * (first[i] + second[i])
            total += y[i]
        if not abs(total) < 1e300:
            return FAILED, rows, (n - 1) * step
        if ground.curved:
            clearance, wheel = rim_clearance(y, ground, function, parameters, c)
            if clearance <= 0:
                touch = (n - 1 + before / (before - clearance)) * step
                return FRONT_TOUCHED if wheel else REAR_TOUCHED, rows, touch
            before = clearance
        if fall.watched and not height_above_fallen(y, fall, function, parameters)[0] > 0:
            fallen[0], fallen[1] = work, y
            at[0], at[1] = (n - 1) * step, n * step
            return FELL, rows, n * step
        if n % stride == 0:
            copy_array(y, out[rows])
            rows += 1
    return DONE, rows, count * step


@jit
def contact_forces(rows, function, parameters, c, force):
    """Fill ``force`` (n, 6), the multipliers along a trajectory ``rows`` (n, 24)."""
    bicycle = aligned(c)
    for n in range(rows.shape[0]):
        lean.contact_forces(rows[n], function, parameters, bicycle, force[n])
