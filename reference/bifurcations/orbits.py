"""Periodic orbits of the independent variables: tori on the ground, where a bicycle weaves along its circle.

An orbit of lean amplitude A is solved for by shooting. The start v is at a greatest lean; the unknowns are v (7), the
time to the least lean and the time from there back to the greatest one, and the equations

    lean_rate(0) = 0,    lean_rate(t1) = 0,    lean(0) - lean(t1) = 2 A,    v(t1 + t2) = v(0)

As the energy is conserved, one of the ten equations in nine unknowns is redundant: orbits form one-parameter families,
with an energy that follows from A. Newton's steps are those of least squares. Derivatives are exact (`shooting`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..stability import VARIABLES
from .shooting import Flow, Legs

_LEAN, _LEAN_RATE = VARIABLES.index("lean"), VARIABLES.index("lean_rate")
_MOST = 30  # Newton's iterations
# Step of Newton's method, relative to 1 + |unknown|, after which the next would be round-off: convergence is quadratic.
_CONVERGED = 1e-9
# Residual with twice as many steps at which the number of steps is large enough: round-off of some hundred steps with
# coordinates of ten metres, 1e3 x 10 x 2^-53. An error of the method is 256 times smaller with the steps doubled.
_SETTLED = 1e-12
_MOST_STEPS = 4096


@dataclass(frozen=True, eq=False)
class PeriodicOrbit:
    """A periodic orbit.

    Attributes
    ----------
    lean_amplitude : float
        Half of the peak-to-peak of the lean [rad].
    energy : float
        Kinetic and potential, the latter zero at z = 0 [J].
    period : float
        [s].
    state : ndarray, shape (7,)
        The independent variables at the greatest lean.
    down_time : float
        From the greatest lean to the least [s].
    multipliers : ndarray, shape (7,), complex
        Floquet multipliers, see `floquet_multipliers`.
    invariance : float
        Largest relative deviation of the monodromy matrix from what time and energy ask of it.
    residual : float
        Largest of the equations, with twice as many steps as they were solved with [m, rad, rad/s].
    steps : int
        Number of steps in a period with which the equations were solved.
    """

    lean_amplitude: float
    energy: float
    period: float
    state: np.ndarray
    down_time: float
    multipliers: np.ndarray
    invariance: float
    residual: float
    steps: int

    @property
    def unknowns(self) -> np.ndarray:
        """The unknowns that are solved for, shape (9,)."""
        return np.append(self.state, [self.down_time, self.period - self.down_time])


def solve_orbit(flow: Flow, guess: np.ndarray, amplitude: float, steps: int = 64) -> PeriodicOrbit:
    """Solve for the periodic orbit of a lean amplitude.

    Parameters
    ----------
    flow : Flow
    guess : ndarray, shape (9,)
        See `PeriodicOrbit.unknowns`.
    amplitude : float
        Half of the peak-to-peak of the lean [rad].
    steps : int
        Number of steps in a period to begin with; it is doubled until the result does not depend on it.

    Returns
    -------
    PeriodicOrbit

    Raises
    ------
    ValueError
        If Newton's method does not converge.
    """
    unknowns = _solve(flow, guess, amplitude, steps)
    residual = _residual(flow, unknowns, amplitude, 2 * steps)
    while residual > _SETTLED * (1 + np.abs(unknowns).max()):
        steps *= 2
        if steps > _MOST_STEPS:
            raise ValueError(f"an orbit of lean amplitude {amplitude!r} rad cannot be integrated precisely")
        unknowns = _solve(flow, unknowns, amplitude, steps)
        residual = _residual(flow, unknowns, amplitude, 2 * steps)
    legs, start = _ride(flow, unknowns, steps), unknowns[:7]
    multipliers, invariance = floquet_multipliers(legs.start_derivatives[1], flow.rates(start), legs.energy_gradient)
    return PeriodicOrbit(
        lean_amplitude=amplitude,
        energy=legs.energy,
        period=float(unknowns[7] + unknowns[8]),
        state=start,
        down_time=float(unknowns[7]),
        multipliers=multipliers,
        invariance=invariance,
        residual=residual,
        steps=steps,
    )


def _ride(flow: Flow, unknowns: np.ndarray, steps: int) -> Legs:
    return flow.ride_legs(unknowns[:7], unknowns[7:], np.array([steps // 2, steps // 2]))


def _residual(flow: Flow, unknowns: np.ndarray, amplitude: float, steps: int) -> float:
    ends, _ = flow.ride(unknowns[:7], unknowns[7:], np.array([steps // 2, steps // 2]))
    return float(np.abs(_equations(unknowns, np.real(ends), amplitude)).max())


def _equations(unknowns: np.ndarray, ends: np.ndarray, amplitude: float) -> np.ndarray:
    """Return the ten equations' residuals, shape (10,), from the independent variables after both legs."""
    start = unknowns[:7]
    turns = [start[_LEAN_RATE], ends[0, _LEAN_RATE], start[_LEAN] - ends[0, _LEAN] - 2 * amplitude]
    return np.concatenate([turns, ends[1] - start])


def _jacobian(legs: Legs) -> np.ndarray:
    """Return the derivatives of `_equations` by the unknowns, shape (10, 9)."""
    matrix = np.zeros((10, 9))
    matrix[0, _LEAN_RATE] = 1
    matrix[1, :7], matrix[1, 7:] = legs.start_derivatives[0, _LEAN_RATE], legs.duration_derivatives[0, _LEAN_RATE]
    matrix[2, :7], matrix[2, 7:] = -legs.start_derivatives[0, _LEAN], -legs.duration_derivatives[0, _LEAN]
    matrix[2, _LEAN] += 1
    matrix[3:, :7], matrix[3:, 7:] = legs.start_derivatives[1] - np.eye(7), legs.duration_derivatives[1]
    return matrix


def _solve(flow: Flow, guess: np.ndarray, amplitude: float, steps: int) -> np.ndarray:
    unknowns = guess
    for _ in range(_MOST):
        legs = _ride(flow, unknowns, steps)
        values = _equations(unknowns, legs.ends, amplitude)
        step = np.linalg.lstsq(_jacobian(legs), -values, rcond=None)[0]
        unknowns = unknowns + step
        size = np.abs(step / (1 + np.abs(unknowns))).max()
        if size < _CONVERGED:
            return unknowns
    raise ValueError(f"no periodic orbit of lean amplitude {amplitude!r} rad is found")


def floquet_multipliers(monodromy: np.ndarray, field: np.ndarray, gradient: np.ndarray) -> tuple[np.ndarray, float]:
    """Compute the Floquet multipliers of a periodic orbit of a flow with a conserved energy.

    Two multipliers are 1: the field f is carried into itself, M f = f, and the energy's gradient g is conserved,
    g M = g, with g . f = 0. As the period depends on the energy, they belong to a Jordan block, and their computed
    eigenvalues would be off by the root of round-off. In an orthonormal basis that begins with f and ends with g the
    matrix is block triangular: the first and the last entry of its diagonal are these two multipliers, and the block
    between them has the other five.

    Parameters
    ----------
    monodromy : ndarray, shape (n, n)
        M.
    field, gradient : ndarray, shape (n,)
        f and g at the start.

    Returns
    -------
    multipliers : ndarray, shape (n,), complex
        That of time, that of energy, then the others by decreasing size.
    invariance : float
        Largest entry of the matrix that should be zero, relative to its largest entry.
    """
    basis = np.linalg.qr(np.column_stack([field, gradient]), mode="complete")[0]
    basis = np.column_stack([basis[:, 0], basis[:, 2:], basis[:, 1]])
    turned = basis.T @ monodromy @ basis
    others = np.linalg.eigvals(turned[1:-1, 1:-1])
    others = others[np.argsort(-np.abs(others), kind="stable")]
    lost = np.concatenate([turned[1:, 0], turned[-1, :-1]])
    return np.concatenate([[turned[0, 0], turned[-1, -1]], others]), float(np.abs(lost).max() / np.abs(turned).max())
