"""Contacts of both wheels for Pinocchio's constraints, from the wheels' poses and twists."""

from __future__ import annotations

import numpy as np

from ...reference.kernels.compilation import jit
from ...reference.rim import bicycle_rim_search
from ..engine import Problem
from ..rolling import add, contact_state, cross, scale, wheel_axes


class MovingContacts:
    """Contacts of both wheels; write the poses and twists, then call `update`, then read the contacts.

    Attributes
    ----------
    centre, axle, velocity, spin : ndarray, shape (2, 3)
        Centres [m], axles, velocities of the centres [m/s] and angular velocities [rad/s] of the rear and the front
        wheel, in inertial axes.
    point, foot : ndarray, shape (2, 3)
        Points of the rims that are closest to the ground, and their feet on the ground [m].
    acceleration : ndarray, shape (2, 3)
        Accelerations of the material points at the contacts of wheels that roll, -w x u with the angular velocity w and
        the velocity u of the contact along the rim [m/s^2].
    """

    def __init__(self, problem: Problem) -> None:
        self.centre, self.axle = np.zeros((2, 3)), np.zeros((2, 3))
        self.velocity, self.spin = np.zeros((2, 3)), np.zeros((2, 3))
        self.point, self.foot, self.acceleration = np.zeros((2, 3)), np.zeros((2, 3)), np.zeros((2, 3))
        bicycle, surface = problem.bicycle, problem.surface
        # The surface's compiled function must exist as long as the kernel.
        self._function = surface.function.real
        self.update = _follow_contacts(
            self.centre,
            self.axle,
            self.velocity,
            self.spin,
            np.array([bicycle.rear_wheel_radius, bicycle.front_wheel_radius]),
            bicycle_rim_search(bicycle, surface),
            self._function,
            surface.parameters,
            self.point,
            self.foot,
            self.acceleration,
        ).__next__


@jit
def _follow_contacts(
    centres, axles, velocities, spins, radii, ground, function, parameters, points, feet, accelerations
):
    """Fill points, feet and accelerations (2, 3) at every `next`; yield whether both wheels have a contact.

    This is a generator so that its arguments are unpacked only once.
    """
    while True:
        found = True
        for k in range(2):
            centre = (centres[k, 0], centres[k, 1], centres[k, 2])
            axle = (axles[k, 0], axles[k, 1], axles[k, 2])
            velocity = (velocities[k, 0], velocities[k, 1], velocities[k, 2])
            spin = (spins[k, 0], spins[k, 1], spins[k, 2])
            x, z = wheel_axes(axle)
            here = contact_state(centre, x, axle, z, radii[k], velocity, spin, ground, function, parameters)
            found = found and np.isfinite(here.gap)
            point = add(centre, here.arm)
            foot = add(point, scale(-here.gap, here.normal))
            along = cross(here.run, spin)
            for i in range(3):
                points[k, i], feet[k, i], accelerations[k, i] = point[i], foot[i], along[i]
        yield found
