"""Circular motions next to a given one, in the seven independent variables."""

from __future__ import annotations

import numpy as np

from ..stability import VARIABLES, Linearisation, independent, linearise
from .shooting import Flow

REAR_RATE = VARIABLES.index("rear_rate")
_MOST = 20  # Newton's iterations
_CONVERGED = 1e-9  # of quadratic convergence: what remains is round-off


def state_of_variables(flow: Flow, variables: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return coordinates and rates (9,), at yaw 0, of independent variables (7,) near the flow's state."""
    state = flow.moved_to(variables).near
    return state[:9], state[9:18]


def linearise_variables(flow: Flow, variables: np.ndarray) -> Linearisation:
    """Linearise the reduced equations at independent variables (7,) near the flow's state."""
    equations = flow.equations
    return linearise(equations.bicycle, equations.surface, *state_of_variables(flow, variables), equations.inputs)


def family_tangent(jacobian: np.ndarray) -> np.ndarray:
    """Return the change (7,) of a circle's independent variables along its family, for a rear rate of 1.

    ``jacobian`` (7, 7) is the reduced Jacobian, of which the tangent is the null vector.
    """
    others = np.linalg.lstsq(jacobian[:, :REAR_RATE], -jacobian[:, REAR_RATE], rcond=None)[0]
    return np.append(others, 1.0)


def circle_of_rate(flow: Flow, q: np.ndarray, qd: np.ndarray, rear_rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Return coordinates and rates (9,) of the circular motion of another rear rate, near by on the family.

    Parameters
    ----------
    flow : Flow
    q, qd : ndarray, shape (9,)
        Of a circular motion, at yaw 0.
    rear_rate : float
        [rad/s].

    Raises
    ------
    ValueError
        If Newton's method does not converge.
    """
    variables, size = independent(q, qd), np.inf
    change = rear_rate - variables[REAR_RATE]
    variables = variables + change * family_tangent(linearise_variables(flow, variables).jacobian)
    for _ in range(_MOST):
        if size < _CONVERGED:
            return state_of_variables(flow, variables)
        found = linearise_variables(flow, variables)
        step = np.linalg.lstsq(found.jacobian[:, :REAR_RATE], -found.field, rcond=None)[0]
        variables, size = variables + np.append(step, 0.0), float(np.abs(step).max())
    raise ValueError(f"no circular motion with a rear rate of {rear_rate!r} rad/s is found near by")
