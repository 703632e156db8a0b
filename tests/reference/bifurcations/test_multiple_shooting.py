"""Orbits next to Hopf points of circles whose other disturbances grow by up to 1e10 in a period, at alpha = 1/200."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from velodrome.reference.bifurcations.hopf import HopfPoint, find_hopf_points
from velodrome.reference.bifurcations.orbit_track import track_orbit
from velodrome.reference.bifurcations.orbits import PeriodicOrbit, amplitude_condition, solve_orbit
from velodrome.reference.bifurcations.ridden import explain_orbit
from velodrome.reference.bifurcations.small_orbits import (
    count_legs,
    flow_near,
    measure_amplitude_slope,
    predict_orbit,
    small_orbits,
)
from velodrome.reference.simulate import simulate
from velodrome.reference.stability import independent

from .test_hopf import BICYCLE, BOWL, family, hopf_points

AMPLITUDES = [5e-4, 1e-3, 1.5e-3, 2e-3]


@lru_cache
def fastest() -> HopfPoint:
    """Return the Hopf point of family 4 with the largest growth in a period."""
    return max(find_hopf_points(family(4)), key=lambda point: point.growth_in_period)


@lru_cache
def orbits() -> list[PeriodicOrbit]:
    return small_orbits(fastest(), AMPLITUDES)


def test_disturbances_grow_by_little_in_a_leg() -> None:
    assert 1e9 < fastest().growth_in_period < 1e10
    assert count_legs(fastest()) == 6
    assert {count_legs(point) for point in hopf_points()} == {2}


def test_multipliers_of_time_and_energy_are_one_and_the_largest_is_that_of_the_circle() -> None:
    point = fastest()
    assert point.form is not None
    values = np.linalg.eigvals(point.form.jacobian)
    found = []
    for orbit in orbits():
        assert np.abs(orbit.multipliers[:2] - 1).max() < 1e-10
        assert orbit.invariance < 1e-10
        # The largest tends to the circle's with the squared amplitude, its logarithm relative to the period.
        found.append(np.log(orbit.multipliers[2]) / orbit.period - values.real.max())
        # Another one leaves 1 as the criticality says: the circle is subcritical.
        critical = orbit.multipliers[2:][np.abs(orbit.multipliers[2:] - 1).argmin()]
        assert critical.real > 1
        assert critical.imag == 0
    assert abs(found[3] / found[1]) == pytest.approx(4, rel=0.05)
    assert abs(found[0]) < 1e-5


def test_the_amplitude_slope_is_that_of_the_normal_form() -> None:
    """Within what orbits of these sizes leave open, which is estimated."""
    point = fastest()
    slope, error = measure_amplitude_slope(point.energy, orbits())
    assert point.amplitude_slope is not None
    assert abs(slope / point.amplitude_slope - 1) < 1e-4
    assert abs(slope - point.amplitude_slope) < 3 * error


def test_the_reference_rides_every_leg_to_the_start_of_the_next() -> None:
    """To 1e-11, the tolerance of the reference along a leg, times the growth in it."""
    orbit, point = orbits()[3], fastest()
    growth = point.growth_in_period ** (1 / count_legs(point))
    for k, (start, duration) in enumerate(zip(orbit.states, orbit.durations, strict=True)):
        state = flow_near(point).moved_to(start).near
        motion = simulate(BICYCLE, BOWL, state[:9], state[9:18], np.array([0.0, duration]))
        after = orbit.states[(k + 1) % len(orbit.states)]
        end = independent(motion.q, motion.qd)[-1]
        assert np.abs(end - after).max() < 1e-11 * growth * (1 + np.abs(after).max())
    assert explain_orbit(flow_near(point), orbit) != ()
    track = track_orbit(flow_near(point), orbit)
    assert track is not None
    cosine, sine = np.cos(track.yaw_advance), np.sin(track.yaw_advance)
    turn = np.array([[cosine, -sine], [sine, cosine]])
    for own in (track.rear, track.front):  # it goes on where it began, turned
        assert own[-1] == pytest.approx(turn @ own[0], abs=1e-11 * growth * 10)


def test_orbits_do_not_depend_on_the_number_of_legs() -> None:
    point = hopf_points()[1]
    few, many = (
        solve_orbit(flow_near(point), predict_orbit(point, 2e-3, legs), amplitude_condition(2e-3)) for legs in (2, 6)
    )
    assert len(many.states) == 6
    np.testing.assert_allclose(many.states[[0, 3]], few.states, atol=1e-9)
    np.testing.assert_allclose(many.multipliers, few.multipliers, atol=1e-9)
    assert many.energy == pytest.approx(few.energy, abs=1e-7)
    # The metric along the branch does not count the further states.
    assert abs(many.energy_slope) == pytest.approx(abs(few.energy_slope), rel=1e-6)


def test_a_growth_that_is_too_large_is_refused() -> None:
    """As that of a slow oscillation beside a fast mode."""
    assert fastest().form is not None
    slow = replace(fastest(), frequency=1e-4)
    assert slow.growth_in_period == np.inf
    with pytest.raises(ValueError, match="grows inf times in a period, too much for shooting"):
        count_legs(slow)


@pytest.mark.slow
def test_every_hopf_point_has_orbits() -> None:
    for number in range(1, 5):
        for point in find_hopf_points(family(number)):
            slope, error = measure_amplitude_slope(point.energy, small_orbits(point, AMPLITUDES))
            assert point.amplitude_slope is not None
            assert abs(slope / point.amplitude_slope - 1) < max(1e-6, 3 * error / abs(slope))
