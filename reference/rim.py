"""The whole rims of both wheels above the ground, see `reference.kernels.rim`.

A wheel that rolls touches the ground in one point. Where its rim comes to touch a second one, something hits
the wheel: a ride ends there. A start with a rim inside the ground is no start.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .bicycle import Bicycle
from .dae import contact_parameters
from .kernels import rim as kernel
from .kernels import touch
from .kernels.dynamics import wheels
from .kinematics import WHEELS, constants
from .surface import Surface

_SAMPLES_A_DETAIL = 4
# Samples of a rim: what smooth ground needs, and as many as resolve a detail of 2 mm along a wheel of a bicycle.
_FEWEST, _MOST = 32, 4096
_TOUCHING = 1e-9  # [m] no depth worth a number


def ground(bicycle: Bicycle, surface: Surface) -> kernel.Ground:
    """How closely to look at the rims of a bicycle on a surface, from the surface's ``bend`` and ``detail``."""
    radii = bicycle.rear_wheel_radius, bicycle.front_wheel_radius
    bend = float(getattr(surface, "bend", math.inf))
    # Within a wheel's radius smooth ground does not bend to and fro, or no wheel could be said to touch it in a point.
    finest = 2 * math.pi * max(radii) * _SAMPLES_A_DETAIL / _MOST
    detail = max(min(float(getattr(surface, "detail", math.inf)), *radii), finest)
    rear, front = (max(_FEWEST, math.ceil(2 * math.pi * r / detail * _SAMPLES_A_DETAIL)) for r in radii)
    return kernel.Ground(bend, detail, rear, front)


def second_touch(wheel: str, time: float) -> str:
    """Why a ride ends at a time [s]."""
    return f"the {wheel} rim touches the ground at a second place at t = {time:.6g} s"


def rim_clearances(bicycle: Bicycle, surface: Surface, q: np.ndarray, contact: np.ndarray) -> np.ndarray:
    """Least clearances of the rear and the front rim, shape (2,), dimensionless; positive if each touches once.

    Parameters
    ----------
    bicycle : Bicycle
    surface : Surface
    q : ndarray, shape (9,)
        Coordinates.
    contact : ndarray, shape (6,)
        Contact parameters of both wheels there, as `reference.dae.contact_parameters` gives them.
    """
    known, function, parameters = ground(bicycle, surface), surface.function.real, surface.parameters
    both, samples = wheels(q, constants(bicycle)), (known.rear, known.front)
    clearances = np.empty(2)
    for k, (centre, x, _, z, radius) in enumerate(both):
        angle = contact[3 * k + 2]
        clearances[k] = kernel.bound(centre, x, z, radius, angle, known.bend, function, parameters)
        if not clearances[k] > 0:
            clearances[k], _ = kernel.least_clearance(centre, x, z, radius, angle, samples[k], function, parameters)
    return clearances


def require_clear_rims(bicycle: Bicycle, surface: Surface, q: np.ndarray, contact: np.ndarray | None = None) -> None:
    """Refuse a pose in which a rim lies inside the ground or touches it at a second place.

    Parameters
    ----------
    bicycle, surface, q, contact
        As in `rim_clearances`; without ``contact`` it is searched.

    Raises
    ------
    ValueError
        With the wheel, the depth and the place; or if a wheel has no contact.
    """
    if contact is None:
        contact = contact_parameters(bicycle, surface, q)
    clear = rim_clearances(bicycle, surface, q, contact) > 0
    if clear.all():
        return
    distance, k, point = min(_deepest(bicycle, surface, q, k) for k in np.flatnonzero(~clear))
    place = f"x = {point[0]:.4g} m, y = {point[1]:.4g} m"
    if distance < -_TOUCHING:
        raise ValueError(f"the {WHEELS[k]} rim lies {-1e3 * distance:.3g} mm inside the ground at {place}")
    raise ValueError(f"the {WHEELS[k]} rim touches the ground at a second place, not only at {place}")


def _deepest(bicycle: Bicycle, surface: Surface, q: np.ndarray, k: int) -> tuple[float, int, tuple[float, float]]:
    """Signed distance of a wheel's deepest rim point from the ground [m], the wheel, and x and y of that point [m]."""
    centre, x, _, z, radius = wheels(q, constants(bicycle))[k]
    samples = ground(bicycle, surface)[2 + k]
    distance, angle = kernel.deepest(centre, x, z, radius, samples, surface.function.real, surface.parameters)
    radial, _ = kernel.rim(angle, x, z)
    return distance, int(k), (centre[0] + radius * radial[0], centre[1] + radius * radial[1])


@dataclass(frozen=True)
class Ending:
    """When a ride ends [s], and why."""

    time: float
    why: str


class RimWatch:
    """Looks at the rims of both wheels during a ride, of an engine that has fixed steps.

    Parameters
    ----------
    bicycle : Bicycle
    surface : Surface
    q : ndarray, shape (9,)
        Coordinates at the start.
    searched : bool
        Whether the engine searches its contacts from the wheels' poses alone: then it must find the contacts that
        continuity gives.

    Attributes
    ----------
    centre, axle : ndarray, shape (2, 3)
        Of both wheels [m, unit vectors]: to be written before each look.
    needed : bool
        False where no rim can touch twice: on the level plane.

    Raises
    ------
    ValueError
        If a rim lies inside the ground at the start, see `require_clear_rims`.
    """

    def __init__(self, bicycle: Bicycle, surface: Surface, q: np.ndarray, searched: bool) -> None:
        known = ground(bicycle, surface)
        require_clear_rims(bicycle, surface, q)
        self.needed = known.bend > 0
        self.centre, self.axle = np.zeros((2, 3)), np.zeros((2, 3))
        self._clock, self._clearance = np.zeros(2), np.zeros((2, 2))
        # The watch does not keep the surface's compiled function alive.
        self._function = surface.function.real
        radii = np.array([bicycle.rear_wheel_radius, bicycle.front_wheel_radius])
        arrays = (self.centre, self.axle, radii, self._clock)
        where = (known, self._function, surface.parameters)
        self._look = touch.watch(*arrays, searched, *where, self._clearance).__next__

    def look(self, time: float) -> Ending | None:
        """Look at the rims at a time [s]; why the ride ends, None if it does not.

        The time of a touch is interpolated between two looks.
        """
        self._clock[0] = time
        if self._look():
            return None
        before, now = self._clearance.T
        k = int(np.nanargmin(now))
        if now[k] == -math.inf:
            why = f"the search for the {WHEELS[k]} wheel's contact jumps to another place of its rim"
            return Ending(time, f"{why} at t = {time:.6g} s")
        share = before[k] / (before[k] - now[k]) if 0 < before[k] < math.inf else 1.0
        touched = self._clock[1] + share * (time - self._clock[1])
        return Ending(touched, second_touch(WHEELS[k], touched))


def find_second_touch(
    bicycle: Bicycle, surface: Surface, times: np.ndarray, q: np.ndarray, qd: np.ndarray
) -> Ending | None:
    """Look for a second touch along the samples of a ride.

    Parameters
    ----------
    bicycle : Bicycle
    surface : Surface
    times : ndarray, shape (n,)
        [s]
    q, qd : ndarray, shape (n, 9)
        Coordinates and rates.

    Returns
    -------
    Ending or None
        What happens between two samples is seen where they are closer than half the ground's detail.
    """
    known = ground(bicycle, surface)
    if not known.bend > 0:
        return None
    q, qd = np.ascontiguousarray(q), np.ascontiguousarray(qd)
    function, parameters = surface.function.real, surface.parameters
    time, wheel = touch.first_touch(times, q, qd, known, function, parameters, constants(bicycle))
    return None if time == math.inf else Ending(time, second_touch(WHEELS[wheel], time))
