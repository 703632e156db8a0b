"""Small periodic orbits near a Hopf point, and the amplitude law that follows from them without derivatives."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .hopf import LEAN_INDEX, HopfPoint
from .orbits import PeriodicOrbit, amplitude_condition, solve_orbit
from .shooting import Flow

# In a leg. Round-off of a leg, 1e-14, times this is the residual at which orbits count as solved, 1e-12 in units of 1.
_LARGEST_GROWTH = 100.0
_MOST_LEGS = 24  # of which an orbit takes seconds


def flow_near(point: HopfPoint) -> Flow:
    """Return the flow of the independent variables near a Hopf point."""
    return Flow(point.level.equations, point.level.state)


def count_legs(point: HopfPoint) -> int:
    """Return the number of legs, an even one, of orbits born at a Hopf point: disturbances grow by little in each.

    Raises
    ------
    ValueError
        If they grow so much in a period that there would be too many legs.
    """
    pairs = np.log(max(point.growth_in_period, 1.0)) / np.log(_LARGEST_GROWTH) / 2
    if not pairs <= _MOST_LEGS // 2:
        raise ValueError(f"a disturbance grows {point.growth_in_period:.3g} times in a period, too much for shooting")
    return 2 * max(1, int(np.ceil(pairs)))


def predict_orbit(point: HopfPoint, amplitude: float, legs: int | None = None) -> np.ndarray:
    """Return the unknowns of `velodrome.reference.bifurcations.orbits` of a small orbit from the normal form.

    Parameters
    ----------
    point : HopfPoint
        With an amplitude slope.
    amplitude : float
        Half of the peak-to-peak of the lean [rad].
    legs : int, optional
        Their number m, even; that of `count_legs` if not given.

    Returns
    -------
    ndarray, shape (7 m + 2,)
        To second order in the amplitude.
    """
    if point.form is None or point.amplitude_slope is None:
        raise ValueError(f"no orbits are known at this Hopf point: {point.why_undefined}")
    form, level = point.form, point.level
    q = form.vector[LEAN_INDEX]
    z = amplitude / (2 * q)  # the lean is greatest at the start
    change = amplitude**2 / point.amplitude_slope
    count = count_legs(point) if legs is None else legs
    turns = np.exp(2j * np.pi * np.arange(count) / count)
    oscillations = np.array([form.manifold(turned) for turned in z * turns])
    variables = level.centre + change * form.equilibrium_slope + oscillations
    _, rear_rate = level.field(variables, np.full(count, level.energy + change))
    rate = form.frequency + form.growth.value.imag * change + form.cubic.value.imag * abs(z) ** 2
    states = np.column_stack([variables, np.real(rear_rate)])
    return np.concatenate([states.ravel(), np.full(2, np.pi / rate)])


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
