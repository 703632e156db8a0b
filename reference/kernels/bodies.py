"""Positions and orientations of the four bodies, in the order rear frame, front frame, rear wheel, front wheel."""

from __future__ import annotations

import math

from .compilation import jit
from .kinematics import frames
from .vector import combine


@jit
def fill_positions(q, offsets, c, out):
    """Fill the centres of mass (n, 4, 3) along coordinates (n, 9); ``offsets`` (4, 3) are those from D at rest."""
    for n in range(q.shape[0]):
        _, x_r, y_r, z_r, _, x_h, y_h, z_h = frames(q[n, 3], q[n, 4], q[n, 5], q[n, 6], c)
        for body in range(4):
            along, across, up = offsets[body, 0], offsets[body, 1], offsets[body, 2]
            # A wheel's centre lies on its axle, so the wheel's own rotation does not move it.
            x, y, z = (x_r, y_r, z_r) if body % 2 == 0 else (x_h, y_h, z_h)
            arm = combine(along, x, up, z)
            for i in range(3):
                out[n, body, i] = q[n, i] + (arm[i] + across * y[i])


@jit
def _turn(a, x, y, z, angle):
    """Return the quaternion a times that of a rotation by an angle about the unit axis (x, y, z)."""
    w, sine = math.cos(0.5 * angle), math.sin(0.5 * angle)
    x, y, z = x * sine, y * sine, z * sine
    return (
        a[0] * w - a[1] * x - a[2] * y - a[3] * z,
        a[0] * x + a[1] * w + a[2] * z - a[3] * y,
        a[0] * y - a[1] * z + a[2] * w + a[3] * x,
        a[0] * z + a[1] * y - a[2] * x + a[3] * w,
    )


@jit
def fill_quaternions(q, c, out):
    """Fill the orientations (n, 4, 4), unit quaternions (w, x, y, z), along coordinates (n, 9)."""
    for n in range(q.shape[0]):
        rear = _turn((1.0, 0.0, 0.0, 0.0), 0.0, 0.0, 1.0, q[n, 3])
        rear = _turn(_turn(rear, 1.0, 0.0, 0.0, q[n, 4]), 0.0, 1.0, 0.0, q[n, 5])
        front = _turn(rear, -c.sin_tilt, 0.0, c.cos_tilt, q[n, 6])
        wheels = (_turn(rear, 0.0, 1.0, 0.0, q[n, 7]), _turn(front, 0.0, 1.0, 0.0, q[n, 8]))
        for i in range(4):
            out[n, 0, i], out[n, 1, i] = rear[i], front[i]
            out[n, 2, i], out[n, 3, i] = wheels[0][i], wheels[1][i]
