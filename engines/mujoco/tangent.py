"""Poses of the surface's tangent planes below both wheels, in MuJoCo's form.

For each wheel the contact equations give the surface point u of closest approach and the normal n.
The plane through u with its z axis along n has the quaternion of the shortest rotation from z to n,

    (1 + n_z, -n_y, n_x, 0) / |...|

A plane in MuJoCo touches the wheel at the rim point that lies deepest along n, which is the rim point of
the contact equations: distance and normal are exactly those of the curved surface.
"""

from __future__ import annotations

import numpy as np

from ...reference.kernels import contact
from ...reference.kernels.arrays import copy_array
from ...reference.kernels.compilation import jit
from ...reference.kernels.dynamics import find_contacts, wheels
from ...reference.kernels.fall import height_above_fallen
from ...reference.kernels.vector import dot

# Half the thickness of a wheel, since MuJoCo has no knife edge [m].
HALF_THICKNESS = 1e-4


@jit
def tangent_coordinates(qpos):
    """Return the generalised coordinates (9,) at MuJoCo's ``qpos`` (10,)."""
    w, x, y, z = qpos[3], qpos[4], qpos[5], qpos[6]
    q = np.empty(9)
    q[0], q[1], q[2] = qpos[0], qpos[1], qpos[2]
    q[3] = np.arctan2(2 * (w * z - x * y), 1 - 2 * (x * x + z * z))
    q[4] = np.arctan2(2 * (y * z + w * x), np.hypot(2 * (x * y - w * z), 1 - 2 * (x * x + z * z)))
    q[5] = np.arctan2(2 * (w * y - x * z), 1 - 2 * (x * x + y * y))
    q[6], q[7], q[8] = qpos[8], qpos[7], qpos[9]
    return q


@jit
def wheel_poses(qpos, c, centre, axle):
    """Fill the centres and axles (2, 3) of the wheels at ``qpos`` (10,)."""
    both = wheels(tangent_coordinates(qpos), c)
    for k in range(2):
        for i in range(3):
            centre[k, i], axle[k, i] = both[k][0][i], both[k][2][i]


@jit
def find_height(qpos, fall, function, parameters):
    """Return the height of the bicycle at ``qpos`` (10,) above that of a fallen one."""
    y = np.zeros(18)
    copy_array(tangent_coordinates(qpos), y[:9])
    height, _ = height_above_fallen(y, fall, function, parameters)
    return height


@jit
def place_planes(qpos, c, function, parameters, p, position, quaternion):
    """Fill the poses (2, 3), (2, 4) of both planes at ``qpos`` (10,); return whether both wheels stand on one.

    ``p`` (6,) are the contact parameters: a guess, which the solution replaces. The result is False where a search
    fails, or where a wheel lies flat, with its centre less than its own thickness above the contact. In later poses of
    such a wheel the search has followed the rim, and the contact is above the centre.
    """
    q = tangent_coordinates(qpos)
    if not find_contacts(q, p, function, parameters, c):
        return False
    both = wheels(q, c)
    for k in range(2):
        centre, x_wheel, _, z_wheel, radius = both[k]
        xi, eta, angle = p[3 * k], p[3 * k + 1], p[3 * k + 2]
        _, _, _, n, d, _, _, _, _, _, _ = contact.equations(
            centre, x_wheel, z_wheel, radius, xi, eta, angle, function, parameters
        )
        if not dot(d, n) < -HALF_THICKNESS:
            return False
        height, _, _, _, _, _ = function(xi, eta, parameters)
        position[k, 0], position[k, 1], position[k, 2] = xi, eta, height
        length = np.sqrt(2 * (1 + n[2]))
        quaternion[k, 0] = (1 + n[2]) / length
        quaternion[k, 1], quaternion[k, 2], quaternion[k, 3] = -n[1] / length, n[0] / length, 0.0
    return True
