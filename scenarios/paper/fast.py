"""Circular motions up to infinite speed, where weight has no effect.

Two of the eight rows of `velodrome.reference.kernels.circle` contain accelerations. They are affine in sigma,
A + sigma B, with A from the weight and B from the motion; the other rows do not depend on it. With
sigma = tan(angle) they are

    cos(angle) A + sin(angle) B = 0,

of which rest (angle 0) and infinite speed (angle pi/2) are regular points. Beyond pi/2, as below 0, sigma is
negative and there is no motion.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...reference.bicycle import Bicycle
from ...reference.circular import LEAN, REAR_SPEED, Steady
from ...reference.kernels.curve import CHOSEN
from ...reference.kernels.steady import SIGMA_UNIT
from ...reference.surface import Paraboloid

_ANGLE = 6  # index of sigma, or its angle, among the nine unknowns
_MOST = 40  # largest number of Newton steps
_ITERATIONS = 40  # largest number of steps of the secant method
_SETTLED = 1e-13  # relative step of Newton's method below which only round-off remains
# Round-off of rows of order one is 1e-14. Near a flat bicycle the equations' condition number grows like 1 over the
# lean's distance from pi/2; it amplifies the error of the steps, not that of the rows.
LARGEST_FLAT_RESIDUAL = 1e-11


class FlatExpansion(NamedTuple):
    """The equations at geometry and angle, shape (9,), to first order: rows (8,) and their Jacobian (8, 9).

    The rear wheel's share of the speeds and its gradient (9,) are included.
    """

    rows: np.ndarray
    jacobian: np.ndarray
    rear_speed: float
    gradient: np.ndarray


FlatCondition = Callable[[np.ndarray, FlatExpansion], tuple[float, np.ndarray]]


def with_angle(unknowns: np.ndarray) -> np.ndarray:
    """Return geometry and angle (9,) of a solution (22,)."""
    chosen = unknowns[CHOSEN].copy()
    chosen[_ANGLE] = np.arctan(chosen[_ANGLE])
    return chosen


def squared_rates(chosen: np.ndarray) -> float:
    """Return the sum of the squared yaw and wheel rates [rad^2/s^2]; negative where there is no motion."""
    return float(SIGMA_UNIT * np.tan(chosen[_ANGLE]))


def expand_flat(equations: Steady, chosen: np.ndarray) -> FlatExpansion:
    """Evaluate the equations at geometry and angle, shape (9,)."""
    at = chosen.copy()
    cosine, sine = np.cos(chosen[_ANGLE]), np.sin(chosen[_ANGLE])
    at[_ANGLE] = 0.0
    rest = equations.expand(at)
    at[_ANGLE] = 1.0
    moving = equations.expand(at)
    weight, weight_slope = rest.rows[6:], rest.jacobian[6:]
    inertia, inertia_slope = moving.rows[6:] - weight, moving.jacobian[6:] - weight_slope
    rows, jacobian = rest.rows.copy(), rest.jacobian.copy()
    rows[6:], jacobian[6:] = cosine * weight + sine * inertia, cosine * weight_slope + sine * inertia_slope
    jacobian[:, _ANGLE] = 0.0
    jacobian[6:, _ANGLE] = cosine * inertia - sine * weight
    gradient = moving.basis[REAR_SPEED].copy()
    gradient[_ANGLE] = 0.0
    return FlatExpansion(rows, jacobian, float(moving.full[REAR_SPEED]), gradient)


def pivoting(chosen: np.ndarray, here: FlatExpansion) -> tuple[float, np.ndarray]:
    """Evaluate the condition that the rear wheel stands."""
    return here.rear_speed, here.gradient


def at_lean(lean: float) -> FlatCondition:
    """Make the condition of a given lean [rad]."""
    return lambda chosen, here: (float(chosen[LEAN]) - lean, np.eye(len(chosen))[LEAN])


def at_angle(angle: float) -> FlatCondition:
    """Make the condition of a given angle of the speed [rad]."""
    return lambda chosen, here: (float(chosen[_ANGLE]) - angle, np.eye(len(chosen))[_ANGLE])


def solve_flat(equations: Steady, guess: np.ndarray, condition: FlatCondition) -> np.ndarray:
    """Solve the equations and a condition for geometry and angle, shape (9,), by Newton's method.

    Raises
    ------
    ValueError
        If it does not converge.
    """
    chosen = guess.copy()
    for _ in range(_MOST):
        here = expand_flat(equations, chosen)
        value, gradient = condition(chosen, here)
        matrix = np.vstack([here.jacobian, gradient])
        if not np.all(np.isfinite(matrix)):
            break
        step = np.linalg.solve(matrix, -np.append(here.rows, value))
        size = float(np.abs(step / (1 + np.abs(chosen))).max())
        chosen = chosen + step * min(1.0, 0.3 / size if size > 0 else 1.0)
        if size < _SETTLED:
            break
    left = float(np.abs(expand_flat(equations, chosen).rows).max())
    if not left < LARGEST_FLAT_RESIDUAL:
        raise ValueError(f"no circular motion up to infinite speed is found there: a residual of {left:.1e} is left")
    return chosen


@dataclass(frozen=True)
class FlatEnd:
    """The end of a curve whose lean tends to +-pi/2, followed to a small distance from it.

    Attributes
    ----------
    distance : float
        Distance of the lean from its limit [rad].
    rear_rate : float
        Rear rate at this distance [rad/s].
    radius : float
        Radius of D's circle at this distance [m].
    constant : float
        Squared rear rate times the distance: constant where the rate grows like one over the distance's square root.
    change : float
        Relative change of the constant over the last division of the distance by four.
    """

    distance: float
    rear_rate: float
    radius: float
    constant: float
    change: float


def follow_flat_end(equations: Steady, unknowns: np.ndarray, nearest: float) -> FlatEnd:
    """Follow the flat end (22,) of a curve at fixed leans towards +-pi/2, to a distance of ``nearest`` [rad].

    Raises
    ------
    ValueError
        If the motion is lost on the way.
    """
    chosen, side = with_angle(unknowns), float(np.sign(unknowns[LEAN]))
    distance, rate = float(np.pi / 2 - side * chosen[LEAN]), 0.0
    constants: list[float] = []
    while distance > nearest or len(constants) < 2:
        distance /= 4
        chosen = solve_flat(equations, chosen, at_lean(side * (np.pi / 2 - distance)))
        rate = float(np.sqrt(squared_rates(chosen)) * abs(expand_flat(equations, chosen).rear_speed))
        constants.append(rate**2 * distance)
    change = abs(constants[-1] / constants[-2] - 1)
    return FlatEnd(distance, rate, float(np.hypot(*chosen[:2])), constants[-1], change)


def pivot_at(
    bicycle: Bicycle, start: np.ndarray, alpha: float, towards: float, angle: float
) -> tuple[float, np.ndarray]:
    """Find alpha and motion (9,) where a pivoting motion has a given angle of the speed, by the secant method.

    Parameters
    ----------
    bicycle : Bicycle
    start : ndarray, shape (9,)
        The pivoting motion at ``alpha``.
    alpha, towards : float
        The motion is carried from one to the other, which should be near the solution [1/m].
    angle : float
        Wanted angle: 0 for rest, pi/2 for infinite speed [rad].

    Raises
    ------
    ValueError
        If the motion is lost, or the method does not converge.
    """
    last, here = carry_pivot(bicycle, start, alpha, towards)[-2:]
    for _ in range(_ITERATIONS):
        slope = (here[1][_ANGLE] - last[1][_ANGLE]) / (here[0] - last[0])
        step = (angle - here[1][_ANGLE]) / slope
        shape = float(here[0] + step)
        last, here = here, (shape, solve_flat(Steady(bicycle, Paraboloid(shape)), here[1], pivoting))
        if abs(step) < 1e-13 or here[1][_ANGLE] == last[1][_ANGLE]:
            return here
    raise ValueError(f"no alpha near {towards:g} is found at which the pivoting motion's speed is as wanted")


def carry_pivot(bicycle: Bicycle, start: np.ndarray, alpha: float, towards: float) -> list[tuple[float, np.ndarray]]:
    """Carry a pivoting motion (9,) from one alpha to another in steps of at most 0.01; return alphas and motions."""
    many = max(2, int(np.ceil(abs(towards - alpha) / 0.01)) + 1)
    motions, chosen = [], start
    for shape in np.linspace(alpha, towards, many):
        chosen = solve_flat(Steady(bicycle, Paraboloid(float(shape))), chosen, pivoting)
        motions.append((float(shape), chosen))
    return motions
