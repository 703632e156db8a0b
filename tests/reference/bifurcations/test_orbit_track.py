"""Wheel tracks of periodic orbits."""

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
    times = np.linspace(0.0, 2 * orbit.period, 2 * len(track.rear) - 1)
    motion = simulate(BICYCLE, BOWL, state[:9], state[9:18], times)
    angle = track.yaw_advance
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    # Orbits are solved to 1e-12 of their size, which a period multiplies by some tens at most.
    for k, own in enumerate((track.rear, track.front)):
        places = motion.contact[:, k, :2]
        assert places[: len(own)] == pytest.approx(own, abs=1e-12)
        assert places[len(own) - 1 :] == pytest.approx(own @ turn.T, abs=1e-9)
