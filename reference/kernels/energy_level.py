"""The reduced equations of motion on a level set of energy, for complex numbers away from the real axis.

On {H = E} the rear rate follows from the six variables y = (x, y, lean, steer, lean_rate, steer_rate) of the heading
frame: the other speeds are linear in it, so that

    H = V + T0 + T1 rear_rate + T2 rear_rate^2 = E

On a circular motion lean and steer rate are zero and T2 rear_rate^2 is the whole kinetic energy, so that a moving
bicycle with a rolling rear wheel has dH / d rear_rate != 0, and the chart is regular near it. All steps are analytic:
the field may be evaluated on circles in the complex plane, from which derivatives of any order follow.

The accelerations come from the 15 x 15 system of `dynamics`, not from the elimination of `lean`, with which motions are
integrated.
"""

from __future__ import annotations

import numpy as np

from .compilation import jit
from .dynamics import accelerations, complete_velocity, energies, mass_and_bias, settle

LEVEL_VARIABLES = 6


@jit
def _fill_energy_terms(q, at_rest, per_rate, c):
    """Return (V + T0, T1, T2) of the energy at rates ``at_rest`` + rear_rate ``per_rate``, (9,) each."""
    mass, bias = np.empty((9, 9), q.dtype), np.empty(9, q.dtype)
    mass_and_bias(q, at_rest, c, mass, bias)
    kinetic, potential = energies(q, at_rest, c)
    mixed, square = 0 * kinetic, 0 * kinetic
    for i in range(9):
        for j in range(9):
            mixed += per_rate[i] * mass[i, j] * at_rest[j]
            square += 0.5 * per_rate[i] * mass[i, j] * per_rate[j]
    return kinetic + potential, mixed, square


@jit
def _place_on_level(variables, energy, near, q, qd, p, function, parameters, c):
    """Fill the state q, qd (9,), p (6,), complex, on a level set of energy; return whether that worked.

    ``near`` (24,) is a real state from which Newton's method starts; its rear rate has the sign that is sought.
    """
    per_rate = np.zeros(9, np.complex128)
    for i in range(9):
        q[i], qd[i] = near[i], 0.0
    for i in range(6):
        p[i] = near[18 + i]
    q[0], q[1], q[4], q[6] = variables[0], variables[1], variables[2], variables[3]
    q[3], q[7], q[8] = 0.0, 0.0, 0.0
    if not settle(q, p, function, parameters, c):
        return False
    qd[4], qd[6], per_rate[7] = variables[4], variables[5], 1.0
    complete_velocity(q, qd, p, function, parameters, c)
    complete_velocity(q, per_rate, p, function, parameters, c)
    constant, mixed, square = _fill_energy_terms(q, qd, per_rate, c)
    root = np.sqrt(mixed * mixed - 4 * square * (constant - energy))
    rate = (-mixed + root) / (2 * square) if near[16] > 0 else (-mixed - root) / (2 * square)
    for i in range(9):
        qd[i] += rate * per_rate[i]
    return True


@jit
def level_field(variables, energy, near, function, parameters, c, field, rear_rate):
    """Evaluate the reduced field on level sets of energy at n points.

    ``variables`` (n, 6) and ``energy`` (n,) are complex, ``near`` (24,) = (q, qd, contact parameters) is a real state
    at yaw 0 near all of them, ``function`` the surface's for complex numbers, ``c`` the `kinematics.Constants`. Fills
    field (n, 6), the time derivatives of the variables, and rear_rate (n,). Returns whether all points were reached.
    """
    q, qd, qdd = np.empty(9, np.complex128), np.empty(9, np.complex128), np.empty(9, np.complex128)
    p, force, p_rate = np.empty(6, np.complex128), np.empty(6, np.complex128), np.empty(6, np.complex128)
    for n in range(len(variables)):
        if not _place_on_level(variables[n], energy[n], near, q, qd, p, function, parameters, c):
            return False
        accelerations(q, qd, p, function, parameters, c, qdd, force, p_rate)
        field[n, 0], field[n, 1] = qd[0] + qd[3] * q[1], qd[1] - qd[3] * q[0]
        field[n, 2], field[n, 3] = qd[4], qd[6]
        field[n, 4], field[n, 5] = qdd[4], qdd[6]
        rear_rate[n] = qd[7]
    return True
