"""Creep of wheels: their mean slip against the acceleration that rolling needs in the reference's ride.

The derivative of the rolling constraint J q' = 0 is J q'' + J' q' = 0. A method that prescribes the velocity of a
contact at the end of a step with the Jacobian of its start, or J q'' alone, omits J' q'. The slip v then follows
v' = -b v + J' q' and settles at

    b v = J' q'

with b the rate at which the method brings a slip to zero; 1 / b is the step where this happens within one step. On a
circle of radius R at speed u the size of J' q' is u^2 / R.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...engines.engine import Trajectory
from ...reference.bicycle import Bicycle
from ...reference.dae import contact_parameters
from ...reference.kernels import contact, dynamics
from ...reference.kinematics import constants
from ...reference.surface import Surface
from .consistency import evaluate_ride, largest_speed
from .fall import until_fall
from .metrics import SETTLED_SHARE

_STRAIGHT = 2.0**-26  # half of the digits: smaller shares of an acceleration than this are those of a straight ride


@dataclass(frozen=True)
class Creep:
    """Mean slip of a ride, and what it is compared with.

    Attributes
    ----------
    slip : float
        Mean magnitude of the slip of both wheels, from 0.2 s on [m/s].
    acceleration : float
        Mean magnitude of J' q' along the ground in the reference's ride, over the same samples [m/s^2].
    """

    slip: float
    acceleration: float

    @property
    def time(self) -> float:
        """Time 1 / b of the law b slip = J' q' [s]."""
        return self.slip / self.acceleration


def measure_creep(trajectory: Trajectory, reference: Trajectory, bicycle: Bicycle, surface: Surface) -> Creep | None:
    """Measure the mean slip of a ride, and J' q' in the reference's.

    Parameters
    ----------
    trajectory : Trajectory
    reference : Trajectory
        Sampled at the same times, at least as long.
    bicycle : Bicycle
    surface : Surface

    Returns
    -------
    Creep or None
        Of the samples before either falls. None where there are none after contacts have settled, a wheel has no
        contact, or the ride is straight to half of all digits, so that J' q' is round-off.
    """
    followed = until_fall(evaluate_ride(trajectory, bicycle, surface), bicycle, surface)
    reference = until_fall(reference, bicycle, surface)
    n = min(len(followed.time), len(reference.time))
    settled = followed.time[:n] >= SETTLED_SHARE
    if not settled.any():
        return None
    assert followed.slip is not None
    speed = np.linalg.norm(followed.slip[:n][settled], axis=2)
    own = contact_acceleration(bicycle, surface, reference.q[:n][settled], reference.qd[:n][settled])
    found = Creep(float(speed.mean()), float(np.linalg.norm(own, axis=2).mean()))
    # The size of the accelerations whose sum is J' q'.
    size = largest_speed(reference) ** 2 / min(bicycle.rear_wheel_radius, bicycle.front_wheel_radius)
    return found if np.isfinite(found.slip) and found.acceleration > _STRAIGHT * size else None


def contact_acceleration(bicycle: Bicycle, surface: Surface, q: np.ndarray, qd: np.ndarray) -> np.ndarray:
    """Compute the acceleration J' q' of both contact points along a trajectory, along the ground's tangents.

    It is the acceleration that a wheel's material has at the contact if all nine coordinates' second derivatives are
    zero. Engines whose velocities are those of joints and of a free rear frame omit the same term.

    Parameters
    ----------
    bicycle : Bicycle
    surface : Surface
    q, qd : ndarray, shape (n, 9)
        Coordinates and rates.

    Returns
    -------
    ndarray, shape (n, 2, 2)
        Lateral and forward part for each wheel [m/s^2].

    Raises
    ------
    ValueError
        If a wheel has no contact point.
    """
    c, function, parameters = constants(bicycle), surface.function.real, surface.parameters
    out = np.empty((len(q), 2, 2))
    jacobian, gamma, rate = np.empty((6, 9)), np.empty(6), np.empty(6)
    for n in range(len(q)):
        p = contact_parameters(bicycle, surface, q[n])
        dynamics.rolling(q[n], qd[n], p, function, parameters, c, jacobian, gamma, rate)
        for k, (centre, x, axle, z, radius) in enumerate(dynamics.wheels(q[n], c)):
            xi, eta, angle = p[3 * k : 3 * k + 3]
            here = contact.equations(centre, x, z, radius, xi, eta, angle, function, parameters)
            out[n, k] = [axis @ gamma[3 * k : 3 * k + 3] for axis in contact.tangents(axle, here.normal)]
    return out
