"""One knife-edge wheel on the ground, from its pose and twist: contact frame, material velocity, own acceleration.

A wheel of centre c, axle y and radius r that moves with the velocity c' and the angular velocity w touches the ground
at c + d, d = r e(a) (`contact`). The material point of the rim that is there has

    velocity      v = c' + w x d
    acceleration  c'' + w' x d + w x (w x d)

but the contact runs along the rim at the speed r a', so that d' = w x d + r a' t and

    v' = c'' + w' x d + b,      b = w x (w x d) + w x (r a' t)

b is the contact's own acceleration: what is left of v' where c'' and w' are zero. Rolling without slip asks for v = 0
and, of accelerations, c'' + w' x d = -b.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from . import contact
from .compilation import jit
from .rim import find_contact, level_axes
from .vector import add, cross, dot, scale


class ContactState(NamedTuple):
    """A wheel's contact and how it moves; vectors as tuples, in inertial axes."""

    gap: Any  # nan where no contact is found
    arm: Any  # d, from the wheel's centre to the contact
    lateral: Any
    forward: Any
    normal: Any
    velocity: Any  # v, of the material point
    run: Any  # r a' t, of the contact along the rim
    acceleration: Any  # b


@jit
def wheel_axes(axle):
    """Axes (x, z) of a wheel's plane, x level; along the inertial x axis where the wheel lies flat."""
    if axle[0] * axle[0] + axle[1] * axle[1] > 0:
        return level_axes(axle)
    x = (1.0, 0.0, 0.0)
    return x, cross(x, axle)


@jit
def contact_frame(centre, x, axle, z, radius, ground, function, parameters):
    """Return (gap, `contact.Contact`, (lateral, forward, normal)) of a wheel; the gap is nan without a contact.

    ``x``, ``axle`` and ``z`` are right-handed unit vectors; ``ground`` is the `rim.RimSearch`.
    """
    xi, eta, angle, found = find_contact(centre, x, z, radius, ground, function, parameters)
    here = contact.equations(centre, x, z, radius, xi, eta, angle, function, parameters)
    lateral, forward = contact.tangents(axle, here.normal)
    return here.gap if found else np.nan, here, (lateral, forward, here.normal)


@jit
def contact_run(here, radius, velocity, spin):
    """Velocity r a' t at which the contact runs along the rim of a wheel.

    ``here`` is the `contact.Contact`, ``velocity`` that of the material point there, ``spin`` the wheel's angular
    velocity.
    """
    return scale(radius * contact.rates(here, velocity, spin)[2], here.tangent)


@jit
def contact_state(centre, x, axle, z, radius, velocity, spin, ground, function, parameters):
    """Evaluate a wheel's contact from its pose and twist; returns a `ContactState`.

    The wheel is given as in `contact_frame`; ``velocity`` is its centre's and ``spin`` its angular velocity.
    """
    gap, here, frame = contact_frame(centre, x, axle, z, radius, ground, function, parameters)
    turning = cross(spin, here.arm)
    material = add(velocity, turning)
    run = contact_run(here, radius, material, spin)
    own = add(cross(spin, turning), cross(spin, run))
    return ContactState(gap, here.arm, frame[0], frame[1], frame[2], material, run, own)


@jit
def observe_wheels(
    position,
    velocity,
    rotation,
    spin,
    radii,
    ground,
    function,
    parameters,
    point,
    frames,
    gap,
    slip,
    material,
    run,
    own,
):
    """Measure the contacts of n wheels, or of one wheel at n times.

    position, velocity, spin (n, 3) and rotation (n, 3, 3) are the bodies', in inertial axes; their centres are the
    wheels', their y axes the axles; radii (n,). Fills point (n, 3), frames (n, 3, 3) with rows lateral, forward and
    normal, gap (n,), slip (n, 2), and the vectors of `ContactState`: material velocity, run along the rim and own
    acceleration, (n, 3) each.
    """
    for n in range(position.shape[0]):
        a = rotation[n]
        x, axle, z = (a[0, 0], a[1, 0], a[2, 0]), (a[0, 1], a[1, 1], a[2, 1]), (a[0, 2], a[1, 2], a[2, 2])
        centre, moving = (
            (position[n, 0], position[n, 1], position[n, 2]),
            (velocity[n, 0], velocity[n, 1], velocity[n, 2]),
        )
        turning = (spin[n, 0], spin[n, 1], spin[n, 2])
        here = contact_state(centre, x, axle, z, radii[n], moving, turning, ground, function, parameters)
        frame = (here.lateral, here.forward, here.normal)
        gap[n] = here.gap
        slip[n, 0], slip[n, 1] = dot(here.lateral, here.velocity), dot(here.forward, here.velocity)
        for i in range(3):
            point[n, i] = centre[i] + here.arm[i]
            material[n, i], run[n, i], own[n, i] = here.velocity[i], here.run[i], here.acceleration[i]
            for j in range(3):
                frames[n, i, j] = frame[i][j]
