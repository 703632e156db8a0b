"""Circular motions and their linearisation: the rotated equations (Xiong et al. 2020, Eqs. 9-17).

In the heading frame all 21 quantities of a circular motion are constant. At yaw = 0

    q   = (x, y, z, 0, lean, pitch, steer, 0, 0)
    qd  = (-w y, w x, 0, w, 0, 0, 0, wr, wf)
    qdd = (-w^2 x, -w^2 y, 0, ..., 0)

The three speeds are written (w, wr, wf) = sqrt(sigma) (a, b, c) with a^2 + b^2 + c^2 = 1. Rolling is
linear in the speeds and needs only their direction, the dynamics quadratic and needs only sigma times
squares of it, so static equilibria (sigma = 0) and pivoting motions (b = 0) are regular points.

Unknowns (22): x, y, z, lean, pitch, steer | a, b, c | sigma / 400 | contact parameters (6) | contact
forces / weight (6). Rows (22): the 21 equations, speeds by their direction, and the normalisation.
"""

from __future__ import annotations

import numpy as np

from .dynamics import accelerations, complete_velocity, energies, mass_and_bias, residual, settle
from .vector import jit

UNKNOWNS = 22
SIGMA_UNIT = 400.0  # (20 rad/s)^2: keeps the unknown of the size of the others
STEP = 1e-30  # complex step: the derivative is exact to round-off


@jit
def steady_residual(u, function, parameters, c, out):
    """Fill ``out`` (22,) from the unknowns ``u`` (22,)."""
    q, qd, qdd = np.zeros(9, u.dtype), np.zeros(9, u.dtype), np.zeros(9, u.dtype)
    mass, moving, resting = np.empty((9, 9), u.dtype), np.empty(9, u.dtype), np.empty(9, u.dtype)
    weight = (c.m1 + c.m2) * c.gravity
    q[0], q[1], q[2], q[4], q[5], q[6] = u[0], u[1], u[2], u[3], u[4], u[5]
    residual(q, qd, qdd, u[10:16], u[16:22] * weight, function, parameters, c, out[:21])
    for i in range(9):
        resting[i] = out[i]
    qd[0], qd[1], qd[3], qd[7], qd[8] = -u[6] * u[1], u[6] * u[0], u[6], u[7], u[8]
    # The rolling rows see the direction of the speeds, the dynamics rows are replaced.
    residual(q, qd, qdd, u[10:16], u[16:22] * weight, function, parameters, c, out[:21])
    qdd[0], qdd[1] = -u[6] * u[6] * u[0], -u[6] * u[6] * u[1]
    mass_and_bias(q, qd, c, mass, moving)
    qd[:] = 0
    still = np.empty(9, u.dtype)
    mass_and_bias(q, qd, c, mass, still)
    for i in range(9):
        inertial = moving[i] - still[i]
        for k in range(2):
            inertial += mass[i, k] * qdd[k]
        out[i] = resting[i] + SIGMA_UNIT * u[9] * inertial / weight
    out[21] = u[6] * u[6] + u[7] * u[7] + u[8] * u[8] - 1


@jit
def steady_jacobian(u, function, parameters, c, out):
    """Fill the Jacobian (22, 22) of `steady_residual` by the complex step."""
    z, r = u.astype(np.complex128), np.empty(UNKNOWNS, np.complex128)
    for j in range(UNKNOWNS):
        z[j] = complex(u[j], STEP)
        steady_residual(z, function, parameters, c, r)
        z[j] = u[j]
        for i in range(UNKNOWNS):
            out[i, j] = r[i].imag / STEP


@jit
def steady_energy(u, c):
    """Kinetic plus potential energy at the unknowns ``u`` (22,) [J]."""
    q, qd = np.zeros(9, u.dtype), np.zeros(9, u.dtype)
    q[0], q[1], q[2], q[4], q[5], q[6] = u[0], u[1], u[2], u[3], u[4], u[5]
    qd[0], qd[1], qd[3], qd[7], qd[8] = -u[6] * u[1], u[6] * u[0], u[6], u[7], u[8]
    kinetic, potential = energies(q, qd, c)
    return SIGMA_UNIT * u[9] * kinetic + potential


@jit
def reduced_field(v, q, p, function, parameters, c, out):
    """The reduced vector field X(v) (Eq. 16), v = (x, y, lean, steer, lean_rate, steer_rate, rear_rate).

    ``q`` (9,) and ``p`` (6,) bring the guess of the dependent coordinates and take their values. False
    where the wheels do not reach the ground.
    """
    qd, qdd = np.zeros(9, v.dtype), np.empty(9, v.dtype)
    force, rate = np.empty(6, v.dtype), np.empty(6, v.dtype)
    q[0], q[1], q[3], q[4], q[6] = v[0], v[1], 0, v[2], v[3]
    qd[4], qd[6], qd[7] = v[4], v[5], v[6]
    if not settle(q, p, function, parameters, c):
        return False
    complete_velocity(q, qd, p, function, parameters, c)
    accelerations(q, qd, p, function, parameters, c, qdd, force, rate)
    out[0] = qd[0] + qd[3] * v[1]
    out[1] = qd[1] - qd[3] * v[0]
    out[2], out[3] = v[4], v[5]
    out[4], out[5], out[6] = qdd[4], qdd[6], qdd[7]
    return True


@jit
def reduced_jacobian(v, q, p, function, parameters, c, out):
    """Fill dX/dv (7, 7) by the complex step around a state whose dependent coordinates have converged."""
    z, r = v.astype(np.complex128), np.empty(7, np.complex128)
    good = True
    for j in range(7):
        z[j] = complex(v[j], STEP)
        good = reduced_field(z, q.astype(np.complex128), p.astype(np.complex128), function, parameters, c, r) and good
        z[j] = v[j]
        for i in range(7):
            out[i, j] = r[i].imag / STEP
    return good
