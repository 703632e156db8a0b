"""Circles of methods with a fixed step, and their eigenvalues, from the equations of motion alone.

A method's step is a map of the state in the heading frame. Its circle of a rear rate w is the state s that a step moves
along the family alone, and its eigenvalues are the logarithms of the multipliers over the step,

    S(s) - s = g h t,    lambda = log(eig DS(s)) / h

with t the family's tangent for a rear rate of 1 and g the drift of the rear rate. S is a composition of analytic
functions, so that complex steps give its exact derivative.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

_STEP = 1e-30  # complex step: derivatives are exact to round-off
_MOST = 20  # Newton's iterations
_CONVERGED = 1e-10  # of quadratic convergence: what remains is round-off


@dataclass(frozen=True, eq=False)
class SteppedCircle:
    """A circle of a method with a fixed step.

    Attributes
    ----------
    state : ndarray, shape (n,)
        In the variables of the map.
    drift : float
        Rate at which the rear rate changes [rad/s^2].
    eigenvalues : ndarray, shape (n,), complex
        Of disturbances [1/s].
    """

    state: np.ndarray
    drift: float
    eigenvalues: np.ndarray

    def nearest(self, value: complex) -> complex:
        """Return the eigenvalue nearest to a given one."""
        return complex(self.eigenvalues[np.abs(self.eigenvalues - value).argmin()])


def solve_stepped_circle(
    take_step: Callable[[np.ndarray], np.ndarray], state: np.ndarray, tangent: np.ndarray, place: int, step: float
) -> SteppedCircle:
    """Solve for a method's circle with the rear rate of one of the reference.

    Parameters
    ----------
    take_step : callable
        Maps a complex state (n,) to the state after a step, both in the heading frame.
    state : ndarray, shape (n,)
        Of the reference's circular motion.
    tangent : ndarray, shape (n,)
        Its change along the family for a rear rate of 1.
    place : int
        Index of the rear rate.
    step : float
        [s].

    Returns
    -------
    SteppedCircle

    Raises
    ------
    ValueError
        If Newton's method does not converge.
    """
    unit, drift, size = np.eye(len(state)), 0.0, np.inf
    for _ in range(_MOST):
        ends = np.array([take_step(state + 1j * _STEP * axis) for axis in unit])
        jacobian = np.imag(ends).T / _STEP
        if size < _CONVERGED:
            return SteppedCircle(state, drift, np.log(np.linalg.eigvals(jacobian).astype(complex)) / step)
        matrix = (jacobian - unit) / step
        matrix[:, place] = -tangent  # the drift is unknown in the place of the rear rate
        change = np.linalg.solve(matrix, drift * tangent - (np.real(ends[0]) - state) / step)
        drift += float(change[place])
        change[place] = 0.0
        state, size = state + change, float(np.abs(change).max())
    raise ValueError("Newton's method finds no circle of this method there")
