"""Small periodic orbits near a Hopf point, and the amplitude law that follows from them without derivatives."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .hopf import LEAN_INDEX, HopfPoint
from .orbits import PeriodicOrbit, amplitude_condition, solve_orbit
from .shooting import Flow


def flow_near(point: HopfPoint) -> Flow:
    """Return the flow of the independent variables near a Hopf point."""
    return Flow(point.level.equations, point.level.state)


def predict_orbit(point: HopfPoint, amplitude: float) -> np.ndarray:
    """Return the unknowns (9,) of `velodrome.reference.bifurcations.orbits` of a small orbit from the normal form.

    Parameters
    ----------
    point : HopfPoint
        With an amplitude slope.
    amplitude : float
        Half of the peak-to-peak of the lean [rad].

    Returns
    -------
    ndarray, shape (9,)
        To second order in the amplitude.
    """
    if point.form is None or point.amplitude_slope is None:
        raise ValueError(f"no orbits are known at this Hopf point: {point.why_undefined}")
    form, level = point.form, point.level
    q = form.vector[LEAN_INDEX]
    z = amplitude / (2 * q)  # the lean is greatest at the start
    change = amplitude**2 / point.amplitude_slope
    variables = level.centre + change * form.equilibrium_slope + form.manifold(z)
    _, rear_rate = level.field(variables[None], np.array([level.energy + change]))
    rate = form.frequency + form.growth.value.imag * change + form.cubic.value.imag * abs(z) ** 2
    return np.concatenate([variables, np.real(rear_rate), np.full(2, np.pi / rate)])


def small_orbits(point: HopfPoint, amplitudes: Sequence[float]) -> list[PeriodicOrbit]:
    """Solve for orbits near a Hopf point, each from the normal form.

    Parameters
    ----------
    point : HopfPoint
    amplitudes : sequence of float
        Halves of the peak-to-peak of the lean [rad].

    Returns
    -------
    list of PeriodicOrbit
    """
    flow = flow_near(point)
    return [solve_orbit(flow, predict_orbit(point, size), amplitude_condition(size)) for size in amplitudes]


def measure_amplitude_slope(energy: float, orbits: Sequence[PeriodicOrbit]) -> tuple[float, float]:
    """Compute d(A^2) / dE at a Hopf point from orbits, without derivatives.

    The energy is a power series in the squared amplitude, E = E0 + A^2 / slope + c2 A^4 + ..., through all orbits.

    Parameters
    ----------
    energy : float
        E0, of the circular motion at the Hopf point [J].
    orbits : sequence of PeriodicOrbit, length n >= 2
        Of different amplitudes.

    Returns
    -------
    slope : float
        [rad^2/J].
    error : float
        Largest difference from the slopes by all orbits but one: without the largest amplitude it shows the terms
        left out, without the smallest the round-off.
    """
    squares = np.array([orbit.lean_amplitude for orbit in orbits]) ** 2
    # (E - E0) / A^2 is a polynomial of degree n - 1 in A^2, extrapolated to zero.
    inverse = (np.array([orbit.energy for orbit in orbits]) - energy) / squares
    slope = 1 / _extrapolate(squares, inverse)
    others = [1 / _extrapolate(np.delete(squares, k), np.delete(inverse, k)) for k in range(len(orbits))]
    return slope, max(abs(slope - other) for other in others)


def _extrapolate(x: np.ndarray, values: np.ndarray) -> float:
    """Return the value at zero of the polynomial through points (n,), by Lagrange's formula."""
    weights = [np.prod([b / (b - a) for b in x if b != a]) for a in x]
    return float(np.dot(weights, values))
