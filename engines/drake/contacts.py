"""Contacts of both wheels with the ground at every step, by compiled functions."""

from __future__ import annotations

from functools import partial

import numpy as np
from numba import typeof

from ...reference.bicycle import Bicycle
from ...reference.kernels.wheel import observe_wheels
from ...reference.rim import bicycle_rim_search
from ...reference.surface import Surface
from ..engine import EngineError
from .tree import BodyMotions

# Half the thickness of a wheel, since Drake has no knife edge [m]: a contact lies within 1e-8 m of the edge's. A wheel
# lies flat where its centre is less than this above the contact.
HALF_THICKNESS = 1e-4
NO_CONTACT = "a wheel lies flat or has no contact point with the surface"


class WheelContactFinder:
    """Find where both wheels touch the ground and how their contacts move.

    `find` evaluates what `velodrome.engines.rolling.observe_wheel` does, without its overhead: it reads ``motion`` and
    fills the other arrays.

    Parameters
    ----------
    bicycle : Bicycle
    surface : Surface

    Attributes
    ----------
    motion : BodyMotions
        Motion of the wheels, to be written before `find`.
    point : ndarray, shape (2, 3)
        Contacts [m].
    frames : ndarray, shape (2, 3, 3)
        Rows: lateral, forward and normal axis.
    gap : ndarray, shape (2,)
        Distances of the contacts from the ground [m].
    velocity, acceleration : ndarray, shape (2, 3)
        Velocities of the wheels' material points there [m/s], and the contacts' own accelerations [m/s^2].
    """

    def __init__(self, bicycle: Bicycle, surface: Surface) -> None:
        self.motion = BodyMotions.empty(2)
        self.point, self.frames, self.gap = np.zeros((2, 3)), np.zeros((2, 3, 3)), np.zeros(2)
        self.velocity, self.acceleration = np.zeros((2, 3)), np.zeros((2, 3))
        # The surface's compiled function must stay alive as long as the finder.
        self._function = surface.function.real
        arguments = (
            self.motion.position,
            self.motion.velocity,
            self.motion.rotation,
            self.motion.spin,
            np.array([bicycle.rear_wheel_radius, bicycle.front_wheel_radius]),
            bicycle_rim_search(bicycle, surface),
            self._function,
            surface.parameters,
            self.point,
            self.frames,
            self.gap,
            np.zeros((2, 2)),
            self.velocity,
            np.zeros((2, 3)),
            self.acceleration,
        )
        # Inferring the types in every call would take numba longer than the search itself.
        self._observe = partial(observe_wheels.compile(tuple(typeof(argument) for argument in arguments)), *arguments)

    def find(self) -> None:
        """Find both contacts.

        Raises
        ------
        EngineError
            If a wheel lies flat or has no contact.
        """
        self._observe()
        height = ((self.motion.position - self.point) * self.frames[:, 2]).sum(axis=1)
        # The comparison is false for nan, of which the gap of a wheel without contact is.
        if not (np.all(np.isfinite(self.gap)) and np.all(height > HALF_THICKNESS)):
            raise EngineError(NO_CONTACT)
