"""A knife-edge wheel as the engine sees it: one rigid body whose coordinates are Euler parameters.

With the body's centre c, its rotation A(theta) and its axle y = A e_y, the contact search gives the vector
d from the centre to the contact and the contact frame F = (lateral, forward, normal). The material
velocity of the contact, in that frame, is linear in the coordinates' rates:

    F (c' + w x d) = F [I, -skew(d) G(theta)] (c', theta') = W q'

whose normal row is the gap's gradient, since the contact is a closest approach.
"""

from __future__ import annotations

import numpy as np

from reference.kernels import contact
from reference.kernels.vector import cross, dot, jit


@jit
def axes(t0, t1, t2, t3):
    """Unit vectors (x, y, z) of a body with Euler parameters of any length.

    Newton's iterates leave the unit sphere; the engine's own equation brings them back, so contact must
    not feel the length.
    """
    s = 2 / (t0 * t0 + t1 * t1 + t2 * t2 + t3 * t3)
    x = (1 - s * (t2 * t2 + t3 * t3), s * (t1 * t2 + t0 * t3), s * (t1 * t3 - t0 * t2))
    y = (s * (t1 * t2 - t0 * t3), 1 - s * (t1 * t1 + t3 * t3), s * (t2 * t3 + t0 * t1))
    z = (s * (t1 * t3 + t0 * t2), s * (t2 * t3 - t0 * t1), 1 - s * (t1 * t1 + t2 * t2))
    return x, y, z


@jit
def contact_frame(centre, x, axle, z, radius, function, parameters):
    """Return (gap, d, (lateral, forward, normal)) of a wheel; the gap is NaN where no contact is found."""
    xi, eta, angle = contact.first_guess(centre, x, z, radius, function, parameters)
    xi, eta, angle, found = contact.search(centre, x, z, radius, xi, eta, angle, function, parameters)
    _, _, gap, normal, d, _, _, _, _, _, _ = contact.equations(
        centre, x, z, radius, xi, eta, angle, function, parameters
    )
    lateral, forward = contact.tangents(axle, normal)
    return gap if found else np.nan, d, (lateral, forward, normal)


@jit
def velocity_rows(coordinates, radius, function, parameters, rows):
    """Fill ``rows`` (3, 7) with W (lateral, forward, normal) at coordinates (7,); return the gap."""
    t0, t1, t2, t3 = coordinates[3], coordinates[4], coordinates[5], coordinates[6]
    x, axle, z = axes(t0, t1, t2, t3)
    centre = (coordinates[0], coordinates[1], coordinates[2])
    gap, d, frame = contact_frame(centre, x, axle, z, radius, function, parameters)
    for i in range(3):
        # e . (w x d) = w . (d x e), and w = G theta' is twice the vector part of theta' conj(theta).
        m0, m1, m2 = cross(d, frame[i])
        for j in range(3):
            rows[i, j] = frame[i][j]
        rows[i, 3] = -2 * (t1 * m0 + t2 * m1 + t3 * m2)
        rows[i, 4] = 2 * (t0 * m0 + t3 * m1 - t2 * m2)
        rows[i, 5] = 2 * (-t3 * m0 + t0 * m1 + t1 * m2)
        rows[i, 6] = 2 * (t2 * m0 - t1 * m1 + t0 * m2)
    return gap


@jit
def observe(position, velocity, rotation, spin, radius, function, parameters, point, frames, gap, slip):
    """Measure one wheel's contact along n samples of its own motion.

    position, velocity, spin (n, 3) and rotation (n, 3, 3) are the body's, in inertial axes. Fills point
    (n, 3), frames (n, 3, 3) with rows lateral, forward and normal, gap (n,), and slip (n, 2).
    """
    for n in range(position.shape[0]):
        a = rotation[n]
        x, axle, z = (a[0, 0], a[1, 0], a[2, 0]), (a[0, 1], a[1, 1], a[2, 1]), (a[0, 2], a[1, 2], a[2, 2])
        centre = (position[n, 0], position[n, 1], position[n, 2])
        gap[n], d, frame = contact_frame(centre, x, axle, z, radius, function, parameters)
        turning = cross((spin[n, 0], spin[n, 1], spin[n, 2]), d)
        material = (velocity[n, 0] + turning[0], velocity[n, 1] + turning[1], velocity[n, 2] + turning[2])
        slip[n, 0], slip[n, 1] = dot(frame[0], material), dot(frame[1], material)
        for i in range(3):
            point[n, i] = centre[i] + d[i]
            for j in range(3):
                frames[n, i, j] = frame[i][j]
