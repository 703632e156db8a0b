"""The bicycle in axes (u, y, s): the rear frame turned about its axle until its third axis is the steering axis.

In these axes steer is a turn about the third axis, the rear wheel lies in the plane of the first and the third, and
most of the components used in the right-hand side are zero or one. With T the tilt of the steering
axis, x_r and z_r the axes of the rear frame (`kinematics.frames`) and e(angle), t(angle) those of a rim

    u = cos T x_r + sin T z_r,    s = -sin T x_r + cos T z_r
    e = -sin(angle + T) u - cos(angle + T) s,    t = -cos(angle + T) u + sin(angle + T) s

and the same with u turned by steer for the front wheel.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from .compilation import jit, jit_inline
from .fused import multiply_add
from .trigonometry import sine_and_cosine
from .vector import add, combine, dot, scale


class Aligned(NamedTuple):
    """`kinematics.Constants` in axes (u, y, s); those of the front assembly at zero steer."""

    gravity: float
    mass: float
    s1: Any  # (x, z) of the rear assembly's first moment about D
    i1: Any  # (xx, yy, zz, xz) of its inertia about D
    s2: Any
    i2: Any
    spin_rear: float
    spin_front: float
    rear: Any  # (x, z) of the rear wheel's centre from D
    front: Any
    rear_radius: float
    front_radius: float
    sin_tilt: float
    cos_tilt: float
    steer_torque: float
    rear_wheel_torque: float
    steer_damping: float


@jit
def _to_aligned_pair(x, z, c):
    return c.cos_tilt * x + c.sin_tilt * z, c.cos_tilt * z - c.sin_tilt * x


@jit
def _to_aligned_inertia(xx, yy, zz, xz, c):
    sine, cosine = c.sin_tilt, c.cos_tilt
    both = 2 * sine * cosine * xz
    return (
        cosine * cosine * xx + both + sine * sine * zz,
        yy,
        sine * sine * xx - both + cosine * cosine * zz,
        (cosine * cosine - sine * sine) * xz + sine * cosine * (zz - xx),
    )


@jit
def aligned(c):
    """Turn `kinematics.Constants` into axes (u, y, s)."""
    return Aligned(
        c.gravity,
        c.m1 + c.m2,
        _to_aligned_pair(c.s1x, c.s1z, c),
        _to_aligned_inertia(c.i1xx, c.i1yy, c.i1zz, c.i1xz, c),
        _to_aligned_pair(c.s2x, c.s2z, c),
        _to_aligned_inertia(c.i2xx, c.i2yy, c.i2zz, c.i2xz, c),
        c.spin_rear,
        c.spin_front,
        _to_aligned_pair(c.rear_x, c.rear_z, c),
        _to_aligned_pair(c.front_x, c.front_z, c),
        c.rear_radius,
        c.front_radius,
        c.sin_tilt,
        c.cos_tilt,
        c.steer_torque,
        c.rear_wheel_torque,
        c.steer_damping,
    )


class Wheel(NamedTuple):
    """Geometry of a wheel at its contact."""

    rho: Any  # contact from D
    e: Any  # radial unit vector, from the centre to the contact
    t: Any  # tangent, axle x e
    radius: Any


class Pose(NamedTuple):
    """Quantities that depend on angles alone, as components along (u, y, s)."""

    x: Any  # inertial axes
    y: Any
    z: Any
    ahead: Any  # a_lean
    above: Any  # a_lean x rear axle
    sin_lean: Any
    cos_lean: Any
    left: Any  # front axle
    rear: Any
    front: Any
    s1: Any  # first moments of rear and front assembly about D
    s2: Any
    i1: Any  # inertia about D: xx, yy, zz, xy, xz, yz
    i2: Any


@jit_inline
def _place_wheel(hub, radius, angle, forward, a):
    sine, cosine = sine_and_cosine(angle)
    s, c = sine * a.cos_tilt + cosine * a.sin_tilt, cosine * a.cos_tilt - sine * a.sin_tilt
    e = (-s * forward[0], -s * forward[1], -c)
    t = (-c * forward[0], -c * forward[1], s)
    reach = hub[0] - radius * s
    return Wheel((reach * forward[0], reach * forward[1], hub[1] - radius * c), e, t, radius)


@jit_inline
def pose(yaw, lean, pitch, steer, rear_angle, front_angle, a):
    """Return the `Pose` at yaw, lean, pitch, steer and the two rim angles; ``a`` the `Aligned` constants."""
    (sy, cy), (sl, cl), (sd, cd) = sine_and_cosine(yaw), sine_and_cosine(lean), sine_and_cosine(steer)
    sine, cosine = sine_and_cosine(pitch)
    cp, sp = cosine * a.cos_tilt + sine * a.sin_tilt, sine * a.cos_tilt - cosine * a.sin_tilt
    zero = 0 * cy
    one = 1 + zero
    ahead, above, across = (cp, zero, sp), (-sp, zero, cp), (sl * sp, cl, -sl * cp)
    forward = (cd, sd, zero)
    xx, yy, zz, xz = a.i2
    turned = cd * cd * xx + sd * sd * yy
    return Pose(
        x=combine(cy, ahead, -sy, across),
        y=combine(sy, ahead, cy, across),
        z=(-cl * sp, sl, cl * cp),
        ahead=ahead,
        above=above,
        sin_lean=sl,
        cos_lean=cl,
        left=(-sd, cd, zero),
        rear=_place_wheel(a.rear, a.rear_radius, rear_angle, (one, zero, zero), a),
        front=_place_wheel(a.front, a.front_radius, front_angle, forward, a),
        s1=(a.s1[0] * one, zero, a.s1[1] * one),
        s2=(cd * a.s2[0], sd * a.s2[0], a.s2[1] * one),
        i1=(a.i1[0] * one, a.i1[1] * one, a.i1[2] * one, zero, a.i1[3] * one, zero),
        i2=(turned, xx + yy - turned, zz * one, cd * sd * (xx - yy), cd * xz, sd * xz),
    )


@jit_inline
def times(k, v):
    """Multiply a symmetric matrix (xx, yy, zz, xy, xz, yz) by a vector."""
    return (
        multiply_add(k[4], v[2], multiply_add(k[3], v[1], k[0] * v[0])),
        multiply_add(k[5], v[2], multiply_add(k[1], v[1], k[3] * v[0])),
        multiply_add(k[2], v[2], multiply_add(k[5], v[1], k[4] * v[0])),
    )


@jit_inline
def angular_velocity(here, turn, lean, pitch):
    """Return the angular velocity of the rear frame from the rates of its angles."""
    w = combine(turn, here.z, lean, here.ahead)
    return w[0], w[1] + pitch, w[2]


@jit_inline
def angle_rates(here, w):
    """Return the rates of yaw, lean and pitch from an angular velocity: the inverse of `angular_velocity`."""
    turn = dot(here.above, w) / here.cos_lean
    return turn, dot(here.ahead, w), w[1] - here.sin_lean * turn


@jit_inline
def to_aligned(here, x, y, z):
    """Return components along (u, y, s) from inertial ones."""
    return add(combine(x, here.x, y, here.y), scale(z, here.z))


@jit_inline
def to_inertial(here, v):
    """Return inertial components from those along (u, y, s)."""
    return dot(here.x, v), dot(here.y, v), dot(here.z, v)
