"""The wheel tracks of periodic orbits.

An orbit is periodic in the heading frame: after a period the bicycle is where it was, turned about the axis of the
surface. If that angle is no fraction of a full turn with a small denominator, the tracks never close; the ride fills a
torus, and its tracks fill a ring on the ground.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..kinematics import YAW
from ..simulate import simulate
from .orbits import PeriodicOrbit
from .shooting import Flow

_POINTS = 97  # of a track over a period: with less than a turn a period, chords are within 0.1 % of their circle


@dataclass(frozen=True, eq=False)
class OrbitTrack:
    """The tracks of both wheels over a period, seen from above.

    Attributes
    ----------
    yaw_advance : float
        Angle by which the bicycle turns in a period [rad].
    rear, front : ndarray, shape (n, 2)
        Contact points, with yaw 0 at the start [m].
    """

    yaw_advance: float
    rear: np.ndarray
    front: np.ndarray


def track_orbit(flow: Flow, orbit: PeriodicOrbit) -> OrbitTrack | None:
    """Return the wheel tracks of an orbit, None if it cannot be ridden for a period.

    Parameters
    ----------
    flow : Flow
        Near the orbit, see `Flow.moved_to`.
    orbit : PeriodicOrbit

    Returns
    -------
    OrbitTrack or None
    """
    start = flow.moved_to(orbit.state).near
    bicycle, surface = flow.equations.bicycle, flow.equations.surface
    try:
        motion = simulate(bicycle, surface, start[:9], start[9:18], np.linspace(0.0, orbit.period, _POINTS))
    except ValueError:  # a rim lies inside the ground at the start
        return None
    if motion.ended is not None:
        return None
    yaw = motion.q[:, YAW]
    return OrbitTrack(float(yaw[-1] - yaw[0]), motion.contact[:, 0, :2], motion.contact[:, 1, :2])
