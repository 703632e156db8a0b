"""The whole rims of both wheels above the ground, see `reference.kernels.rim`.

A wheel that rolls touches the ground in one point. Where its rim comes to touch a second one, something hits
the wheel: a ride ends there. A start with a rim inside the ground is no start.
"""

from __future__ import annotations

import math

import numpy as np

from .bicycle import Bicycle
from .kernels import rim as kernel
from .kernels.dynamics import wheels
from .kinematics import WHEELS, constants
from .surface import Surface

_SAMPLES_A_DETAIL = 4
# Samples of a rim: what smooth ground needs, and as many as resolve a detail of 2 mm along a wheel of a bicycle.
_FEWEST, _MOST = 32, 4096
_TOUCHING = 1e-9  # of a wheel's radius: no depth worth a number


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


def require_clear_rims(bicycle: Bicycle, surface: Surface, q: np.ndarray, contact: np.ndarray) -> None:
    """Refuse a pose in which a rim lies inside the ground or touches it at a second place.

    Parameters
    ----------
    bicycle, surface, q, contact
        As in `rim_clearances`.

    Raises
    ------
    ValueError
        With the wheel, the depth and the place.
    """
    clear = rim_clearances(bicycle, surface, q, contact) > 0
    if clear.all():
        return
    k = int(np.argmin(clear))
    centre, x, _, z, radius = wheels(q, constants(bicycle))[k]
    samples = ground(bicycle, surface)[2 + k]
    distance, angle = kernel.deepest(centre, x, z, radius, samples, surface.function.real, surface.parameters)
    arm = -radius * (np.sin(angle) * np.array(x) + np.cos(angle) * np.array(z))
    place = f"x = {centre[0] + arm[0]:.4g} m, y = {centre[1] + arm[1]:.4g} m"
    if distance < -_TOUCHING * radius:
        raise ValueError(f"the {WHEELS[k]} rim lies {-1e3 * distance:.3g} mm inside the ground at {place}")
    raise ValueError(f"the {WHEELS[k]} rim touches the ground at a second place at {place}")

