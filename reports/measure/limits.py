"""Limits of the changes of gated quantities, derived from round-off, unconverged iterations and a motion's growth.

The same engine with the same settings repeats its values up to round-off and to what its iterations leave
unconverged; any larger difference is a change of the engine. So no percentage is set by hand: with

    noise = (error of the start + relative error a step may add x steps) x exp(max(growth rate, 0) x duration)

the state may differ by ``noise`` relative to the motion's own sizes, and each quantity by this times its sensitivity
to the state.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...reference.bicycle import Bicycle
from ...reference.kinematics import REAR_ANGLE
from ...reference.stability import eigenvalue_order

# A disturbance bounded by b over a duration T changes the slope of a least-squares line by at most 3 b / T.
_SLOPE = 3.0

# The start is a root of equations that is found up to round-off, some 1e-13 of their rows. Their condition number is
# the inverse of the Jacobian's least singular value, some 1e2.
START_ERROR = 1e-11
ROUND_OFF = 2.0**-52

# An order with a larger uncertainty than this cannot be told from its neighbours.
LARGEST_ORDER_LIMIT = 0.5


@dataclass(frozen=True)
class Scale:
    """Sizes of a gated ride that convert a relative state error to the error of each quantity.

    Attributes
    ----------
    radius, speed : float
        Of point D [m, m/s].
    rear_rate : float
        Rear-wheel rate [rad/s].
    growth_rate : float
        Growth rate of disturbances [1/s].
    duration : float
        Duration of the measured part of the ride [s].
    gravity : float
        [m/s^2].
    height : float
        Upright height of the rear frame's centre of mass [m].
    """

    radius: float
    speed: float
    rear_rate: float
    growth_rate: float
    duration: float
    gravity: float
    height: float

    @classmethod
    def of(cls, bicycle: Bicycle, qd: np.ndarray, radius: float, growth_rate: float, duration: float) -> Scale:
        """Return the sizes of a ride from its rates (9,) at the start."""
        speed, rear_rate = float(np.hypot(qd[0], qd[1])), float(abs(qd[REAR_ANGLE]))
        return cls(radius, speed, rear_rate, growth_rate, duration, bicycle.gravity, bicycle.rear_frame_z)

    @property
    def turned(self) -> float:
        """Angle by which a wheel turns in the ride, at least a radian [rad]."""
        return max(1.0, self.rear_rate * self.duration)

    @property
    def rates(self) -> np.ndarray:
        """Sizes of the nine rates, shape (9,) [m/s, rad/s]."""
        return np.array([*3 * [self.speed], *6 * [self.rear_rate]])

    def away(self, time: float) -> float:
        """Return by how many radii a relative error of the state, taken as one of the speed, moves D in a time [s]."""
        return 1 + self.speed * time / self.radius

    @property
    def falling_rate(self) -> float:
        """Rate at which an inverted pendulum of the bicycle's height leaves the upright [1/s]."""
        return math.sqrt(self.gravity / self.height)


def noise(scale: Scale, step_noise: float, steps: int, fell: bool = False) -> float:
    """Return the relative error of the state at the end of a ride.

    Parameters
    ----------
    scale : Scale
    step_noise : float
        Relative error that a step may add beyond the method.
    steps : int
        Steps of the ride.
    fell : bool
        Whether the bicycle fell, where disturbances grow as on a falling pendulum.
    """
    growth = max(scale.growth_rate, scale.falling_rate if fell else 0.0, 0.0)
    return (START_ERROR + step_noise * steps) * math.exp(growth * scale.duration)


def step_force(scale: Scale, step_noise: float, step: float) -> float:
    """Return the contact force due to the noise of a single step, relative to the weight.

    A wheel displaced by the noise times the motion's radius and corrected within the step has the acceleration
    distance / (beta step^2). Contacts that have not settled yet show this force. The stable implicit methods of
    Newmark's family have a beta of 1/4 or more.

    Parameters
    ----------
    scale : Scale
    step_noise : float
        Relative error that a step may add beyond the method.
    step : float
        [s].
    """
    return 4 * step_noise * scale.radius / (scale.gravity * step**2)


def ride_limits(scale: Scale, noise: float, step_force: float = 0.0, borders: int = 0) -> dict[str, float]:
    """Return the limits of the quantities of one ride.

    Parameters
    ----------
    scale : Scale
    noise : float
        Relative error of the state.
    step_force : float
        Contact force due to the noise of a single step, from `step_force`.
    borders : int
        Number of borders between pieces of the ground that the wheels cross.

    Returns
    -------
    dict
        Limit by quantity, in the quantity's unit.
    """
    away = scale.away(scale.duration)
    force = noise * scale.rear_rate**2 * scale.radius / scale.gravity + step_force
    return {
        "short_error": noise * scale.radius * away,
        "position_error": noise * scale.radius * away,
        "state_error": noise * away,
        "radius_drift_rate": _SLOPE * noise * scale.radius / scale.duration,
        "phase_drift_rate": _SLOPE * noise / scale.duration,
        "rear_rate_drift_rate": _SLOPE * noise * scale.rear_rate / scale.duration,
        # Energy is quadratic in the speeds.
        "energy_drift": 2 * noise,
        "max_gap": noise * scale.radius,
        "max_slip": noise * scale.speed,
        "mean_slip": noise * scale.speed,
        # Already relative to limits of its own, see `velodrome.reports.measure.consistency`.
        "report_mismatch": 1.0,
        # Forces follow accelerations, whose sensitivity to the state is the square of its fastest rate, that of the
        # wheels, and are relative to the weight.
        "contact_force_error": force,
        "settled_force_error": force,
        "rms_force_error": force,
        # The frame reaches the ground at the speed of a fall from its height.
        "fell_at": noise * scale.radius / math.sqrt(2 * scale.gravity * scale.height),
        # Where the error decides whether a step is accepted, one step may lie exactly at the tolerance, and so may one
        # at every border, where a high derivative of the ground jumps.
        "steps": 1.0 + borders,
    }


def order_limit(error: float, moves: tuple[float, float]) -> float | None:
    """Return the limit of an observed order log2(moves[0] / moves[1]).

    Parameters
    ----------
    error : float
        Error of each of the three results whose differences are the moves, in their unit.
    moves : tuple of float
        Size of the change by each halving of the step.

    Returns
    -------
    float or None
        None where the changes are too small to show an order.
    """
    if min(moves) <= 0:
        return None
    limit = 2 * error * (1 / moves[0] + 1 / moves[1]) / math.log(2)
    return limit if limit < LARGEST_ORDER_LIMIT else None


def eigenvalue_limits(
    jacobian: np.ndarray, scale: Scale, noise: float, disturbances: np.ndarray, weight: float, interval: float
) -> np.ndarray:
    """Return the limits of eigenvalues that are measured from the flow, see `velodrome.reports.measure.identify`.

    With M1, M2 the derivatives of the state at T/2 and 3 T/2, Phi = M2 / M1 and lambda = log(w Phi v) / T for left
    and right eigenvectors w and v. Errors d of M1 and M2 therefore change lambda by at most
    w d v (1 + |exp(lambda T)|) |exp(-3/2 lambda T)| / T.

    Parameters
    ----------
    jacobian : ndarray, shape (7, 7)
        Reduced Jacobian of the reference.
    scale : Scale
    noise : float
        Relative error of a ride's state.
    disturbances : ndarray, shape (7,)
        Disturbances of the independent variables.
    weight : float
        Sum of the absolute weights of the difference formula.
    interval : float
        T [s].

    Returns
    -------
    ndarray, shape (7,)
        [1/s], in the order of `velodrome.reference.stability.eigenvalue_order`.
    """
    sizes = np.array([scale.radius, scale.radius, 1, 1, *3 * [scale.rear_rate]])
    derivative = noise * weight * sizes[:, None] / disturbances
    eigenvalues, right = np.linalg.eig(jacobian)
    left = np.linalg.inv(right)
    moved = np.einsum("ij,jk,ki->i", np.abs(left), derivative, np.abs(right))
    factor = np.exp(np.real(eigenvalues) * interval)
    limits = moved * (1 + factor) * factor**-1.5 / interval
    return limits[eigenvalue_order(eigenvalues)]
