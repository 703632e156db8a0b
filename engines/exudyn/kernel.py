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

from ...reference.kernels.compilation import jit, jit_inline
from ...reference.kernels.vector import add, cross
from ...reference.kernels.wheel import contact_frame
from .pose import INERTIAL, TREE, euler_parameter_axes, locate_body, rotate_axes, rotate_vector


@jit_inline
def find_wheel_contact(middle, axes, radius, ground, function, parameters):
    """Return (gap, d, (lateral, forward, normal)) of a wheel with its centre at ``middle``.

    ``axes`` are right-handed unit vectors with the axle in the middle; ``ground`` is the
    `velodrome.reference.kernels.rim.RimSearch`.
    """
    gap, here, frame = contact_frame(middle, axes[0], axes[1], axes[2], radius, ground, function, parameters)
    return gap, here.arm, frame


@jit_inline
def wheel_axes_of_body(body, triad):
    """Return the inertial unit vectors that are the rows of ``triad`` (3, 3) in the axes of a body."""
    return rotate_vector(body, triad[0]), rotate_vector(body, triad[1]), rotate_vector(body, triad[2])


@jit_inline
def view_from(body, v):
    """Return the components of an inertial vector in the axes of a body."""
    return (
        body[0][0] * v[0] + body[0][1] * v[1] + body[0][2] * v[2],
        body[1][0] * v[0] + body[1][1] * v[1] + body[1][2] * v[2],
        body[2][0] * v[0] + body[2][1] * v[1] + body[2][2] * v[2],
    )


@jit_inline
def add_rows(frame, arm, frames, number, linear, angular, sign, rows):
    """Add ``sign`` F (L - skew(arm) G) of a body to ``rows`` (3, n)."""
    first, free = frames.starts[number], frames.translations[number]
    last = first + frames.sizes[number]
    for i in range(3):
        # e . (w x d) = w . (d x e)
        e, moment = frame[i], cross(arm, frame[i])
        if frames.kinds[number] == TREE:
            for j in range(first, last):
                rows[i, j] += sign * (e[0] * linear[0, j] + e[1] * linear[1, j] + e[2] * linear[2, j])
        for j in range(free):
            rows[i, first + j] += sign * e[j]
        for j in range(first + free, last):
            rows[i, j] += sign * (angular[0, j] * moment[0] + angular[1, j] * moment[1] + angular[2, j] * moment[2])


@jit_inline
def clear_rows(frames, number, rows):
    """Set the columns of a body in ``rows`` (3, n) to zero."""
    first = frames.starts[number]
    for i in range(3):
        for j in range(first, first + frames.sizes[number]):
            rows[i, j] = 0.0


@jit_inline
def fill_wheel_rows(wheel, coordinates, frames, triads, radii, ground, function, parameters, jacobians, rows):
    """Fill the columns of ``rows`` (3, n) that belong to a wheel and its ground with W; return (gap, contact, frame).

    ``coordinates`` (n,) are those of all nodes. ``frames`` (`pose.Frames`) has the wheels' frames, whose origins are
    the wheels' centres, then the ground's; triads (k, 3, 3) has the wheels' axes in the bodies' axes, and jacobians
    (4, 3, n) is working space.
    """
    linear, angular = jacobians[0], jacobians[1]
    clear_rows(frames, wheel, rows)
    origin, body = locate_body(frames, wheel, coordinates, linear, angular)
    offset = rotate_vector(body, frames.positions[wheel])
    middle, axes = add(origin, offset), wheel_axes_of_body(body, triads[wheel])
    plane = frames.kinds.size - 1
    if frames.kinds[plane] == INERTIAL:
        gap, arm, frame = find_wheel_contact(middle, axes, radii[wheel], ground, function, parameters)
        arm = add(offset, arm)
        add_rows(frame, arm, frames, wheel, linear, angular, 1.0, rows)
        return gap, add(origin, arm), frame
    base_linear, base_angular = jacobians[2], jacobians[3]
    clear_rows(frames, plane, rows)
    base, carrier = locate_body(frames, plane, coordinates, base_linear, base_angular)
    shift = rotate_vector(carrier, frames.positions[plane])
    place, view = add(base, shift), rotate_axes(carrier, frames.rotations[plane])
    seen = (middle[0] - place[0], middle[1] - place[1], middle[2] - place[2])
    seen_axes = (view_from(view, axes[0]), view_from(view, axes[1]), view_from(view, axes[2]))
    gap, arm, frame = find_wheel_contact(view_from(view, seen), seen_axes, radii[wheel], ground, function, parameters)
    frame = (rotate_vector(view, frame[0]), rotate_vector(view, frame[1]), rotate_vector(view, frame[2]))
    arm = add(offset, rotate_vector(view, arm))
    contact = add(origin, arm)
    add_rows(frame, arm, frames, wheel, linear, angular, 1.0, rows)
    lever = (contact[0] - base[0], contact[1] - base[1], contact[2] - base[2])
    add_rows(frame, lever, frames, plane, base_linear, base_angular, -1.0, rows)
    return gap, contact, frame


@jit
def constraints(state, frames, triads, radii, order, ground, function, parameters, scale, rows, values):
    """Evaluate the rolling constraints of k wheels at every `next`.

    This is a generator so that its arguments are unpacked only once, which would otherwise take ten times as long as
    the evaluation.

    state (2, n) has the nodes' coordinates, then their rates; frames, triads (k, 3, 3) and radii (k,) describe the
    wheels and the ground; order (k, 3) has the rows of a wheel's lateral, forward and normal constraint, -1 for those
    that are left out; scale (1,) multiplies the slip on position level. Fills rows (m, n) with W of all wheels, and
    values (2, m): on position level (scale lateral, scale forward, gap), on velocity level W q'.
    """
    count = state.shape[1]
    blocks, jacobians = np.zeros((radii.size, 3, count)), np.zeros((4, 3, count))
    while True:
        for wheel in range(radii.size):
            own = blocks[wheel]
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

    state (2, n) and the wheels are as in `constraints`. Fills point (3,), axes (3, 3) with rows lateral, forward and
    normal, slip (2,), and gap (1,).
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


@jit
def normals(coordinates, radii, ground, function, parameters, out):
    """Fill ``out`` (k, 3) with the surface's normals at the contacts of k wheels at every `next`.

    coordinates (k, 7) are those of nodes with Euler parameters at the wheels' centres, whose y axes are the axles. A
    wheel without contact gets NaN, with which the engine stops; any other normal would be used as if it were right.
    """
    while True:
        for wheel in range(radii.size):
            q = coordinates[wheel]
            axes = euler_parameter_axes(q[3], q[4], q[5], q[6])
            gap, _, frame = find_wheel_contact((q[0], q[1], q[2]), axes, radii[wheel], ground, function, parameters)
            for i in range(3):
                out[wheel, i] = frame[2][i] if gap == gap else np.nan
        yield True
