"""Steps of the modified Euler method of the paper, as a map of the independent variables.

The method rides in the 24 coordinates, rates and contact parameters. It leaves the constraints by O(h^3) a step, and
nothing brings it back. The map is that of a step from a state on the constraints, as every ride begins.
"""

from __future__ import annotations

import numpy as np

from ..kernels.flow import extract_variables, place_on_ground
from ..kernels.lean import derivative
from ..stability import VARIABLES, independent
from .near_circles import REAR_RATE, family_tangent, linearise_variables
from .shooting import Flow
from .step_map import SteppedCircle, solve_stepped_circle


def step_modified_euler(flow: Flow, variables: np.ndarray, step: float) -> np.ndarray:
    """Return the independent variables (7,), complex, after a step of the modified Euler method."""
    near, function, parameters, c, bicycle = flow.ground
    y, first, second, end = (np.empty(size, complex) for size in (24, 24, 24, len(VARIABLES)))
    if not place_on_ground(variables.astype(complex), near, function, parameters, c, y):
        raise ValueError("the bicycle does not reach the ground there")
    derivative(y, function, parameters, bicycle, first)
    derivative(y + step * first, function, parameters, bicycle, second)
    extract_variables(y + step / 2 * (first + second), end)
    return end


def solve_modified_euler_circle(flow: Flow, q: np.ndarray, qd: np.ndarray, step: float) -> SteppedCircle:
    """Solve for the circle of the modified Euler method at the rear rate of a circular motion q, qd (9,), yaw 0."""
    circle = independent(q, qd)
    tangent = family_tangent(linearise_variables(flow, circle).jacobian)
    return solve_stepped_circle(lambda state: step_modified_euler(flow, state, step), circle, tangent, REAR_RATE, step)
