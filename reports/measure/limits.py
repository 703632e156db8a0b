"""What round-off, unconverged iterations and a motion's growth allow a gated quantity to move.

The same engine with the same settings repeats its values up to round-off and to what its iterations leave
unconverged; anything beyond is a change of the engine. So no percentage is set by hand: with

    noise = (error of the start + relative error a step may add x steps) x exp(max(growth rate, 0) x duration)

the state may differ by ``noise`` relative to the motion's own sizes, and each quantity by its sensitivity to
the state times that.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...reference.bicycle import Bicycle
from ...reference.kinematics import REAR_ANGLE
from ...reference.stability import eigenvalue_order

# A bounded disturbance |e| <= b over a duration T tilts a least-squares line by 3 b / T at the most.
_SLOPE = 3.0

# The start is a root of equations known to round-off, some 1e-13 of their rows, and their condition is
# the inverse of the Jacobian's least singular value, some 1e2.
START_ERROR = 1e-11
ROUND_OFF = 2.0**-52

# An order that cannot be told from its neighbours says nothing.
_TELLING_ORDER = 0.5


@dataclass(frozen=True)
class Scale:
    """Sizes of a gated ride that turn a relative state error into each quantity's.

    Attributes
    ----------
    radius, speed : float
        Of point D [m, m/s].
    rear_rate : float
        Rear-wheel rate [rad/s].
    growth_rate : float
        Of disturbances [1/s].
    duration : float
        Of the ride that is measured [s].
    gravity : float
        [m/s^2].
    height : float
        Of the rear frame's centre of mass when upright [m].
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
        """Sizes of a ride from its rates (9,) at the start."""
        speed, rear_rate = float(np.hypot(qd[0], qd[1])), float(abs(qd[REAR_ANGLE]))
        return cls(radius, speed, rear_rate, growth_rate, duration, bicycle.gravity, bicycle.rear_frame_z)

    @property
    def turned(self) -> float:
        """What a wheel turns in the ride, or a radian [rad]."""
        return max(1.0, self.rear_rate * self.duration)

    @property
    def rates(self) -> np.ndarray:
        """Sizes of the nine rates, shape (9,)."""
        return np.array([*3 * [self.speed], *6 * [self.rear_rate]])

    def away(self, time: float) -> float:
        """How far an error of the state carries D away in a time [s], in radii: one of the speed all the way."""
        return 1 + self.speed * time / self.radius

    @property
    def falling_rate(self) -> float:
        """Rate at which an inverted pendulum of the bicycle's height leaves the upright [1/s]."""
        return math.sqrt(self.gravity / self.height)


def noise(scale: Scale, step_noise: float, steps: int, fell: bool = False) -> float:
    """Relative error of the state at the end of a ride.

    Parameters
    ----------
    scale : Scale
    step_noise : float
        Relative error that a step may add beyond the method.
    steps : int
        Steps of the ride.
    fell : bool
        Whether the bicycle fell, on which disturbances grow as on a pendulum that falls.
    """
    growth = max(scale.growth_rate, scale.falling_rate if fell else 0.0, 0.0)
    return (START_ERROR + step_noise * steps) * math.exp(growth * scale.duration)


def step_force(scale: Scale, step_noise: float, step: float) -> float:
    """Contact force that the noise of a single step makes, relative to the weight.

    A wheel that is off by the noise times the motion's radius and put right within the step takes the acceleration
    distance / (beta step^2), which contacts show that have not settled yet. Of the stable implicit methods of Newmark's
    family beta is 1/4 or more.

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
    """Limits of the quantities of one ride.

    Parameters
    ----------
    scale : Scale
    noise : float
        Relative error of its state.
    step_force : float
        Contact force that the noise of a single step makes, by `step_force`.
    borders : int
        Borders between pieces of the ground that the wheels cross.

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
        # A share of limits of its own, see `velodrome.reports.measure.consistency`.
        "report_mismatch": 1.0,
        # Forces follow accelerations, whose sensitivity to the state is the square of its fastest rate, the
        # wheels', and which are measured against the weight.
        "contact_force_error": force,
        "settled_force_error": force,
        "rms_force_error": force,
        # The frame comes down at the speed of a fall from its height.
        "fell_at": noise * scale.radius / math.sqrt(2 * scale.gravity * scale.height),
        # Where a step is accepted or not by its error, one may stand at the very tolerance, and so may one at every
        # border, where a high derivative of the ground jumps.
        "steps": 1.0 + borders,
    }


def order_limit(error: float, moves: tuple[float, float]) -> float | None:
    """Limit of an observed order log2(moves[0] / moves[1]).

    Parameters
    ----------
    error : float
        Of each of the three results that the moves are differences of, in their unit.
    moves : tuple of float
        Size of the change by each halving of the step.

    Returns
    -------
    float or None
        None where the moves are so small that no order can be seen.
    """
    if min(moves) <= 0:
        return None
    limit = 2 * error * (1 / moves[0] + 1 / moves[1]) / math.log(2)
    return limit if limit < _TELLING_ORDER else None


def eigenvalue_limits(
    jacobian: np.ndarray, scale: Scale, noise: float, disturbances: np.ndarray, weight: float, interval: float
) -> np.ndarray:
    """Limits of eigenvalues that are measured from the flow, see `velodrome.reports.measure.identify`.

    With M1, M2 the derivatives of the state at T/2 and 3 T/2, Phi = M2 / M1 and lambda = log(w Phi v) / T for left
    and right eigenvectors w and v; so errors d of M1 and M2 move it by w d v (1 + |exp(lambda T)|) |exp(-3/2 lambda
    T)| / T at the most.

    Parameters
    ----------
    jacobian : ndarray, shape (7, 7)
        Reduced Jacobian of the reference.
    scale : Scale
    noise : float
        Relative error of a ride's state.
    disturbances : ndarray, shape (7,)
        By which the independent variables are disturbed.
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
