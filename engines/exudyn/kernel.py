"""Contact of a knife-edge wheel that is a rigid body with Euler parameters as coordinates, on ground at rest.

This is the commonest case of `general`, in two to three times less time.

With the node's position x, the body's rotation A(theta), the wheel's centre c = x + A p and its axle
a = A b (p and b fixed in the body), the contact search gives the vector d from the centre to the contact
and the contact frame F = (lateral, forward, normal). The material velocity of the contact, in that frame,
is linear in the coordinates' rates:

    F (x' + w x (A p + d)) = F [I, -skew(A p + d) G(theta)] (x', theta') = W q'

and its normal row is the gap's gradient, since the contact is a closest approach.
"""

from __future__ import annotations

import numpy as np

from ...reference.kernels.compilation import jit
from ...reference.kernels.vector import add, cross
from ...reference.kernels.wheel import contact_frame


@jit
def axes(t0, t1, t2, t3):
    """Return unit vectors (x, y, z) of a body with Euler parameters of any length.

    Newton's iterates leave the unit sphere, and the engine's own equation brings them back, so the contact must
    not depend on the length.
    """
    s = 2 / (t0 * t0 + t1 * t1 + t2 * t2 + t3 * t3)
    x = (1 - s * (t2 * t2 + t3 * t3), s * (t1 * t2 + t0 * t3), s * (t1 * t3 - t0 * t2))
    y = (s * (t1 * t2 - t0 * t3), 1 - s * (t1 * t1 + t3 * t3), s * (t2 * t3 + t0 * t1))
    z = (s * (t1 * t3 + t0 * t2), s * (t2 * t3 - t0 * t1), 1 - s * (t1 * t1 + t2 * t2))
    return x, y, z


@jit
def rotate_vector(body, v):
    """Return the inertial components of a vector ``v`` fixed in a body with unit vectors ``body``."""
    return (
        body[0][0] * v[0] + body[1][0] * v[1] + body[2][0] * v[2],
        body[0][1] * v[0] + body[1][1] * v[1] + body[2][1] * v[2],
        body[0][2] * v[0] + body[1][2] * v[1] + body[2][2] * v[2],
    )


@jit
def wheel_contact(coordinates, centre, triad, radius, ground, function, parameters):
    """Return (gap, A p + d, (lateral, forward, normal)) of a wheel at its node's coordinates (7,).

    ``centre`` (3,) is p, the rows of ``triad`` (3, 3) are right-handed unit vectors of the body with the
    axle in the middle. ``ground`` is the `velodrome.reference.kernels.rim.RimSearch`.
    """
    body = axes(coordinates[3], coordinates[4], coordinates[5], coordinates[6])
    offset = rotate_vector(body, centre)
    middle = (coordinates[0] + offset[0], coordinates[1] + offset[1], coordinates[2] + offset[2])
    x, axle, z = rotate_vector(body, triad[0]), rotate_vector(body, triad[1]), rotate_vector(body, triad[2])
    gap, here, frame = contact_frame(middle, x, axle, z, radius, ground, function, parameters)
    return gap, add(offset, here.arm), frame


@jit
def velocity_rows(coordinates, centre, triad, radius, ground, function, parameters, rows):
    """Fill ``rows`` (3, 7) with W (lateral, forward, normal) at coordinates (7,); return the gap."""
    t0, t1, t2, t3 = coordinates[3], coordinates[4], coordinates[5], coordinates[6]
    gap, arm, frame = wheel_contact(coordinates, centre, triad, radius, ground, function, parameters)
    for i in range(3):
        # e . (w x d) = w . (d x e), and w = G theta' is twice the vector part of theta' conj(theta).
        m0, m1, m2 = cross(arm, frame[i])
        for j in range(3):
            rows[i, j] = frame[i][j]
        rows[i, 3] = -2 * (t1 * m0 + t2 * m1 + t3 * m2)
        rows[i, 4] = 2 * (t0 * m0 + t3 * m1 - t2 * m2)
        rows[i, 5] = 2 * (-t3 * m0 + t0 * m1 + t1 * m2)
        rows[i, 6] = 2 * (t2 * m0 - t1 * m1 + t0 * m2)
    return gap


@jit
def constraints(state, centres, triads, radii, ground, function, parameters, scale, rows, values):
    """Evaluate the rolling constraints of k wheels at every `next`.

    This is a generator so that its arguments are unpacked only once, which would otherwise take ten times as long as
    the evaluation.

    state (2 k, 7) has the wheels' coordinates, then their rates; centres (k, 3), triads (k, 3, 3) and
    radii (k,) describe the wheels; scale (1,) multiplies the slip on position level. Fills rows (3 k, 7 k) with
    W of all wheels, and values (2, 3 k): on position level (scale lateral, scale forward, gap), on velocity
    level W q'.
    """
    count = radii.size
    while True:
        for wheel in range(count):
            block = rows[3 * wheel : 3 * wheel + 3, 7 * wheel : 7 * wheel + 7]
            shape = (centres[wheel], triads[wheel], radii[wheel])
            gap = velocity_rows(state[wheel], shape[0], shape[1], shape[2], ground, function, parameters, block)
            for i in range(3):
                velocity = 0.0
                for j in range(7):
                    velocity += block[i, j] * state[count + wheel, j]
                values[1, 3 * wheel + i] = velocity
                values[0, 3 * wheel + i] = scale[0] * velocity
            values[0, 3 * wheel + 2] = gap
        yield True


@jit
def normals(coordinates, centres, triads, radii, ground, function, parameters, out):
    """Fill ``out`` (k, 3) with the surface's normals at the contacts of k wheels at every `next`.

    A wheel without contact gets NaN, with which the engine stops; any other normal would be used as if it were right.
    """
    while True:
        for wheel in range(radii.size):
            where = (coordinates[wheel], centres[wheel], triads[wheel], radii[wheel])
            gap, _, frame = wheel_contact(where[0], where[1], where[2], where[3], ground, function, parameters)
            for i in range(3):
                out[wheel, i] = frame[2][i] if gap == gap else np.nan
        yield True
