"""Circular motions in full: the rotated equations with contact points and forces (Xiong et al. 2020, Eqs. 9-14).

In the heading frame all 21 quantities of a circular motion are constant. At yaw = 0

    q   = (x, y, z, 0, lean, pitch, steer, 0, 0)
    qd  = (-w y, w x, 0, w, 0, 0, 0, wr, wf)
    qdd = (-w^2 x, -w^2 y, 0, ..., 0)

The three speeds are written (w, wr, wf) = sqrt(sigma) (a, b, c) with a^2 + b^2 + c^2 = 1. Rolling is
linear in the speeds and needs only their direction, the dynamics quadratic and needs only sigma times
squares of it, so static equilibria (sigma = 0) and pivoting motions (b = 0) are regular points.

Unknowns (22): x, y, z, lean, pitch, steer | a, b, c | sigma / 400 | contact parameters (6) | contact
forces / weight (6). Rows (22): the 21 equations, speeds by their direction, and the normalisation.

A solution holds for (a, b, c) and for (-a, -b, -c), the same circle ridden the other way. `direction` chooses the one
whose rear wheel rolls forward, b > 0. Where the rear wheel stands, b = 0 to round-off, the motion runs with the signs
of the unknowns. The solvers return a > 0, a turn to the left; where a family of curves ends in the pivoting motion,
the signs stored there are those with which it turns as its neighbours on that curve do
(`velodrome.reference.families`).

Solutions are found in the smaller form of `circle`; this form describes them and measures their residuals.
"""

from __future__ import annotations

import numpy as np

from .circle import SIGMA_UNIT, STEP
from .compilation import jit
from .dynamics import energies, mass_and_bias, residual

UNKNOWNS = 22
STANDING = 1e-12  # of b, at most 1: at the pivoting motion, which is solved for, b is round-off of either sign


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
    # The rolling rows use the direction of the speeds; the dynamics rows are replaced.
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
def direction(rear):
    """Return the sign of (a, b, c) with which the rear wheel rolls forward, from ``rear`` = b; 1 where it stands."""
    return -1.0 if rear < -STANDING else 1.0


@jit
def running_rates(u):
    """Return the rates of yaw, rear wheel and front wheel [rad/s] at the unknowns ``u`` (22,), run in `direction`."""
    speed = np.sqrt(SIGMA_UNIT * max(u[9], 0.0)) * direction(u[7])
    # At rest a product may be -0.
    return speed * u[6] + 0.0, speed * u[7] + 0.0, speed * u[8] + 0.0


@jit
def steady_energy(u, c):
    """Return kinetic plus potential energy at the unknowns ``u`` (22,) [J]."""
    q, qd = np.zeros(9, u.dtype), np.zeros(9, u.dtype)
    q[0], q[1], q[2], q[4], q[5], q[6] = u[0], u[1], u[2], u[3], u[4], u[5]
    qd[0], qd[1], qd[3], qd[7], qd[8] = -u[6] * u[1], u[6] * u[0], u[6], u[7], u[8]
    kinetic, potential = energies(q, qd, c)
    return SIGMA_UNIT * u[9] * kinetic + potential
