"""Frames of the bicycle: yaw, lean, pitch (3-1-2) and steer about the tilted axis.

The axes in the inertial frame are

    a_lean = (cos yaw, sin yaw, 0)
    y_r = a_lean turned by a right angle about z, then by lean about a_lean
    x_r, z_r = a_lean, a_lean x y_r, turned by pitch about y_r
    s = -sin(tilt) x_r + cos(tilt) z_r             steering axis
    x_h, y_h, z_h = x_r, y_r, z_r turned by steer about s
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .compilation import jit
from .vector import add, combine, cross, scale


class Constants(NamedTuple):
    """The constants of the bicycle and its inputs: rear and front assemblies about D, wheels as spins.

    A wheel is symmetric about its axle, so it belongs to its frame as a rigid part (a gyrostat) and
    only its spin relative to the frame is a motion of its own. Suffix 1 is the rear assembly (frame
    and wheel) in axes of the rear frame, 2 the front assembly in axes of the front frame; first
    moments and inertia tensors are taken about D.
    """

    gravity: float
    m1: float
    s1x: float
    s1z: float
    i1xx: float
    i1yy: float
    i1zz: float
    i1xz: float
    m2: float
    s2x: float
    s2z: float
    i2xx: float
    i2yy: float
    i2zz: float
    i2xz: float
    spin_rear: float
    spin_front: float
    rear_x: float  # rear wheel's centre from D
    rear_z: float
    front_x: float
    front_z: float
    rear_radius: float
    front_radius: float
    sin_tilt: float
    cos_tilt: float
    steer_torque: float = 0.0  # inputs, see `velodrome.reference.inputs`
    rear_wheel_torque: float = 0.0
    steer_damping: float = 0.0


@jit
def frames(yaw, lean, pitch, steer, c):
    """Return the axes ``(a_lean, x_r, y_r, z_r, s, x_h, y_h, z_h)`` in the inertial frame."""
    cy, sy, cl, sl = np.cos(yaw), np.sin(yaw), np.cos(lean), np.sin(lean)
    cp, sp, cd, sd = np.cos(pitch), np.sin(pitch), np.cos(steer), np.sin(steer)
    zero = 0 * cy
    a_lean = (cy, sy, zero)
    y_r = (-sy * cl, cy * cl, sl)
    up = (sy * sl, -cy * sl, cl)
    x_r = combine(cp, a_lean, -sp, up)
    z_r = combine(sp, a_lean, cp, up)
    s = combine(-c.sin_tilt, x_r, c.cos_tilt, z_r)
    u = combine(c.cos_tilt, x_r, c.sin_tilt, z_r)
    y_h = combine(-sd, u, cd, y_r)
    u_h = combine(cd, u, sd, y_r)
    x_h = combine(c.cos_tilt, u_h, -c.sin_tilt, s)
    z_h = combine(c.sin_tilt, u_h, c.cos_tilt, s)
    return a_lean, x_r, y_r, z_r, s, x_h, y_h, z_h


@jit
def rim(angle, x, z):
    """Return the radial and tangent unit vectors (e, t) of a rim at ``angle``: e(0) = -z, t = de/dangle = y x e."""
    ca, sa = np.cos(angle), np.sin(angle)
    return combine(-sa, x, -ca, z), combine(-ca, x, sa, z)


@jit
def angular_velocities(a_lean, y_r, s, yaw_rate, lean_rate, pitch_rate, steer_rate):
    """Return the angular velocities of both frames and the parts of their accelerations that depend on rates alone.

    w1 = yaw_rate z + lean_rate a_lean + pitch_rate y_r,  w2 = w1 + steer_rate s
    b1 = yaw_rate z x lean_rate a_lean + (yaw_rate z + lean_rate a_lean) x pitch_rate y_r
    b2 = b1 + w1 x steer_rate s
    """
    turn = (0 * yaw_rate, 0 * yaw_rate, yaw_rate)
    lean = scale(lean_rate, a_lean)
    pitch = scale(pitch_rate, y_r)
    steer = scale(steer_rate, s)
    tilt = add(turn, lean)
    w1 = add(tilt, pitch)
    b1 = add(cross(turn, lean), cross(tilt, pitch))
    return w1, add(w1, steer), b1, add(b1, cross(w1, steer))
