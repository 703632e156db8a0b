"""Periodic orbits of the independent variables: tori on the ground, where a bicycle weaves along its circle.

An orbit is solved for by shooting. Its start v is at a greatest lean; the unknowns are v (7), the time t1 to the least
lean and the time t2 from there back to the greatest one, and the equations

    lean_rate(0) = 0,    lean_rate(t1) = 0,    v(t1 + t2) = v(0)

As the energy is conserved, one of the nine is redundant: orbits form one-parameter families, and a further condition
picks one, such as its lean amplitude A = (lean(0) - lean(t1)) / 2. Newton's steps are those of least squares, with
exact derivatives (`shooting`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..stability import VARIABLES
from .floquet import floquet_multipliers
from .shooting import Flow, Legs

UNKNOWNS = 9

_LEAN, _LEAN_RATE = VARIABLES.index("lean"), VARIABLES.index("lean_rate")
_MOST = 20  # Newton's iterations
# Step of Newton's method, relative to 1 + |unknown|, after which the next would be round-off: convergence is quadratic.
_CONVERGED = 1e-9
# Residual with twice as many steps, relative to the largest unknown, at which their number is large enough: round-off
# of some thousand additions. An error of the method is 256 times smaller with the steps doubled.
_SETTLED = 1e-12
_FEWEST_STEPS, _MOST_STEPS = 64, 4096  # 64 are enough for small orbits about circles of a usual speed


class Picked(NamedTuple):
    """One more equation, value = 0, that picks an orbit of a branch: its value and gradient (9,)."""

    value: float
    gradient: np.ndarray


OrbitCondition = Callable[[np.ndarray, Legs], Picked]


@dataclass(frozen=True, eq=False)
class PeriodicOrbit:
    """A periodic orbit.

    Attributes
    ----------
    unknowns : ndarray, shape (9,)
        The independent variables at the greatest lean, and the times t1 and t2.
    lean_amplitude : float
        Half of the peak-to-peak of the lean [rad].
    energy : float
        Kinetic and potential, the latter zero at z = 0 [J].
    multipliers : ndarray, shape (7,), complex
        Floquet multipliers, see `velodrome.reference.bifurcations.floquet`.
    invariance : float
        Deviation of the monodromy matrix from what time and energy ask of it, see there.
    residual : float
        Largest of the equations, with twice as many steps as they were solved with [m, rad, rad/s].
    steps : int
        Number of steps in a period with which the equations were solved.
    tangent : ndarray, shape (9,)
        Vector along the branch, of unit length in the metric `arc_metric` and of either sign.
    energy_slope : float
        Derivative of the energy along the tangent [J].
    amplitude_slope : float
        Derivative of the lean amplitude along the tangent [rad].
    """

    unknowns: np.ndarray
    lean_amplitude: float
    energy: float
    multipliers: np.ndarray
    invariance: float
    residual: float
    steps: int
    tangent: np.ndarray
    energy_slope: float
    amplitude_slope: float

    @property
    def state(self) -> np.ndarray:
        """The independent variables `velodrome.reference.stability.VARIABLES` at the greatest lean, shape (7,)."""
        return self.unknowns[:7]

    @property
    def period(self) -> float:
        """Period [s]."""
        return float(self.unknowns[7] + self.unknowns[8])

    @property
    def growth(self) -> float:
        """Size of the largest multiplier but those of time and energy: the orbit is stable below 1."""
        return float(np.abs(self.multipliers[2:]).max())


def arc_metric(unknowns: np.ndarray) -> np.ndarray:
    """Return the diagonal (9,) of the metric of steps along a branch: large unknowns count relatively."""
    weights = np.ones(UNKNOWNS)
    weights[:2] = 1 / (1 + np.hypot(unknowns[0], unknowns[1])) ** 2
    weights[6:] = 1 / (1 + np.abs(unknowns[6:])) ** 2
    return weights


def amplitude_condition(amplitude: float) -> OrbitCondition:
    """Make the condition of a given lean amplitude [rad]."""

    def condition(unknowns: np.ndarray, legs: Legs) -> Picked:
        return Picked(float(unknowns[_LEAN] - legs.ends[0, _LEAN]) / 2 - amplitude, _amplitude_gradient(legs))

    return condition


def _amplitude_gradient(legs: Legs) -> np.ndarray:
    """Return the derivatives (9,) of the lean amplitude by the unknowns."""
    gradient = -np.append(legs.start_derivatives[0, _LEAN], legs.duration_derivatives[0, _LEAN]) / 2
    gradient[_LEAN] += 0.5
    return gradient


def energy_condition(energy: float) -> OrbitCondition:
    """Make the condition of a given energy [J]."""

    def condition(_: np.ndarray, legs: Legs) -> Picked:
        # In units of the energy, so that the condition is of order one as the equations are.
        return Picked((legs.energy - energy) / energy, np.append(legs.energy_gradient, [0.0, 0.0]) / energy)

    return condition


def orbit_plane_condition(start: np.ndarray, covector: np.ndarray, distance: float) -> OrbitCondition:
    """Make the condition of pseudo-arclength: ``distance`` from the unknowns ``start`` along a covector (9,)."""
    return lambda unknowns, _: Picked(float(covector @ (unknowns - start)) - distance, covector)


def solve_orbit(
    flow: Flow, guess: np.ndarray, condition: OrbitCondition, steps: int = _FEWEST_STEPS, most: int = _MOST
) -> PeriodicOrbit:
    """Solve for a periodic orbit.

    Parameters
    ----------
    flow : Flow
    guess : ndarray, shape (9,)
        See `PeriodicOrbit.unknowns`.
    condition : callable
        Maps the unknowns and the ride to a `Picked`.
    steps : int
        Number of steps in a period to begin with; it is doubled until the result does not depend on it.
    most : int
        Largest number of Newton's iterations.

    Returns
    -------
    PeriodicOrbit

    Raises
    ------
    ValueError
        If Newton's method does not converge, or the ride cannot be integrated.
    """
    unknowns, legs = _solve(flow, guess, condition, steps, most)
    residual = _residual(flow, unknowns, 2 * steps)
    while residual > _SETTLED * (1 + np.abs(unknowns).max()):
        steps *= 2
        if steps > _MOST_STEPS:
            raise ValueError("the orbit cannot be integrated precisely")
        unknowns, legs = _solve(flow, unknowns, condition, steps, most)
        residual = _residual(flow, unknowns, 2 * steps)
    start, along = unknowns[:7], np.linalg.svd(_jacobian(legs))[2][-1]
    along = along / np.sqrt(along @ (arc_metric(unknowns) * along))
    multipliers, invariance = floquet_multipliers(legs.start_derivatives[1], flow.rates(start), legs.energy_gradient)
    return PeriodicOrbit(
        unknowns=unknowns,
        lean_amplitude=float(start[_LEAN] - legs.ends[0, _LEAN]) / 2,
        energy=legs.energy,
        multipliers=multipliers,
        invariance=invariance,
        residual=residual,
        steps=steps,
        tangent=along,
        energy_slope=float(legs.energy_gradient @ along[:7]),
        amplitude_slope=float(_amplitude_gradient(legs) @ along),
    )


def find_monodromy(flow: Flow, orbit: PeriodicOrbit) -> np.ndarray:
    """Return the derivative (7, 7) of the state after a period of an orbit by that at its start."""
    return flow.ride_legs(orbit.state, orbit.unknowns[7:], _halves(orbit.steps)).start_derivatives[1]


def _halves(steps: int) -> np.ndarray:
    return np.array([steps // 2, steps // 2])


def _residual(flow: Flow, unknowns: np.ndarray, steps: int) -> float:
    ends, _ = flow.ride(unknowns[:7], unknowns[7:], _halves(steps))
    return float(np.abs(_equations(unknowns, np.real(ends))).max())


def _equations(unknowns: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Return the nine equations' residuals from the independent variables (2, 7) after t1 and t2."""
    start = unknowns[:7]
    return np.concatenate([[start[_LEAN_RATE], ends[0, _LEAN_RATE]], ends[1] - start])


def _jacobian(legs: Legs) -> np.ndarray:
    """Return the derivatives of `_equations` by the unknowns, shape (9, 9), of rank 8."""
    matrix = np.zeros((9, UNKNOWNS))
    matrix[0, _LEAN_RATE] = 1
    matrix[1, :7], matrix[1, 7:] = legs.start_derivatives[0, _LEAN_RATE], legs.duration_derivatives[0, _LEAN_RATE]
    matrix[2:, :7], matrix[2:, 7:] = legs.start_derivatives[1] - np.eye(7), legs.duration_derivatives[1]
    return matrix


def _solve(flow: Flow, guess: np.ndarray, condition: OrbitCondition, steps: int, most: int) -> tuple[np.ndarray, Legs]:
    """Solve the equations and a condition with a number of steps; return the unknowns and the ride from them."""
    unknowns, size = guess, np.inf
    for _ in range(most):
        legs = flow.ride_legs(unknowns[:7], unknowns[7:], _halves(steps))
        if size < _CONVERGED:
            return unknowns, legs
        picked = condition(unknowns, legs)
        values = np.append(_equations(unknowns, legs.ends), picked.value)
        step = np.linalg.lstsq(np.vstack([_jacobian(legs), picked.gradient]), -values, rcond=None)[0]
        unknowns, size = unknowns + step, float(np.abs(step / (1 + np.abs(unknowns))).max())
        if not size < 1:
            break
    raise ValueError("Newton's method finds no periodic orbit there")
