"""The wheel tracks of periodic orbits.

An orbit is periodic in the heading frame: after a period the bicycle is where it was, turned about the axis of the
surface. If that angle is no fraction of a full turn with a small denominator, the tracks never close; the ride fills a
torus, and its tracks fill a ring on the ground.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..kinematics import YAW
from .orbits import PeriodicOrbit
from .ridden import ride_orbit
from .shooting import Flow

_POINTS = 96  # of a track over a period: with less than a turn a period, chords are within 0.1 % of their circle


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
    try:
        motions = ride_orbit(flow, orbit, _POINTS)
    except ValueError:
        return None
    tracks, yaw = [], 0.0
    for motion in motions:
        turn = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
        # The last place is the first of the next leg.
        places = motion.contact if motion is motions[-1] else motion.contact[:-1]
        tracks.append(places[:, :, :2] @ turn)
        yaw += float(motion.q[-1, YAW] - motion.q[0, YAW])
    rear, front = np.concatenate(tracks).swapaxes(0, 1)
    return OrbitTrack(yaw, rear, front)
