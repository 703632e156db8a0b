"""Periodic orbits near the four Hopf points of alpha = 1/200: the second way to the amplitude law."""

import numpy as np
import pytest

from velodrome.reference.bifurcations.hopf import LEAN_INDEX, SUBCRITICAL
from velodrome.reference.bifurcations.orbits import amplitude_condition, energy_condition, solve_orbit
from velodrome.reference.bifurcations.small_orbits import (
    flow_near,
    measure_amplitude_slope,
    predict_orbit,
    small_orbits,
)
from velodrome.reference.dae import consistent_state
from velodrome.reference.simulate import simulate
from velodrome.reference.stability import independent

from .test_hopf import BICYCLE, BOWL, hopf_points

INDICES = pytest.mark.parametrize("index", range(4))


@INDICES
def test_the_amplitude_slope_is_that_of_the_normal_form(index: int) -> None:
    """By energies of four orbits and no derivatives.

    A multiplier within 1e-4 of 1 makes round-off of 1e-13 one of 1e-9 J, of 0.06 J for the smallest orbit;
    extrapolation multiplies it by about two, and leaves terms of fifth order.
    """
    point = hopf_points()[index]
    orbits = small_orbits(point, [5e-4, 1e-3, 1.5e-3, 2e-3])
    slope, error = measure_amplitude_slope(point.energy, orbits)
    assert point.amplitude_slope is not None
    assert abs(slope / point.amplitude_slope - 1) < 1e-6
    assert error < 1e-5 * abs(slope)
    # One orbit alone is off by its next order, of 1e-4 to 2e-2 of the slope.
    alone = orbits[-1].lean_amplitude ** 2 / (orbits[-1].energy - point.energy)
    assert abs(alone / point.amplitude_slope - 1) > 1e-3


@INDICES
def test_the_frequency_tends_to_the_eigenvalue_as_the_normal_form_says(index: int) -> None:
    """2 pi / period = omega + (Im k / slope + Im c1 / (2 |q_lean|)^2) A^2 + O(A^4)."""
    point = hopf_points()[index]
    assert point.form is not None
    assert point.amplitude_slope is not None
    scale = (2 * np.abs(point.form.vector[LEAN_INDEX])) ** 2
    expected = point.form.growth.value.imag / point.amplitude_slope + point.form.cubic.value.imag / scale
    orbits = small_orbits(point, [5e-4, 1e-3])
    fine, coarse = ((2 * np.pi / orbit.period - point.frequency) / orbit.lean_amplitude**2 for orbit in orbits)
    # Extrapolation to zero leaves the next order, which is smaller than its correction.
    assert abs((4 * fine - coarse) / 3 - expected) < 0.1 * abs(coarse - fine) + 1e-6 * abs(expected)


@INDICES
def test_multipliers(index: int) -> None:
    """Two are 1, and one more is below or above 1 as the criticality says."""
    point = hopf_points()[index]
    (orbit,) = small_orbits(point, [5e-4])
    assert np.abs(orbit.multipliers[:2] - 1).max() < 1e-10
    assert orbit.invariance < 1e-10
    assert orbit.residual < 1e-11
    critical = orbit.multipliers[2:][int(np.abs(orbit.multipliers[2:] - 1).argmin())]
    assert critical.imag == 0
    assert (critical.real > 1) == (point.criticality == SUBCRITICAL)
    # On the centre manifold a deviation from |z|^2 = A^2 decays with 2 Re c1 |z|^2, the energy fixed.
    assert point.first_lyapunov_coefficient is not None
    rate = 2 * point.first_lyapunov_coefficient * point.frequency * orbit.lean_amplitude**2
    assert np.log(critical.real) / orbit.period == pytest.approx(rate, rel=0.02)
    others = np.exp(np.linalg.eigvals(point.form.jacobian) * orbit.period) if point.form is not None else np.empty(0)
    for value in others[np.abs(np.abs(others) - 1) > 1e-6]:
        assert np.abs(orbit.multipliers - value).min() < 0.02


def test_orbits_do_not_depend_on_the_number_of_steps() -> None:
    point = hopf_points()[3]
    guess, flow = predict_orbit(point, 2e-3), flow_near(point)
    coarse, fine = (solve_orbit(flow, guess, amplitude_condition(2e-3), steps) for steps in (64, 256))
    assert fine.energy == pytest.approx(coarse.energy, abs=1e-7)
    np.testing.assert_allclose(fine.unknowns, coarse.unknowns, atol=1e-9)
    np.testing.assert_allclose(fine.multipliers, coarse.multipliers, atol=1e-8)


def test_an_orbit_of_a_given_energy() -> None:
    point = hopf_points()[0]
    flow, (known,) = flow_near(point), small_orbits(point, [2e-3])
    found = solve_orbit(flow, predict_orbit(point, 1.9e-3), energy_condition(known.energy))
    assert found.lean_amplitude == pytest.approx(2e-3, rel=1e-7)


@INDICES
def test_the_reference_returns_after_a_hundred_periods(index: int) -> None:
    """Within the largest multiplier's growth of the residual and of the integrator's round-off."""
    point = hopf_points()[index]
    (orbit,) = small_orbits(point, [2e-3])
    x, y, lean, steer, *rates = orbit.state.tolist()
    near = (point.level.state[2], point.level.state[5])
    q, qd = consistent_state(BICYCLE, BOWL, (x, y), lean, steer, (rates[0], rates[1], rates[2]), guess=near)
    motion = simulate(BICYCLE, BOWL, q, qd, orbit.period * np.array([0.0, 0.5, 1.0, 100.0]))
    end = independent(motion.q, motion.qd)
    # One return may be off by 1e-11, the tolerance of the reference along the orbit; a hundred add up and grow.
    growth = max(1.0, orbit.growth) ** 100 * 100
    assert np.abs(end[2] - orbit.state).max() < 1e-11 * (1 + np.abs(orbit.state).max())
    assert np.abs(end[3] - orbit.state).max() < 1e-11 * growth * (1 + np.abs(orbit.state).max())
    assert np.abs(end[1] - orbit.state).max() > 1e-3
