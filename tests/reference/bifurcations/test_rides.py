"""Rides of the reference from both sides of each Hopf point of alpha = 1/200: they grow and die out as orbits say."""

import numpy as np
import pytest

from velodrome.reference.bifurcations.hopf import SUBCRITICAL, HopfPoint
from velodrome.reference.bifurcations.small_orbits import small_orbits
from velodrome.reference.dae import consistent_state
from velodrome.reference.simulate import simulate

from .test_hopf import BICYCLE, BOWL, hopf_points

AMPLITUDE = 0.004
_LOOKS = 64  # samples in a period: its extremes are missed by (pi / 64)^2 / 2, a thousandth


def ride(point: HopfPoint, energy: float, shift: np.ndarray, period: float, periods: int) -> np.ndarray:
    """Return the amplitudes of the lean in each period of a ride at an energy, from a shift (7,) off its circle."""
    start = point.level.circle(energy) + shift
    _, rear_rate = point.level.field(start[None, :6], np.array([energy]))
    x, y, lean, steer, lean_rate, steer_rate = start[:6].tolist()
    rates = lean_rate, steer_rate, float(np.real(rear_rate[0]))
    near = point.level.state[2], point.level.state[5]
    q, qd = consistent_state(BICYCLE, BOWL, (x, y), lean, steer, rates, guess=near)
    motion = simulate(BICYCLE, BOWL, q, qd, np.arange(periods * _LOOKS) * period / _LOOKS)
    assert motion.ended is None
    leans = motion.q[:, 4].reshape(periods, _LOOKS)
    return np.ptp(leans, axis=1) / 2


@pytest.mark.parametrize("index", range(4))
def test_rides_on_both_sides(index: int) -> None:
    """At the energy of an orbit, smaller and larger disturbances tend to it, or away from it; beyond, there is none."""
    point = hopf_points()[index]
    (orbit,) = small_orbits(point, [AMPLITUDE])
    offset, change = orbit.state - point.level.circle(orbit.energy), orbit.energy - point.energy
    # Deviations from the orbit change by the slowest multiplier: by e^1.5, and by e^0.75 where they must stay small.
    periods = int(np.ceil(1.5 / abs(1 - orbit.growth)))
    inside = ride(point, orbit.energy, 0.8 * offset, orbit.period, periods)
    outside = ride(point, orbit.energy, 1.1 * offset, orbit.period, periods // 2)
    beyond = ride(point, point.energy - change, 0.1 * offset, orbit.period, periods)
    if point.criticality == SUBCRITICAL:
        assert inside[-1] < 0.9 * inside[3] < 0.9 * AMPLITUDE
        assert outside[-1] > 1.05 * outside[0] > 1.05 * AMPLITUDE
        assert beyond[-1] > 1.2 * beyond[3]  # the circle is unstable there, and no orbit stops it
    else:
        # A third of the deviation is left after e^1.5, and a half after e^0.75, with the samples' error.
        for amplitudes, left in ((inside, 1 / 3), (outside, 0.6)):
            deviations = np.abs(amplitudes - AMPLITUDE)
            assert deviations[-1] < left * deviations[0] + 1.2e-3 * AMPLITUDE
        assert beyond[-1] < 0.8 * beyond[3]
