"""Starts of many rides: from a motion, or a straight upright one, to a disturbed state on the constraints.

A start depends on nothing but its own values, so that it has the same bits alone and among others.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from .arrays import copy_array
from .compilation import jit
from .dynamics import complete_velocity, find_contacts, guess_contacts, mass_and_bias, rolling, settle
from .kinematics import frames
from .linear import invert
from .pose import aligned
from .reduced import VARIABLES, reduced_jacobian, telling_spin
from .rides import are_rims_clear, unpack_constants, unpack_rim_search
from .wheel_overlap import TOUCHING, find_overlap, measure_overlaps

FASTEST = 1e9  # a larger rate means that the rolling constraints do not determine it
# Bounds within which the equations are certainly regular: `regularity.require_inertia` refuses a smallest eigenvalue of
# about 1e-11 at the largest condition, and the choice of the wheel that determines the speeds changes the smallest
# eigenvalue by far less than the factor between the two.
_INERTIA, _CONDITION = 1e-6, 1e3
_ROUND_OFF = 12 * _CONDITION * 2.0**-52  # largest relative round-off of velocities at that condition


class StartRequests(NamedTuple):
    """What n starts on one kind of ground are made of, beside their `rides.RideSetups`.

    Attributes
    ----------
    upright : ndarray, shape (n,), bool
        Whether a start is straight and upright; its state is then computed from x, y and the rear rate in ``states``.
    disturbed : ndarray, shape (n,), bool
        Whether a change is applied.
    changes : ndarray, shape (n, 7)
        Added to x, y, lean, steer, lean rate, steer rate and rear rate.
    """

    upright: Any
    disturbed: Any
    changes: Any


@jit
def _settle_state(q, qd, p, function, parameters, c):
    """Bring coordinates to the ground and complete the rates, in place; return whether that worked."""
    guess_contacts(q, p, function, parameters, c)
    if not settle(q, p, function, parameters, c):
        return False
    complete_velocity(q, qd, p, function, parameters, c)
    # Written so that nan fails.
    largest = 0.0
    for i in range(9):
        largest = max(largest, abs(qd[i])) if abs(q[i]) < math.inf and abs(qd[i]) <= FASTEST else math.inf
    return largest <= FASTEST


@jit
def _fill_velocities(rows, spin, length, velocities):
    """Fill velocities (3, 9) of lean, steer and a wheel's spin at unit rates; return the condition of solving them.

    Velocities that may be round-off are zero; ``length`` is that of the bicycle, of a point's velocity at 1 rad/s.
    """
    solved, inverse, size, k = np.empty(6, np.int64), np.empty((6, 6)), 0.0, 0
    for j in range(9):
        if j not in (4, 6, spin):
            solved[k] = j
            k += 1
    for i in range(6):
        for k in range(6):
            inverse[i, k] = rows[i, solved[k]]
            size += inverse[i, k] * inverse[i, k]
    invert(inverse, 6)
    inverse_size = 0.0
    for i in range(6):
        for k in range(6):
            inverse_size += inverse[i, k] * inverse[i, k]
    velocities[:] = 0.0
    for m, given in enumerate((4, 6, spin)):
        velocities[m, given] = 1.0
        for i in range(6):
            for k in range(6):
                velocities[m, solved[i]] -= inverse[i, k] * rows[k, given]
            if abs(velocities[m, solved[i]]) <= _ROUND_OFF * (length if solved[i] < 3 else 1.0):
                velocities[m, solved[i]] = 0.0
    return np.sqrt(size * inverse_size)


@jit
def has_inertia(q, p, function, parameters, c):
    """Return whether lean, steer and rolling certainly have inertia at coordinates with contacts ``p``.

    See `velodrome.reference.regularity.require_inertia`, which decides where this returns False.
    """
    mass, bias, rows = np.empty((9, 9)), np.empty(9), np.empty((6, 9))
    mass_and_bias(q, np.zeros(9), c, mass, bias)
    rolling(q, np.zeros(9), p, function, parameters, c, rows, np.empty(6), np.empty(6))
    length = abs(c.rear_x) + abs(c.rear_z) + abs(c.front_x) + abs(c.front_z) + c.rear_radius + c.front_radius
    velocities, others = np.empty((3, 9)), np.empty((3, 9))
    condition = _fill_velocities(rows, 7, length, velocities)
    other = _fill_velocities(rows, 8, length, others)
    if not condition <= other:
        condition, velocities = other, others
    if not condition < _CONDITION:
        return False
    sizes, a = np.zeros(3), np.zeros((3, 3))
    for m in range(3):
        for k in range(9):
            sizes[m] += abs(velocities[m, k]) * np.sqrt(max(mass[k, k], 0.0))
    for m in range(3):
        for n in range(3):
            for i in range(9):
                for k in range(9):
                    a[m, n] += velocities[m, i] * mass[i, k] * velocities[n, k]
            a[m, n] /= sizes[m] * sizes[n]
        a[m, m] -= _INERTIA
    minor = a[0, 0] * a[1, 1] - a[0, 1] * a[1, 0]
    det = (
        minor * a[2, 2]
        + a[0, 1] * a[1, 2] * a[2, 0]
        + a[0, 2] * a[1, 0] * a[2, 1]
        - a[0, 2] * a[1, 1] * a[2, 0]
        - a[0, 0] * a[1, 2] * a[2, 1]
    )
    return a[0, 0] > 0 and minor > 0 and det > 0


@jit
def _linearise(y, function, complex_function, parameters, c, jacobian):
    """Fill the reduced Jacobian (7, 7) at a state ``y`` (24,) of yaw 0; return whether that worked."""
    at, field = y.copy(), np.empty(VARIABLES)
    q, p = at[:9], at[18:]
    guess_contacts(q, p, function, parameters, c)
    if not (find_contacts(q, p, function, parameters, c) and settle(q, p, function, parameters, c)):
        return False
    reduced_jacobian(at, telling_spin(at[16], at[17]), complex_function, parameters, aligned(c), field, jacobian)
    for i in range(VARIABLES):
        for j in range(VARIABLES):
            if not abs(jacobian[i, j]) < math.inf:
                return False
    return True


@jit
def _disturb(y, change, centre, function, parameters, c):
    """Add a change (7,) to the independent variables of a state (24,), in place; return whether that worked."""
    q, qd, p = y[:9], y[9:18], y[18:]
    q[0], q[1], q[4], q[6] = q[0] + change[0], q[1] + change[1], q[4] + change[2], q[6] + change[3]
    q[3], q[7], q[8] = 0.0, 0.0, 0.0
    lean, steer, spin = qd[4] + change[4], qd[6] + change[5], qd[7] + change[6]
    qd[:] = 0.0
    qd[4], qd[6], qd[7] = lean, steer, spin
    if not _settle_state(q, qd, p, function, parameters, c):
        return False
    _, x, _, z, _, _, _, _ = frames(q[3], q[4], q[5], q[6], c)
    at = (
        q[0] + centre[0] * x[0] + centre[1] * z[0],
        q[1] + centre[0] * x[1] + centre[1] * z[1],
        q[2] + centre[0] * x[2] + centre[1] * z[2],
    )
    ground, _, _, _, _, _ = function(at[0], at[1], parameters)
    # The constraints also hold for wheels that touch the ground from below.
    return at[2] > ground


@jit
def _set_upright(y, function, parameters, c):
    """Fill an upright state (24,) from its x, y and rear rate; return whether that worked."""
    q, qd, rate = y[:9], y[9:18], y[16]
    q[2], _, _, _, _, _ = function(q[0], q[1], parameters)
    q[2] += c.front_radius
    q[3:] = 0.0
    qd[:] = 0.0
    qd[7] = rate
    return _settle_state(q, qd, y[18:], function, parameters, c)


@jit
def _finish(y, undisturbed, disturbed, change, centre, ground, function, parameters, c):
    """Check a state, disturb and check it again; return whether it is a start without any doubt."""
    if not has_inertia(y[:9], y[18:], function, parameters, c):
        return False
    copy_array(y, undisturbed)
    if disturbed:
        if not _disturb(y, change, centre, function, parameters, c):
            return False
        if not has_inertia(y[:9], y[18:], function, parameters, c):
            return False
    if find_overlap(y[6], measure_overlaps(c)) > TOUCHING:
        return False
    if not ground.curved:
        return True
    guess_contacts(y[:9], y[18:], function, parameters, c)
    if not find_contacts(y[:9], y[18:], function, parameters, c):
        return False
    return are_rims_clear(y, ground, function, parameters, c)


@jit
def fill_starts(setups, requests, function, complex_function, undisturbed, states, jacobians, certain):
    """Compute n starts on grounds with one height function.

    ``states`` (n, 24) has coordinates, rates and contact parameters of circular motions, and of upright starts x, y and
    the rear rate. Fills it with the disturbed states, ``undisturbed`` (n, 24) with those before, jacobians (n, 7, 7)
    with the linearisations there, and ``certain`` (n,) with whether a start is one without any doubt.
    """
    for i in range(len(states)):
        c, ground, parameters = (
            unpack_constants(setups.constants[i]),
            unpack_rim_search(setups, i),
            setups.parameters[i],
        )
        y = states[i]
        certain[i] = False
        if requests.upright[i]:
            if not _set_upright(y, function, parameters, c):
                continue
        elif ground.curved and not are_rims_clear(y, ground, function, parameters, c):
            continue
        if _linearise(y, function, complex_function, parameters, c, jacobians[i]):
            change, centre = requests.changes[i], setups.falls[i]
            certain[i] = _finish(
                y, undisturbed[i], requests.disturbed[i], change, centre, ground, function, parameters, c
            )
