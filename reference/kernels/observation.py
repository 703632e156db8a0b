"""Contacts, gaps, slip and energies of both wheels and assemblies along a trajectory.

With the angular velocities w1, w2 of rear and front frame, the first moments S1, S2 and inertias I1, I2 of both
assemblies about D, and wheels that spin with rate about their axles as gyrostats of axial moment J

    material velocity of a contact:  v_D + w x rho + spin_rate axle x d
    kinetic energy:                  m v_D^2 / 2 + v_D . (w1 x S1 + w2 x S2) + (w1 . I1 w1 + w2 . I2 w2) / 2
                                     + sum over the wheels of J spin_rate (axle . w + spin_rate / 2)
    potential energy:                g (m z_D + (S1 + S2) . up)
"""

from __future__ import annotations

from . import contact
from .compilation import jit
from .dynamics import find_contacts, find_contacts_from_pose, inertia_times, wheels
from .kinematics import angular_velocities, frames
from .vector import add, combine, cross, dot


@jit
def _fill_contacts(q, qd, w, p, function, parameters, c, point, normal, gap, slip):
    """Fill the contacts of one state; ``w`` are the angular velocities of both frames, ``p`` (6,) the parameters."""
    both = wheels(q, c)
    for k in range(2):
        centre, x, axle, z, radius = both[k]
        row = 3 * k
        here = contact.equations(centre, x, z, radius, p[row], p[row + 1], p[row + 2], function, parameters)
        lateral, forward = contact.tangents(axle, here.normal)
        d = here.arm
        rho = (centre[0] + d[0] - q[0], centre[1] + d[1] - q[1], centre[2] + d[2] - q[2])
        velocity = combine(1.0, add((qd[0], qd[1], qd[2]), cross(w[k], rho)), qd[7 + k], cross(axle, d))
        gap[k] = here.gap
        slip[k, 0], slip[k, 1] = dot(lateral, velocity), dot(forward, velocity)
        for i in range(3):
            point[k, i] = centre[i] + d[i]
            normal[k, i] = here.normal[i]


@jit
def observe_states(q, qd, contacts, known, ground, function, parameters, c, point, normal, gap, slip, energy, found):
    """Observe n states.

    contacts (n, 6) are the contact parameters if they are ``known``; otherwise they are filled with those where the
    rims are deepest. Fills point and normal (n, 2, 3); gap (n, 2); slip (n, 2, 2), the lateral and forward material
    velocity of the contact; energy (n, 2), kinetic and potential; found (n,), whether both contacts were found.
    """
    mass = c.m1 + c.m2
    for n in range(q.shape[0]):
        a_lean, x_r, y_r, z_r, s, x_h, y_h, z_h = frames(q[n, 3], q[n, 4], q[n, 5], q[n, 6], c)
        w1, w2, _, _ = angular_velocities(a_lean, y_r, s, qd[n, 3], qd[n, 4], qd[n, 5], qd[n, 6])
        if known:
            found[n] = find_contacts(q[n], contacts[n], function, parameters, c)
        else:
            found[n] = find_contacts_from_pose(q[n], contacts[n], ground, function, parameters, c)
        _fill_contacts(
            q[n], qd[n], (w1, w2), contacts[n], function, parameters, c, point[n], normal[n], gap[n], slip[n]
        )
        s1, s2 = combine(c.s1x, x_r, c.s1z, z_r), combine(c.s2x, x_h, c.s2z, z_h)
        v, rear, front = (qd[n, 0], qd[n, 1], qd[n, 2]), qd[n, 7], qd[n, 8]
        turning = dot(w1, inertia_times(c.i1xx, c.i1yy, c.i1zz, c.i1xz, x_r, y_r, z_r, w1))
        turning += dot(w2, inertia_times(c.i2xx, c.i2yy, c.i2zz, c.i2xz, x_h, y_h, z_h, w2))
        kinetic = 0.5 * (mass * dot(v, v) + turning) + dot(v, add(cross(w1, s1), cross(w2, s2)))
        kinetic += c.spin_rear * rear * (dot(y_r, w1) + 0.5 * rear)
        kinetic += c.spin_front * front * (dot(y_h, w2) + 0.5 * front)
        energy[n, 0], energy[n, 1] = kinetic, c.gravity * (mass * q[n, 2] + s1[2] + s2[2])
