"""Clearance of both wheels' whole rims from the ground, see `velodrome.reference.kernels.rim`.

A rolling wheel touches the ground in one point. Where its rim touches a second one, an impact follows, and a ride
ends there. A start with a rim inside the ground is refused.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from .bicycle import Bicycle
from .dae import contact_parameters
from .fall import Ending
from .kernels import rim as kernel
from .kernels import touch
from .kernels.dynamics import wheels
from .kernels.rides import TOUCHING
from .kinematics import WHEELS, constants
from .surface import Surface, SurfaceOfRevolution, evaluate

_SAMPLES_A_DETAIL = 4
# Samples of a rim: as many as smooth ground needs, and as many as resolve a detail of 2 mm along a bicycle's wheel.
_FEWEST, _MOST = 32, 4096
# Bounds of a bowl's curvature: rings an eighth of a wheel wide, out to where most rides end, each sampled.
_RINGS_A_WHEEL, _SAMPLES_A_RING, _FARTHEST = 8, 16, 200.0


def rim_search(surface: Surface, radii: Sequence[float] | np.ndarray) -> kernel.RimSearch:
    """Choose how finely to search the rims of wheels of some radii [m], from the surface's ``bend`` and ``detail``."""
    largest, smallest = max(radii), min(radii)
    finest = 2 * math.pi * largest * _SAMPLES_A_DETAIL / _MOST
    # Smooth ground does not bend to and fro within a wheel's radius: otherwise a wheel could not touch it in a point.
    detail = max(min(float(getattr(surface, "detail", math.inf)), smallest), finest)
    samples = max(_FEWEST, math.ceil(2 * math.pi * largest / detail * _SAMPLES_A_DETAIL))
    bend = getattr(surface, "bend", None)
    bends, width = np.array([math.inf if bend is None else float(bend)]), math.inf
    if bend is None and isinstance(surface, SurfaceOfRevolution):
        bends, width = _bound_curvature(surface, 2 * largest, detail)  # type: ignore[arg-type]
    return kernel.RimSearch(bool(bends[0] > 0 or len(bends) > 1), bends, width, detail, samples)


def bicycle_rim_search(bicycle: Bicycle, surface: Surface) -> kernel.RimSearch:
    """Choose how finely to search the rims of a bicycle, see `rim_search`."""
    return rim_search(surface, (bicycle.rear_wheel_radius, bicycle.front_wheel_radius))


@lru_cache(maxsize=64)
def _bound_curvature(surface: SurfaceOfRevolution, reach: float, detail: float) -> tuple[np.ndarray, float]:
    """Bound a bowl's upward curvature within ``reach`` of its rings.

    The principal curvatures are sampled; they may exceed the samples by the difference between neighbouring samples.

    Returns
    -------
    bends : ndarray, shape (k,)
        Bounds by ring [1/m].
    width : float
        Width of the rings [m].
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
    # What lies across the axis has the same radii as this side of it; nothing is known beyond the last ring.
    edges = np.full(spread, -math.inf), np.full(spread, math.inf)
    rows = np.concatenate([edges[0], steps.reshape(rings, samples).max(axis=1), edges[1]])
    return np.lib.stride_tricks.sliding_window_view(rows, 2 * spread + 1).max(axis=1), width


def second_touch(wheel: str, time: float) -> str:
    """Describe why a ride ends at a time [s] at which a rim touches the ground a second time."""
    return f"the {wheel} rim touches the ground at a second place at t = {time:.6g} s"


def rim_clearances(bicycle: Bicycle, surface: Surface, q: np.ndarray, contact: np.ndarray) -> np.ndarray:
    """Compute the least clearances of both rims, shape (2,), dimensionless; positive where a rim touches only once.

    Parameters
    ----------
    bicycle : Bicycle
    surface : Surface
    q : ndarray, shape (9,)
        Coordinates.
    contact : ndarray, shape (6,)
        Contact parameters of both wheels at q, as `velodrome.reference.dae.contact_parameters` returns them.
    """
    known, function, parameters = bicycle_rim_search(bicycle, surface), surface.function.real, surface.parameters
    clearances = np.empty(2)
    for k, (centre, x, _, z, radius) in enumerate(wheels(q, constants(bicycle))):
        angle = contact[3 * k + 2]
        clearances[k] = kernel.bound(centre, x, z, radius, angle, known, function, parameters)
        if not clearances[k] > 0:
            clearances[k], _ = kernel.least_clearance(
                centre, x, z, radius, angle, True, known.samples, function, parameters
            )
    return clearances


def require_clear_rims(
    bicycle: Bicycle, surface: Surface, q: np.ndarray, contact: np.ndarray | None = None, may_sink: bool = False
) -> None:
    """Refuse a pose in which a rim lies inside the ground or touches it at a second place.

    Parameters
    ----------
    bicycle, surface, q, contact
        As in `rim_clearances`; without ``contact`` it is computed from the pose.
    may_sink : bool
        Whether a contact itself may lie inside the ground, as soft contacts do.

    Raises
    ------
    ValueError
        If a rim is not clear, with the wheel, the depth and the place; or if a wheel has no contact.
    """
    if not bicycle_rim_search(bicycle, surface).curved:
        return
    if contact is None:
        contact = contact_parameters(bicycle, surface, q)
    clear_rims = rim_clearances(bicycle, surface, q, contact) > 0
    if may_sink and clear_rims.all():
        return
    deepest = [_find_deepest(bicycle, surface, q, k) for k in (0, 1)]
    distance, k, point = min(deepest)
    # A contact computed anew may itself lie inside the ground if the start has settled on another place of the rim.
    if not may_sink and distance < -TOUCHING:
        place = _format_xy(point)
        raise ValueError(f"the {WHEELS[k]} rim lies {-1e3 * distance:.3g} mm inside the ground at {place}")
    for (depth, k, point), clear in zip(deepest, clear_rims, strict=True):
        if not clear and depth < -TOUCHING:
            raise ValueError(f"the {WHEELS[k]} rim lies {-1e3 * depth:.3g} mm inside the ground at {_format_xy(point)}")
        if not clear:
            raise ValueError(
                f"the {WHEELS[k]} rim touches the ground at a second place, not only at {_format_xy(point)}"
            )


def describe_rim_depth(bicycle: Bicycle, surface: Surface, q: np.ndarray, k: int) -> str:
    """Describe how far the rim of wheel ``k`` lies inside the ground at coordinates (9,); empty if it only touches."""
    distance, *_ = _find_deepest(bicycle, surface, q, k)
    return f": {-1e3 * distance:.3g} mm inside" if distance < -TOUCHING else ""


def _format_xy(point: tuple[float, float]) -> str:
    return f"x = {point[0]:.4g} m, y = {point[1]:.4g} m"


def _find_deepest(bicycle: Bicycle, surface: Surface, q: np.ndarray, k: int) -> tuple[float, int, tuple[float, float]]:
    """Return a wheel's deepest rim point: signed distance from the ground [m], wheel, and (x, y) of the point [m]."""
    centre, x, _, z, radius = wheels(q, constants(bicycle))[k]
    samples = bicycle_rim_search(bicycle, surface).samples
    distance, angle = kernel.deepest(centre, x, z, radius, samples, surface.function.real, surface.parameters)
    radial, _ = kernel.rim(angle, x, z)
    return distance, k, (centre[0] + radius * radial[0], centre[1] + radius * radial[1])


class RimWatch:
    """Watch over the rims of both wheels during a ride of an engine with fixed steps.

    Parameters
    ----------
    bicycle : Bicycle
    surface : Surface
    q : ndarray, shape (9,)
        Coordinates at the start.

    Attributes
    ----------
    centre, axle : ndarray, shape (2, 3)
        Centres [m] and axles [unit vectors] of both wheels, to be written before each `look`.
    needed : bool
        False where no rim can touch twice, as on the level plane.

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
        # The surface's compiled function must stay alive as long as the watch.
        self._function = surface.function.real
        radii = np.array([bicycle.rear_wheel_radius, bicycle.front_wheel_radius])
        self._look = touch.watch(
            self.centre,
            self.axle,
            radii,
            self._clock,
            known,
            self._function,
            surface.parameters,
            self._clearance,
        ).__next__

    def look(self, time: float) -> Ending | None:
        """Look at the rims at a time [s]; return why the ride ends, None if it does not.

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
        A touch between two samples is found where they are closer than half the ground's detail.
    """
    known = bicycle_rim_search(bicycle, surface)
    if not known.curved:
        return None
    q, qd = np.ascontiguousarray(q), np.ascontiguousarray(qd)
    function, parameters = surface.function.real, surface.parameters
    time, wheel = touch.first_touch(times, q, qd, known, function, parameters, constants(bicycle))
    return None if time == math.inf else Ending(time, second_touch(WHEELS[wheel], time))
