"""The contact of a knife-edge wheel that rolls on any ground, computed from its pose and twist.

`observe_wheel` computes the contacts of one wheel or of arrays of wheels. The compiled functions that it uses may also
be called from compiled code, such as a constraint or a callback of an engine: `contact_state` computes everything,
`contact_frame` the gap and the axes alone. A ground is passed to compiled code as three arguments::

    ground = rim_search(surface, [radius])
    function, parameters = surface.function.real, surface.parameters

    @numba.njit
    def lift_off_acceleration(centre, axle, radius, velocity, spin, ground, function, parameters):
        x, z = wheel_axes(axle)
        here = contact_state(centre, x, axle, z, radius, velocity, spin, ground, function, parameters)
        return dot(here.normal, here.acceleration)

There, vectors are tuples of three numbers. The surface must exist as long as the compiled code uses its function.

With d the vector from the wheel's centre c to its contact and w its angular velocity, the material point of the rim
at the contact has the velocity v = c' + w x d. Rolling without slip is v = 0, whose derivative

    c'' + w' x d + b = 0

has the contact's own acceleration b, since the contact runs along the rim. An engine that prescribes accelerations,
or the derivatives of its rolling constraints, needs b; without it wheels creep.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..reference.contact import Observation, observe
from ..reference.kernels.vector import add, cross, dot, scale
from ..reference.kernels.wheel import (
    ContactState,
    contact_frame,
    contact_state,
    level_axes,
    observe_wheels,
    wheel_axes,
)
from ..reference.rim import rim_search
from ..reference.surface import Surface

__all__ = [
    "ContactState",
    "Observation",
    "WheelContact",
    "add",
    "contact_frame",
    "contact_state",
    "cross",
    "dot",
    "level_axes",
    "observe",
    "observe_wheel",
    "rim_search",
    "scale",
    "wheel_axes",
]


@dataclass(frozen=True)
class WheelContact:
    """Contacts of wheels with the ground, in arrays of any common shape (...); nan for wheels without contact.

    Attributes
    ----------
    point : ndarray, shape (..., 3)
        Point of the rim that is closest to the ground [m].
    normal, lateral, forward : ndarray, shape (..., 3)
        Unit vectors: the ground's normal, upward; forward = axle x normal, normalised; lateral = normal x forward,
        which is the axle's direction along the ground.
    gap : ndarray, shape (...)
        Signed distance of the point from the ground along the normal [m].
    gap_rate : ndarray, shape (...)
        Its derivative [m/s].
    velocity : ndarray, shape (..., 3)
        Velocity of the wheel's material point at the contact [m/s].
    slip : ndarray, shape (..., 2)
        Its lateral and forward components [m/s].
    point_velocity : ndarray, shape (..., 3)
        Velocity of the contact itself, which runs along the rim and the ground [m/s].
    acceleration : ndarray, shape (..., 3)
        The contact's own acceleration b: the derivative of ``velocity`` is c'' + w' x d + b, with c'' the
        acceleration of the wheel's centre, w' its angular acceleration and d from the centre to the contact [m/s^2].
    """

    point: np.ndarray
    normal: np.ndarray
    lateral: np.ndarray
    forward: np.ndarray
    gap: np.ndarray
    gap_rate: np.ndarray
    velocity: np.ndarray
    slip: np.ndarray
    point_velocity: np.ndarray
    acceleration: np.ndarray

    @property
    def found(self) -> np.ndarray:
        """Whether there is a contact, shape (...)."""
        return np.isfinite(self.gap)


def observe_wheel(
    surface: Surface,
    radius: ArrayLike,
    centre: ArrayLike,
    axle: ArrayLike,
    velocity: ArrayLike | None = None,
    spin: ArrayLike | None = None,
) -> WheelContact:
    """Compute where knife-edge wheels touch a surface and how they move there.

    All arguments broadcast: one wheel, one wheel at many times, or both wheels of a ride as (n, 2, 3) with two radii.

    Parameters
    ----------
    surface : Surface
        Any surface of the suite, or one that the user has written.
    radius : array_like, shape (...)
        Radii of the wheels' edges [m].
    centre : array_like, shape (..., 3)
        Centres of the wheels [m].
    axle : array_like, shape (..., 3)
        Directions of the axles, of any length; they point to the left of a wheel that rolls forward.
    velocity : array_like, shape (..., 3), optional
        Velocities of the centres [m/s]; zero if not given.
    spin : array_like, shape (..., 3), optional
        Angular velocities of the wheels in inertial axes, including the rotation about the axles [rad/s]; zero if not
        given.

    Returns
    -------
    WheelContact

    Raises
    ------
    ValueError
        If a radius is not positive, an axle is not a direction, or the shapes do not fit.
    """
    still = np.zeros(3)
    vectors = [np.asarray(v, float) for v in (centre, axle, still if velocity is None else velocity)]
    vectors.append(np.asarray(still if spin is None else spin, float))
    if any(v.ndim == 0 or v.shape[-1] != 3 for v in vectors):
        raise ValueError(
            f"centre, axle, velocity and spin have shapes {[v.shape for v in vectors]}; each must end in 3"
        )
    radii = np.asarray(radius, float)
    if not (radii.size and np.all(radii > 0) and np.all(np.isfinite(radii))):
        raise ValueError(f"radius is {radius!r}; a wheel's radius is a positive number [m]")
    shape = np.broadcast_shapes(radii.shape, *(v.shape[:-1] for v in vectors))
    middle, along, moving, turning = (
        np.ascontiguousarray(np.broadcast_to(v, (*shape, 3)).reshape(-1, 3)) for v in vectors
    )
    size = np.linalg.norm(along, axis=1, keepdims=True)
    if not (np.all(size > 0) and np.all(np.isfinite(size))):
        raise ValueError("an axle is a vector of three finite numbers, not all zero")
    n = len(middle)
    rotation = _make_triads(along / size)
    point, frames, gap, slip = np.empty((n, 3)), np.empty((n, 3, 3)), np.empty(n), np.empty((n, 2))
    material, run, own = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3))
    observe_wheels(
        middle,
        moving,
        rotation,
        turning,
        np.ascontiguousarray(np.broadcast_to(radii, shape).reshape(-1)),
        rim_search(surface, radii.reshape(-1)),
        surface.function.real,
        surface.parameters,
        point,
        frames,
        gap,
        slip,
        material,
        run,
        own,
    )
    lost = ~np.isfinite(gap)
    for values in (point, frames, slip, material, run, own):
        values[lost] = np.nan

    def shaped(values: np.ndarray) -> np.ndarray:
        return values.reshape((*shape, *values.shape[1:]))

    return WheelContact(
        point=shaped(point),
        normal=shaped(frames[:, 2]),
        lateral=shaped(frames[:, 0]),
        forward=shaped(frames[:, 1]),
        gap=shaped(gap),
        gap_rate=shaped(np.einsum("ni,ni->n", frames[:, 2], material)),
        velocity=shaped(material),
        slip=shaped(slip),
        point_velocity=shaped(material + run),
        acceleration=shaped(own),
    )


def _make_triads(axle: np.ndarray) -> np.ndarray:
    """Return rotation matrices (n, 3, 3) whose middle columns are the unit axles (n, 3)."""
    found = np.empty((len(axle), 3, 3))
    for row, direction in zip(found, axle, strict=True):
        x, z = wheel_axes((direction[0], direction[1], direction[2]))
        row[:, 0], row[:, 1], row[:, 2] = x, direction, z
    return found
