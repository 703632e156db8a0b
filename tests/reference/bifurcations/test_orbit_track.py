"""Wheel tracks of periodic orbits."""

from itertools import pairwise

import numpy as np
import pytest

from velodrome.reference.bifurcations.orbit_track import track_orbit
from velodrome.reference.bifurcations.small_orbits import flow_near, small_orbits
from velodrome.reference.simulate import simulate

from .test_hopf import BICYCLE, BOWL, hopf_points


@pytest.mark.parametrize("index", range(4))
def test_the_next_period_is_this_one_turned(index: int) -> None:
    point = hopf_points()[index]
    (orbit,) = small_orbits(point, [0.004])
    flow = flow_near(point)
    track = track_orbit(flow, orbit)
    assert track is not None
    state = flow.moved_to(orbit.state).near
    ends, count = np.append(0.0, np.cumsum(orbit.durations)), len(track.rear) // len(orbit.durations)
    once = np.concatenate([np.linspace(*leg, count, endpoint=False) for leg in pairwise(ends)])
    times = np.concatenate([once, orbit.period + once, [2 * orbit.period]])
    motion = simulate(BICYCLE, BOWL, state[:9], state[9:18], times)
    angle = track.yaw_advance
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    # Orbits and the starts of their legs are solved to 1e-12 of their size, a few metres, which a period multiplies by
    # some tens at most.
    for k, own in enumerate((track.rear, track.front)):
        places = motion.contact[:, k, :2]
        assert places[: len(own)] == pytest.approx(own, abs=1e-11)
        assert places[len(own) - 1 :] == pytest.approx(own @ turn.T, abs=1e-9)
