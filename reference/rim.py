"""The whole rims of both wheels above the ground, see `velodrome.reference.kernels.rim`.

A wheel that rolls touches the ground in one point. Where its rim comes to touch a second one, something hits
the wheel: a ride ends there. A start with a rim inside the ground is no start.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from .bicycle import Bicycle
from .dae import contact_parameters
from .kernels import rim as kernel
from .kernels import touch
from .kernels.dynamics import wheels
from .kinematics import WHEELS, constants
from .surface import Surface, SurfaceOfRevolution, evaluate

_SAMPLES_A_DETAIL = 4
# Samples of a rim: what smooth ground needs, and as many as resolve a detail of 2 mm along a wheel of a bicycle.
_FEWEST, _MOST = 32, 4096
_TOUCHING = 1e-9  # [m] no depth worth a number
# Bounds of a bowl's curvature: rings of an eighth of a wheel, out to where most rides end, each sampled.
_RINGS_A_WHEEL, _SAMPLES_A_RING, _FARTHEST = 8, 16, 200.0


def rim_search(surface: Surface, radii: Sequence[float] | np.ndarray) -> kernel.RimSearch:
    """How closely to look at the rims of wheels of some radii [m], from the surface's ``bend`` and ``detail``."""
    largest, smallest = max(radii), min(radii)
    finest = 2 * math.pi * largest * _SAMPLES_A_DETAIL / _MOST
    # Within a wheel's radius smooth ground does not bend to and fro, or no wheel could be said to touch it in a point.
    detail = max(min(float(getattr(surface, "detail", math.inf)), smallest), finest)
    samples = max(_FEWEST, math.ceil(2 * math.pi * largest / detail * _SAMPLES_A_DETAIL))
    bend = getattr(surface, "bend", None)
    bends, width = np.array([math.inf if bend is None else float(bend)]), math.inf
    if bend is None and isinstance(surface, SurfaceOfRevolution):
        bends, width = _bends(surface, 2 * largest, detail)  # type: ignore[arg-type]
    return kernel.RimSearch(bool(bends[0] > 0 or len(bends) > 1), bends, width, detail, samples)


def bicycle_rim_search(bicycle: Bicycle, surface: Surface) -> kernel.RimSearch:
    """How closely to look at the rims of a bicycle, see `rim_search`."""
    return rim_search(surface, (bicycle.rear_wheel_radius, bicycle.front_wheel_radius))


@lru_cache(maxsize=64)
def _bends(surface: SurfaceOfRevolution, reach: float, detail: float) -> tuple[np.ndarray, float]:
    """Bounds of a bowl's upward curvature within ``reach`` of its rings, shape (k,) [1/m], and the rings' width [m].

    The principal curvatures are sampled, and may exceed the samples by what those differ between neighbours.
    """
    width = reach / _RINGS_A_WHEEL
    rings = math.ceil(min(surface.extent[1], _FARTHEST) / width)
    samples = max(_SAMPLES_A_RING, math.ceil(_SAMPLES_A_DETAIL * width / detail))
    values = evaluate(surface, np.arange(rings * samples + 1) * (width / samples), 0.0)
    curvature = values[:, [3, 5]].max(axis=1)
    curvature[np.isnan(curvature)] = math.inf
    with np.errstate(invalid="ignore"):
        steps = np.maximum(curvature[1:], curvature[:-1]) + np.abs(np.diff(curvature))
    steps[np.isnan(steps)] = math.inf
    spread = _RINGS_A_WHEEL + 1
    # Nothing is within reach across the axis that is not on this side of it; nothing is known beyond the last ring.
    edges = np.full(spread, -math.inf), np.full(spread, math.inf)
    rows = np.concatenate([edges[0], steps.reshape(rings, samples).max(axis=1), edges[1]])
    return np.lib.stride_tricks.sliding_window_view(rows, 2 * spread + 1).max(axis=1), width


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
        Contact parameters of both wheels there, as `velodrome.reference.dae.contact_parameters` gives them.
    """
    known, function, parameters = bicycle_rim_search(bicycle, surface), surface.function.real, surface.parameters
    clearances = np.empty(2)
    for k, (centre, x, _, z, radius) in enumerate(wheels(q, constants(bicycle))):
        angle = contact[3 * k + 2]
        clearances[k] = kernel.bound(centre, x, z, radius, angle, known, function, parameters)
        if not clearances[k] > 0:
            where = (centre, x, z, radius, angle, True, known.samples, function, parameters)
            clearances[k], _ = kernel.least_clearance(*where)
    return clearances


def require_clear_rims(
    bicycle: Bicycle, surface: Surface, q: np.ndarray, contact: np.ndarray | None = None, may_sink: bool = False
) -> None:
    """Refuse a pose in which a rim lies inside the ground or touches it at a second place.

    Parameters
    ----------
    bicycle, surface, q, contact
        As in `rim_clearances`; without ``contact`` it is searched.
    may_sink : bool
        Whether a contact itself may lie inside the ground, as soft contacts do.

    Raises
    ------
    ValueError
        With the wheel, the depth and the place; or if a wheel has no contact.
    """
    if not bicycle_rim_search(bicycle, surface).curved:
        return
    if contact is None:
        contact = contact_parameters(bicycle, surface, q)
    deepest = [_deepest(bicycle, surface, q, k) for k in (0, 1)]
    distance, k, point = min(deepest)
    # The contact that is searched anew may itself lie inside the ground: the start has settled on another place.
    if not may_sink and distance < -_TOUCHING:
        place = _place(point)
        raise ValueError(f"the {WHEELS[k]} rim lies {-1e3 * distance:.3g} mm inside the ground at {place}")
    for (depth, k, point), clear in zip(deepest, rim_clearances(bicycle, surface, q, contact) > 0, strict=True):
        if not clear and depth < -_TOUCHING:
            raise ValueError(f"the {WHEELS[k]} rim lies {-1e3 * depth:.3g} mm inside the ground at {_place(point)}")
        if not clear:
            raise ValueError(f"the {WHEELS[k]} rim touches the ground at a second place, not only at {_place(point)}")


def _place(point: tuple[float, float]) -> str:
    return f"x = {point[0]:.4g} m, y = {point[1]:.4g} m"


def _deepest(bicycle: Bicycle, surface: Surface, q: np.ndarray, k: int) -> tuple[float, int, tuple[float, float]]:
    """Signed distance of a wheel's deepest rim point from the ground [m], the wheel, and x and y of that point [m]."""
    centre, x, _, z, radius = wheels(q, constants(bicycle))[k]
    samples = bicycle_rim_search(bicycle, surface).samples
    distance, angle = kernel.deepest(centre, x, z, radius, samples, surface.function.real, surface.parameters)
    radial, _ = kernel.rim(angle, x, z)
    return distance, k, (centre[0] + radius * radial[0], centre[1] + radius * radial[1])


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

    def __init__(self, bicycle: Bicycle, surface: Surface, q: np.ndarray) -> None:
        known = bicycle_rim_search(bicycle, surface)
        require_clear_rims(bicycle, surface, q, may_sink=True)
        self.needed = known.curved
        self.centre, self.axle = np.zeros((2, 3)), np.zeros((2, 3))
        self._clock, self._clearance = np.zeros(2), np.full((2, 2), np.nan)
        # The watch does not keep the surface's compiled function alive.
        self._function = surface.function.real
        radii = np.array([bicycle.rear_wheel_radius, bicycle.front_wheel_radius])
        arrays = (self.centre, self.axle, radii, self._clock)
        where = (known, self._function, surface.parameters)
        self._look = touch.watch(*arrays, *where, self._clearance).__next__

    def look(self, time: float) -> Ending | None:
        """Look at the rims at a time [s]; why the ride ends, None if it does not.

        The time of a touch is interpolated between two looks.
        """
        self._clock[0] = time
        if self._look():
            return None
        before, now = self._clearance.T
        k = int(np.nanargmin(now))
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
    known = bicycle_rim_search(bicycle, surface)
    if not known.curved:
        return None
    q, qd = np.ascontiguousarray(q), np.ascontiguousarray(qd)
    function, parameters = surface.function.real, surface.parameters
    time, wheel = touch.first_touch(times, q, qd, known, function, parameters, constants(bicycle))
    return None if time == math.inf else Ending(time, second_touch(WHEELS[wheel], time))
