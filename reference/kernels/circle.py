"""Circular motions as eight equations in nine unknowns, without forces and without a redundant equation.

Unknowns: x, y, z, lean, pitch, steer | sigma / 400 | rim angles of the rear and the front wheel. In the
heading frame, at yaw 0 and per unit of yaw rate, a wheel's lowest rim point P = D + rho moves with
z x P, and its material point is at rest there if

    rim point       P lies on the surface,  P_z = f(P_x, P_y),  and  t . N = 0
    no side slip    (z x P) . (N x t) = 0
    rolling         spin = -(z x P) . t / r

This gives the spins b and c of both wheels for unit yaw rate, and with sigma = w^2 (1 + b^2 + c^2) the
square of the yaw rate w. At constant rates a_D = -w^2 (x, y, 0), and `reduction` gives the accelerations
of the bicycle beyond those; they must be zero. They are always orthogonal to the motion itself, in the
mass matrix's metric, since gravity, inertia and contact forces of a steady turn do no work in it; nor do a steer
torque and steer damping, as the steer rate is zero. So two of the three independent ones, lean'' and steer'', are
enough:

    rows            rim point (2), (2) | no side slip (2) | lean'', steer''

A torque on the rear wheel does work where that wheel rolls: with it the rows are sufficient only where b = 0.

Nothing here divides by a speed: static equilibria (sigma = 0, and sigma < 0 beyond) and pivoting motions
(b = 0) are regular points.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from .compilation import jit, jit_inline
from .pose import pose, times, to_aligned, to_inertial
from .reduction import build, front_force, solve
from .surface_call import evaluate_surface
from .vector import add, combine, cross, dot, scale, subtract

COORDINATES, ROWS = 9, 8
SIGMA_UNIT = 400.0  # (20 rad/s)^2: makes the unknown of the same order as the others
STEP = 1e-30  # complex step: the derivative is exact to round-off
FULL = 22  # number of unknowns of `steady`


class RimPoint(NamedTuple):
    """A wheel's lowest rim point over the surface; height and dip are zero where it touches."""

    height: Any  # of the point above the surface
    dip: Any  # t . N
    normal: Any  # N
    xi: Any
    eta: Any


class Rolling(NamedTuple):
    """A rolling wheel in a turn of unit yaw rate."""

    point: RimPoint
    slip: Any  # sideways, times |N|
    spin: Any


class Turn(NamedTuple):
    """Quantities from which the rows and the contact forces are computed."""

    here: Any
    rear: Any
    front: Any
    size: Any  # 1 + b^2 + c^2
    force: Any  # on both wheels together, components along (u, y, s)
    system: Any


@jit_inline
def rim_point(here, wheel, x, y, z, function, parameters):
    """Return the `RimPoint` of a wheel of a `Pose` with D at (x, y, z)."""
    rho = to_inertial(here, wheel.rho)
    xi, eta = x + rho[0], y + rho[1]
    f, fx, fy, _, _, _ = evaluate_surface(function, xi, eta, parameters)
    normal = subtract(here.z, combine(fx, here.x, fy, here.y))
    return RimPoint(z + rho[2] - f, dot(wheel.t, normal), normal, xi, eta)


@jit_inline
def _roll_wheel(here, wheel, x, y, z, function, parameters):
    point = rim_point(here, wheel, x, y, z, function, parameters)
    velocity = to_aligned(here, -point.eta, point.xi, 0 * point.xi)
    slip = dot(velocity, cross(point.normal, wheel.t))
    return Rolling(point, slip, -dot(velocity, wheel.t) / wheel.radius)


@jit_inline
def _build_turn(u, function, parameters, a):
    """Set up a turn from the unknowns ``u`` (9,); ``a`` the `Aligned` constants."""
    here = pose(0 * u[3], u[3], u[4], u[5], u[7], u[8], a)
    rear = _roll_wheel(here, here.rear, u[0], u[1], u[2], function, parameters)
    front = _roll_wheel(here, here.front, u[0], u[1], u[2], function, parameters)
    size = 1 + rear.spin * rear.spin + front.spin * front.spin
    square = SIGMA_UNIT * u[6] / size

    w, s1, s2 = here.z, here.s1, here.s2
    roll = combine(1.0, cross(w, here.rear.rho), here.rear.radius * rear.spin, here.rear.t)
    roll2 = combine(1.0, cross(w, here.front.rho), here.front.radius * front.spin, here.front.t)
    beta = scale(square, cross(w, roll))
    # Weight and the frame's acceleration -beta act in the same way.
    fall = combine(a.gravity, w, -1.0, beta)
    force = combine(square, cross(w, cross(w, add(s1, s2))), a.mass, fall)
    spun, spun2 = times(here.i1, w), combine(1.0, times(here.i2, w), a.spin_front * front.spin, here.left)
    turned = cross(w, (spun[0], spun[1] + a.spin_rear * rear.spin, spun[2]))
    moment = combine(square, turned, 1.0, cross(s1, fall))
    moment2 = combine(square, cross(w, spun2), 1.0, cross(s2, fall))
    b = combine(square, cross(w, roll2), -1.0, beta)
    steer_load = moment2[2] - a.steer_torque
    system = build(here, a, force, add(moment, moment2), steer_load, a.rear_wheel_torque, 0 * square, b)
    return Turn(here, rear, front, size, force, system)


@jit_inline
def _fill_rows(turn, out):
    alpha, steer, _, _ = solve(turn.system)
    out[0], out[1] = turn.rear.point.height, turn.rear.point.dip
    out[2], out[3] = turn.front.point.height, turn.front.point.dip
    out[4], out[5] = turn.rear.slip, turn.front.slip
    out[6], out[7] = dot(turn.here.ahead, alpha), steer


@jit
def circle_residual(u, function, parameters, a, out):
    """Fill ``out`` (8,) from the unknowns ``u`` (9,); ``a`` the `Aligned` constants."""
    _fill_rows(_build_turn(u, function, parameters, a), out)


@jit
def circle_jacobian(u, function, parameters, a, out):
    """Fill the Jacobian (8, 9) of `circle_residual` by the complex step."""
    z, r = u.astype(np.complex128), np.empty(ROWS, np.complex128)
    for j in range(COORDINATES):
        z[j] = complex(u[j], STEP)
        circle_residual(z, function, parameters, a, r)
        z[j] = u[j]
        for i in range(ROWS):
            out[i, j] = r[i].imag / STEP


@jit_inline
def _fill_unknowns(u, turn, a, out):
    zero = 0 * u[0]
    rest = (zero, zero, zero)
    on_front = front_force(turn.system, rest, zero, zero, zero)
    on_rear = subtract(turn.force, on_front)
    speed = 1 / np.sqrt(turn.size)
    weight = a.mass * a.gravity
    for i in range(6):
        out[i] = u[i]
    out[6], out[7], out[8], out[9] = speed, speed * turn.rear.spin, speed * turn.front.spin, u[6]
    out[10], out[11], out[12] = turn.rear.point.xi, turn.rear.point.eta, u[7]
    out[13], out[14], out[15] = turn.front.point.xi, turn.front.point.eta, u[8]
    out[16], out[17], out[18] = to_inertial(turn.here, scale(1 / weight, on_rear))
    out[19], out[20], out[21] = to_inertial(turn.here, scale(1 / weight, on_front))


@jit
def unfold(u, function, parameters, a, out):
    """Fill ``out`` (22,), all unknowns of `steady`, from a solution ``u`` (9,); the yaw rate is taken positive."""
    _fill_unknowns(u, _build_turn(u, function, parameters, a), a, out)


@jit
def circle_and_unknowns(u, function, parameters, a, rows, full):
    """Fill what `circle_residual` does, rows (8,), and what `unfold` does, full (22,)."""
    turn = _build_turn(u, function, parameters, a)
    _fill_rows(turn, rows)
    _fill_unknowns(u, turn, a, full)
