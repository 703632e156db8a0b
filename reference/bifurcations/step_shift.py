"""How a fixed step moves a circle and its eigenvalues, to leading order in the step.

A method that rides the vector field X + h^p X_p has, next to a circle v0 of the reference, circles v0 + h^p v1 of the
same rear rate that drift along their family (of tangent t, with a rear rate of 1),

    J v1 + X_p = g t,    v1 without rear rate

so that an eigenvalue with the left and right eigenvectors l and r, l r = 1, moves by

    h^p l (DX_p + D^2 X v1) r

Where a stable section ends, its real part is zero. Along the family it changes by Re l (D^2 X t) r, the slope, so that
the end moves by -Re(shift) / slope.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..stability import VARIABLES, independent
from .near_circles import REAR_RATE, family_tangent, linearise_variables
from .shooting import Flow
from .taylor import differentiate

# Of the derivatives' stencils, in rad and rad/s, and relative for positions and the rear rate: the error of sixth order
# is 1e-16 / 2 times a seventh derivative, and round-off 1e-13 / 2e-3.
_STENCIL = 2e-3


@dataclass(frozen=True, eq=False)
class StepShift:
    """Change of a circle and of an eigenvalue by a fixed step, over h^p.

    Attributes
    ----------
    eigenvalue : complex
        Change at the same rear rate [1/s].
    drift : float
        Rate at which the rear rate changes [rad/s^2].
    circle : ndarray, shape (7,)
        Change v1 of the circle's independent variables.
    """

    eigenvalue: complex
    drift: float
    circle: np.ndarray


@dataclass(frozen=True, eq=False)
class _Mode:
    """A circle, its Jacobian and the eigenvectors of an eigenvalue."""

    flow: Flow
    circle: np.ndarray
    jacobian: np.ndarray
    left: np.ndarray
    right: np.ndarray

    def change(self, direction: np.ndarray) -> complex:
        """Return the eigenvalue's derivative in a direction (7,)."""
        along = self.differentiate(lambda v: linearise_variables(self.flow, v).jacobian, direction)
        return complex(self.left @ along @ self.right)

    def differentiate(self, function: Callable[[np.ndarray], np.ndarray], direction: np.ndarray) -> np.ndarray:
        """Return a function's derivative at the circle in a direction (7,)."""
        units = np.ones(len(VARIABLES))
        units[:2], units[REAR_RATE] = np.hypot(*self.circle[:2]), abs(self.circle[REAR_RATE])
        size = float(np.abs(direction / units).max())
        if size == 0:
            return np.zeros_like(function(self.circle))
        return size * differentiate(lambda s: function(self.circle + s / size * direction), _STENCIL)


def _find_mode(flow: Flow, q: np.ndarray, qd: np.ndarray, near: complex) -> _Mode:
    circle = independent(q, qd)
    jacobian = linearise_variables(flow, circle).jacobian
    values, vectors = np.linalg.eig(jacobian)
    place = int(np.abs(values - near).argmin())
    return _Mode(flow, circle, jacobian, np.linalg.inv(vectors)[place], vectors[:, place])


def eigenvalue_slope(flow: Flow, q: np.ndarray, qd: np.ndarray, near: complex) -> complex:
    """Return the derivative of an eigenvalue by the rear rate along the family.

    Parameters
    ----------
    flow : Flow
    q, qd : ndarray, shape (9,)
        Of a circular motion, at yaw 0.
    near : complex
        The eigenvalue, simple [1/s].
    """
    mode = _find_mode(flow, q, qd, near)
    return mode.change(family_tangent(mode.jacobian))


def shift_eigenvalue(
    flow: Flow, q: np.ndarray, qd: np.ndarray, near: complex, error: Callable[[np.ndarray], np.ndarray]
) -> StepShift:
    """Compute how the leading error of a method moves a circle and an eigenvalue.

    Parameters
    ----------
    flow : Flow
    q, qd : ndarray, shape (9,)
        Of a circular motion, at yaw 0.
    near : complex
        The eigenvalue, simple [1/s].
    error : callable
        Maps independent variables (7,) to X_p (7,).

    Returns
    -------
    StepShift
    """
    mode = _find_mode(flow, q, qd, near)
    matrix = mode.jacobian.copy()
    matrix[:, REAR_RATE] = -family_tangent(mode.jacobian)  # the drift is unknown in the place of the rear rate
    solution = np.linalg.solve(matrix, -error(mode.circle))
    drift = float(solution[REAR_RATE])
    solution[REAR_RATE] = 0.0
    error_jacobian = np.column_stack([mode.differentiate(error, axis) for axis in np.eye(len(VARIABLES))])
    return StepShift(complex(mode.left @ error_jacobian @ mode.right) + mode.change(solution), drift, solution)
