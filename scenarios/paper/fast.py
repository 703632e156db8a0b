"""Circular motions up to infinite speed, where weight no longer counts.

Of the eight rows of `velodrome.reference.kernels.circle` two hold accelerations. They are affine in sigma, A + sigma B,
with A from the weight and B from the motion; the others do not depend on it. With sigma = tan(angle) they are

    cos(angle) A + sin(angle) B = 0,

of which rest (angle 0) and infinite speed (angle pi/2) are regular points. Beyond pi/2, as below 0, sigma is
negative: no motion.
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

_ANGLE = 6  # where sigma stands among the nine unknowns
_MOST = 40  # Newton steps
_ITERATIONS = 40  # of the secant method
_SETTLED = 1e-13  # a step of Newton's method, relative: what is left is round-off
# Round-off of rows of order one is 1e-14; near a flat bicycle the equations' condition grows like 1 over the lean's
# distance from pi/2 and multiplies what is left of the steps, not of the rows.
LARGEST_FLAT_RESIDUAL = 1e-11


class FlatExpansion(NamedTuple):
    """The equations at geometry and angle, shape (9,), to first order: rows (8,), their Jacobian (8, 9) in them.

    The rear wheel's share of the speeds and its gradient (9,) come with them.
    """

    rows: np.ndarray
    jacobian: np.ndarray
    rear_speed: float
    gradient: np.ndarray


FlatCondition = Callable[[np.ndarray, FlatExpansion], tuple[float, np.ndarray]]


def with_angle(unknowns: np.ndarray) -> np.ndarray:
    """Geometry and angle (9,) of a solution (22,)."""
    chosen = unknowns[CHOSEN].copy()
    chosen[_ANGLE] = np.arctan(chosen[_ANGLE])
    return chosen


def squared_rates(chosen: np.ndarray) -> float:
    """Sum of the squared yaw and wheel rates [rad^2/s^2]; negative where there is no motion."""
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
    """Condition that the rear wheel stands."""
    return here.rear_speed, here.gradient


def at_lean(lean: float) -> FlatCondition:
    """Condition of a given lean [rad]."""
    return lambda chosen, here: (float(chosen[LEAN]) - lean, np.eye(len(chosen))[LEAN])


def at_angle(angle: float) -> FlatCondition:
    """Condition of a given speed's angle [rad]."""
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
    """The end of a curve whose lean tends to +-pi/2, followed to a distance of it.

    Attributes
    ----------
    distance : float
        Of the lean from its limit [rad].
    rear_rate : float
        There [rad/s].
    radius : float
        Of D's circle there [m].
    constant : float
        Squared rear rate times the distance: constant where the rate grows like one over the distance's root.
    change : float
        Of the constant over the last quartering of the distance, relative.
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
        If it is lost on the way.
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
    """Alpha at which a pivoting motion has a speed's angle, and the motion there (9,), by the secant method.

    Parameters
    ----------
    bicycle : Bicycle
    start : ndarray, shape (9,)
        The pivoting motion at ``alpha``.
    alpha, towards : float
        It is carried from one to the other, which is near the alpha looked for [1/m].
    angle : float
        0 for rest, pi/2 for infinite speed [rad].

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
    """Carry a pivoting motion (9,) from an alpha to another in steps of a hundredth at the most: alphas and motions."""
    many = max(2, int(np.ceil(abs(towards - alpha) / 0.01)) + 1)
    motions, chosen = [], start
    for shape in np.linspace(alpha, towards, many):
        chosen = solve_flat(Steady(bicycle, Paraboloid(float(shape))), chosen, pivoting)
        motions.append((float(shape), chosen))
    return motions
