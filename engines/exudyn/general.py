"""Contact of knife-edge wheels that are fixed to bodies of any kind, on ground that is at rest or fixed to a body.

With the wheel's body at the origin x and with the rotation A, the wheel's centre is c = x + A p and its axle a = A b
(p and b fixed in the body). The contact search, in the axes of the ground, gives the vector d from the centre to
the contact and the contact frame F = (lateral, forward, normal). The velocity of the wheel's material point at the
contact relative to the ground's, in that frame, is linear in the coordinates' rates:

    F (x' + w x (A p + d) - x0' - w0 x (x + A p + d - x0)) = W q'
    W = F (L - skew(A p + d) G - L0 + skew(x + A p + d - x0) G0)

with the Jacobians of `pose` and the index 0 for the ground's body. Its normal row is the gap's gradient, since the
contact is a closest approach.
"""

from __future__ import annotations

import numpy as np

from ...reference.kernels.compilation import jit
from ...reference.kernels.vector import add, cross, dot, subtract
from ...reference.kernels.wheel import contact_frame
from .kernel import rotate_vector
from .pose import locate_body, rotate_axes


@jit
def view_from(body, v):
    """Return the components of an inertial vector in the axes of a body with unit vectors ``body``."""
    return dot(body[0], v), dot(body[1], v), dot(body[2], v)


@jit
def find_wheel_contact(middle, axes, place, view, radius, ground, function, parameters):
    """Return (gap, d, (lateral, forward, normal)) of a wheel with its centre at ``middle``, in inertial axes.

    ``axes`` are right-handed unit vectors with the axle in the middle; ``place`` and ``view`` are the origin and the
    unit vectors of the ground's axes; ``ground`` is the `velodrome.reference.kernels.rim.RimSearch`.
    """
    middle = view_from(view, subtract(middle, place))
    x, axle, z = view_from(view, axes[0]), view_from(view, axes[1]), view_from(view, axes[2])
    gap, here, frame = contact_frame(middle, x, axle, z, radius, ground, function, parameters)
    frame = (rotate_vector(view, frame[0]), rotate_vector(view, frame[1]), rotate_vector(view, frame[2]))
    return gap, rotate_vector(view, here.arm), frame


@jit
def add_rows(frame, arm, linear, angular, first, last, sign, rows):
    """Add ``sign`` F (L - skew(arm) G) to columns ``first`` to ``last`` of ``rows`` (3, n)."""
    for i in range(3):
        # e . (w x d) = w . (d x e)
        e, moment = frame[i], cross(arm, frame[i])
        for j in range(first, last):
            velocity = (linear[0, j], linear[1, j], linear[2, j])
            spin = (angular[0, j], angular[1, j], angular[2, j])
            rows[i, j] += sign * (dot(e, velocity) + dot(spin, moment))


@jit
def fill_wheel_rows(wheel, coordinates, frames, triads, radii, ground, function, parameters, jacobians, rows):
    """Fill ``rows`` (3, n) with W (lateral, forward, normal) of a wheel; return (gap, contact, frame).

    ``coordinates`` (n,) are those of all nodes. ``frames`` (`pose.Frames`) has the wheels' frames, whose origins are
    the wheels' centres, then the ground's; triads (k, 3, 3) has the wheels' axes in the bodies' axes, and jacobians
    (4, 3, n) is working space.
    """
    rows[:] = 0.0
    origin, body = locate_body(frames, wheel, coordinates, jacobians[0], jacobians[1])
    offset, axes = rotate_vector(body, frames.positions[wheel]), rotate_axes(body, triads[wheel].T)
    plane = frames.kinds.size - 1
    base, carrier = locate_body(frames, plane, coordinates, jacobians[2], jacobians[3])
    place = add(base, rotate_vector(carrier, frames.positions[plane]))
    view = rotate_axes(carrier, frames.rotations[plane])
    gap, arm, frame = find_wheel_contact(
        add(origin, offset), axes, place, view, radii[wheel], ground, function, parameters
    )
    arm = add(offset, arm)
    contact = add(origin, arm)
    first, last = frames.starts[wheel], frames.starts[wheel] + frames.sizes[wheel]
    add_rows(frame, arm, jacobians[0], jacobians[1], first, last, 1.0, rows)
    first, last = frames.starts[plane], frames.starts[plane] + frames.sizes[plane]
    add_rows(frame, subtract(contact, base), jacobians[2], jacobians[3], first, last, -1.0, rows)
    return gap, contact, frame


@jit
def attached_constraints(state, frames, triads, radii, order, ground, function, parameters, scale, rows, values):
    """Evaluate the rolling constraints of k wheels at every `next`, as `kernel.constraints` does in its case.

    state (2, n) has the nodes' coordinates, then their rates; frames, triads (k, 3, 3) and radii (k,) describe the
    wheels and the ground; order (k, 3) has the rows of a wheel's lateral, forward and normal constraint, -1 for those
    that are left out; scale (1,) multiplies the slip on position level. Fills rows (m, n) with W of all wheels, and
    values (2, m): on position level (scale lateral, scale forward, gap), on velocity level W q'.
    """
    count = state.shape[1]
    own, jacobians = np.zeros((3, count)), np.zeros((4, 3, count))
    while True:
        for wheel in range(radii.size):
            gap, _, _ = fill_wheel_rows(
                wheel, state[0], frames, triads, radii, ground, function, parameters, jacobians, own
            )
            for i in range(3):
                row = order[wheel, i]
                if row < 0:
                    continue
                velocity = 0.0
                for j in range(count):
                    rows[row, j] = own[i, j]
                    velocity += own[i, j] * state[1, j]
                values[1, row] = velocity
                values[0, row] = gap if i == 2 else scale[0] * velocity
        yield True


@jit
def probe(wheel, state, frames, triads, radii, ground, function, parameters, point, axes, slip, gap):
    """Measure the contact of one wheel at every `next`.

    state (2, n) and the wheels are as in `attached_constraints`. Fills point (3,), axes (3, 3) with rows lateral,
    forward and normal, slip (2,), and gap (1,).
    """
    count = state.shape[1]
    rows, jacobians = np.zeros((3, count)), np.zeros((4, 3, count))
    while True:
        gap[0], contact, frame = fill_wheel_rows(
            wheel, state[0], frames, triads, radii, ground, function, parameters, jacobians, rows
        )
        for i in range(3):
            point[i] = contact[i]
            for j in range(3):
                axes[i, j] = frame[i][j]
        for i in range(2):
            slip[i] = 0.0
            for j in range(count):
                slip[i] += rows[i, j] * state[1, j]
        yield True
