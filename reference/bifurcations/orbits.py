"""Periodic orbits of the independent variables: tori on the ground, where a bicycle weaves along its circle.

An orbit is solved for by multiple shooting. Its start is at a greatest lean; t1 is the time to the least lean and t2
that from there back to the greatest one. Each is divided into m / 2 legs of equal duration, so that disturbances grow
by little in a leg. The unknowns are the states v_0 ... v_(m-1) at the starts of the legs (7 each), t1 and t2, and the
equations

    lean_rate(v_0) = 0,    lean_rate(v_(m/2)) = 0,    v_i after its leg = v_(i+1),    v_m = v_0

As the energy is conserved, one of the 7 m + 2 is redundant: orbits form one-parameter families, and a further condition
picks one, such as its lean amplitude A = (lean_0 - lean_(m/2)) / 2. Newton's steps are those of least squares, with
exact derivatives (`shooting`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..stability import VARIABLES
from .floquet import floquet_multipliers
from .shooting import Flow, Legs, ride_legs

SIZE = len(VARIABLES)  # of a state

_LEAN, _LEAN_RATE = VARIABLES.index("lean"), VARIABLES.index("lean_rate")
_MOST = 20  # Newton's iterations
# Step of Newton's method, relative to 1 + |unknown|, after which the next would be round-off: convergence is quadratic.
_CONVERGED = 1e-9
# Residual with twice as many steps, relative to the largest unknown, at which their number is large enough: round-off
# of some thousand additions. An error of the method is 256 times smaller with the steps doubled.
_SETTLED = 1e-12
_FEWEST_STEPS, _MOST_STEPS = 64, 4096  # 64 are enough for small orbits about circles of a usual speed


class Picked(NamedTuple):
    """One more equation, value = 0, that picks an orbit of a branch: its value and gradient, as many as unknowns."""

    value: float
    gradient: np.ndarray


OrbitCondition = Callable[[np.ndarray, Legs], Picked]


@dataclass(frozen=True, eq=False)
class PeriodicOrbit:
    """A periodic orbit.

    Attributes
    ----------
    unknowns : ndarray, shape (7 m + 2,)
        The independent variables at the starts of the m legs, the first at the greatest lean, and the times t1 and t2.
    lean_amplitude : float
        Half of the peak-to-peak of the lean [rad].
    energy : float
        Kinetic and potential, the latter zero at z = 0 [J].
    multipliers : ndarray, shape (7,), complex
        Floquet multipliers, see `velodrome.reference.bifurcations.floquet`.
    invariance : float
        Deviation of the legs' matrices from what time and energy ask of them, see there.
    residual : float
        Largest of the equations, with twice as many steps as they were solved with [m, rad, rad/s].
    steps : int
        Number of steps in a period with which the equations were solved.
    tangent : ndarray, shape (7 m + 2,)
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
        return self.unknowns[:SIZE]

    @property
    def states(self) -> np.ndarray:
        """Those at the starts of all legs, shape (m, 7)."""
        return _split(self.unknowns)[0]

    @property
    def durations(self) -> np.ndarray:
        """Durations of the legs, shape (m,) [s]."""
        return _split(self.unknowns)[1]

    @property
    def period(self) -> float:
        """Period [s]."""
        return float(self.unknowns[-2:].sum())

    @property
    def growth(self) -> float:
        """Size of the largest multiplier but those of time and energy: the orbit is stable below 1."""
        return float(np.abs(self.multipliers[2:]).max())


def _split(unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the states at the starts of the legs (m, 7) and the durations of the legs (m,)."""
    states = unknowns[:-2].reshape(-1, SIZE)
    half = len(states) // 2
    return states, np.repeat(unknowns[-2:] / half, half)


def arc_metric(unknowns: np.ndarray) -> np.ndarray:
    """Return the diagonal (7 m + 2,) of the metric of steps along a branch: large unknowns count relatively.

    States other than the first do not count: they follow from it, and their number is no property of the branch.
    """
    weights = np.zeros(len(unknowns))
    weights[:SIZE] = 1
    weights[:2] = 1 / (1 + np.hypot(unknowns[0], unknowns[1])) ** 2
    weights[SIZE - 1] = 1 / (1 + np.abs(unknowns[SIZE - 1])) ** 2
    weights[-2:] = 1 / (1 + np.abs(unknowns[-2:])) ** 2
    return weights


def amplitude_condition(amplitude: float) -> OrbitCondition:
    """Make the condition of a given lean amplitude [rad]."""

    def condition(unknowns: np.ndarray, _: Legs) -> Picked:
        gradient = _amplitude_gradient(len(unknowns))
        return Picked(float(gradient @ unknowns) - amplitude, gradient)

    return condition


def _amplitude_gradient(count: int) -> np.ndarray:
    """Return the derivatives of the lean amplitude by a number of unknowns, of which it is a linear function."""
    gradient = np.zeros(count)
    gradient[_LEAN], gradient[(count - 2) // 2 + _LEAN] = 0.5, -0.5
    return gradient


def energy_condition(energy: float) -> OrbitCondition:
    """Make the condition of a given energy [J]."""

    def condition(unknowns: np.ndarray, legs: Legs) -> Picked:
        # In units of the energy, so that the condition is of order one as the equations are.
        gradient = np.zeros(len(unknowns))
        gradient[:SIZE] = legs.energy_gradients[0] / energy
        return Picked(float(legs.energies[0] - energy) / energy, gradient)

    return condition


def orbit_plane_condition(start: np.ndarray, covector: np.ndarray, distance: float) -> OrbitCondition:
    """Make the condition of pseudo-arclength: ``distance`` from the unknowns ``start`` along a covector."""
    return lambda unknowns, _: Picked(float(covector @ (unknowns - start)) - distance, covector)


def solve_orbit(
    flow: Flow, guess: np.ndarray, condition: OrbitCondition, steps: int = _FEWEST_STEPS, most: int = _MOST
) -> PeriodicOrbit:
    """Solve for a periodic orbit.

    Parameters
    ----------
    flow : Flow
        Near the orbit.
    guess : ndarray, shape (7 m + 2,)
        See `PeriodicOrbit.unknowns`; m, the number of legs, is even.
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
    flows = [flow.moved_to(state) for state in _split(guess)[0]]
    unknowns, legs = _solve(flows, guess, condition, steps, most)
    residual = _residual(flows, unknowns, 2 * steps)
    while residual > _SETTLED * (1 + np.abs(unknowns).max()):
        steps *= 2
        if steps > _MOST_STEPS:
            raise ValueError("the orbit cannot be integrated precisely")
        unknowns, legs = _solve(flows, unknowns, condition, steps, most)
        residual = _residual(flows, unknowns, 2 * steps)
    along = np.linalg.svd(_jacobian(legs))[2][-1]
    along = along / np.sqrt(along @ (arc_metric(unknowns) * along))
    fields = np.array([near.rates(state) for near, state in zip(flows, _split(unknowns)[0], strict=True)])
    multipliers, invariance = floquet_multipliers(legs.start_derivatives, fields, legs.energy_gradients)
    by_amplitude = _amplitude_gradient(len(unknowns))
    return PeriodicOrbit(
        unknowns=unknowns,
        lean_amplitude=float(by_amplitude @ unknowns),
        energy=float(legs.energies[0]),
        multipliers=multipliers,
        invariance=invariance,
        residual=residual,
        steps=steps,
        tangent=along,
        energy_slope=float(legs.energy_gradients[0] @ along[:SIZE]),
        amplitude_slope=float(by_amplitude @ along),
    )


def find_monodromy(flow: Flow, orbit: PeriodicOrbit) -> np.ndarray:
    """Return the derivative (7, 7) of the state after a period of an orbit by that at its start.

    A product of the legs' derivatives: what is small beside its largest entry is round-off.
    """
    states = orbit.states
    flows = [flow.moved_to(state) for state in states]
    legs = ride_legs(flows, states, orbit.durations, _steps_of_leg(orbit.steps, len(states)))
    return np.linalg.multi_dot(legs.start_derivatives[::-1])


def _residual(flows: Sequence[Flow], unknowns: np.ndarray, steps: int) -> float:
    states, durations = _split(unknowns)
    number, ends = np.array([_steps_of_leg(steps, len(states))]), np.empty(states.shape)
    for i, flow in enumerate(flows):
        ends[i] = np.real(flow.ride(states[i], durations[i : i + 1], number)[0][0])
    return float(np.abs(_equations(states, ends)).max())


def _steps_of_leg(steps: int, legs: int) -> int:
    """Return the number of steps of each leg, at least ``steps`` in a period."""
    return -(-steps // legs)


def _equations(states: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Return the residuals (7 m + 2,) from the states (m, 7) at the starts of the legs and those at their ends."""
    turning = states[[0, len(states) // 2], _LEAN_RATE]
    return np.concatenate([turning, (ends - np.roll(states, -1, axis=0)).ravel()])


def _jacobian(legs: Legs) -> np.ndarray:
    """Return the derivatives of `_equations` by the unknowns, shape (7 m + 2, 7 m + 2), of rank one less."""
    count = len(legs.ends)
    half = count // 2
    matrix = np.zeros((SIZE * count + 2, SIZE * count + 2))
    matrix[0, _LEAN_RATE] = matrix[1, SIZE * half + _LEAN_RATE] = 1
    for i in range(count):
        rows, after = slice(2 + SIZE * i, 2 + SIZE * (i + 1)), (i + 1) % count
        matrix[rows, SIZE * i : SIZE * (i + 1)] = legs.start_derivatives[i]
        matrix[rows, SIZE * after : SIZE * (after + 1)] -= np.eye(SIZE)
        matrix[rows, SIZE * count + i // half] = legs.duration_derivatives[i] / half
    return matrix


def _solve(
    flows: Sequence[Flow], guess: np.ndarray, condition: OrbitCondition, steps: int, most: int
) -> tuple[np.ndarray, Legs]:
    """Solve the equations and a condition with a number of steps; return the unknowns and the ride from them."""
    unknowns, size = guess, np.inf
    for _ in range(most):
        states, durations = _split(unknowns)
        legs = ride_legs(flows, states, durations, _steps_of_leg(steps, len(states)))
        if size < _CONVERGED:
            return unknowns, legs
        picked = condition(unknowns, legs)
        values = np.append(_equations(states, legs.ends), picked.value)
        step = np.linalg.lstsq(np.vstack([_jacobian(legs), picked.gradient]), -values, rcond=None)[0]
        unknowns, size = unknowns + step, float(np.abs(step / (1 + np.abs(unknowns))).max())
        if not size < 1:
            break
    raise ValueError("Newton's method finds no periodic orbit there")
