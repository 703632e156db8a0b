"""Creep of wheels: the slip of a method that leaves out a part of the acceleration of rolling.

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
    """Slip of a ride, and the part of it that the law of creep explains.

    Attributes
    ----------
    time : float
        Time 1 / b that fits b v = J' q' best in the sense of least squares [s].
    share : float
        Share of the mean square of the slip that the law with this b explains, at most 1.
    slip_time : float
        Root mean square of the slip over that of J' q' [s]: what ``time`` is where the law explains all slip.
    """

    time: float
    share: float
    slip_time: float


def measure_creep(trajectory: Trajectory, bicycle: Bicycle, surface: Surface) -> Creep | None:
    """Fit the law of creep to the slip of a ride, of both wheels in both directions.

    J' q' is that of the ride's own coordinates, so that a ride that has drifted from the reference's follows the same
    law.

    Parameters
    ----------
    trajectory : Trajectory
    bicycle : Bicycle
    surface : Surface

    Returns
    -------
    Creep or None
        Of the samples before a fall and from 0.2 s on, when contacts have settled. None where there are none, a wheel
        has no contact, or the ride is straight to half of all digits, so that J' q' is round-off.
    """
    followed = until_fall(evaluate_ride(trajectory, bicycle, surface), bicycle, surface)
    settled = followed.time >= SETTLED_SHARE
    assert followed.slip is not None
    if not settled.any() or not np.isfinite(followed.slip).all():
        return None
    slip = followed.slip[settled]
    try:
        own = contact_acceleration(bicycle, surface, followed.q[settled], followed.qd[settled])
    except ValueError:  # a wheel has no contact
        return None
    # The size of the accelerations whose sum is J' q'.
    size = largest_speed(followed) ** 2 / min(bicycle.rear_wheel_radius, bicycle.front_wheel_radius)
    square, both = float(np.square(own).sum()), float((own * slip).sum())
    if not square > (_STRAIGHT * size) ** 2 * own.size:
        return None
    total = float(np.square(slip).sum())
    return Creep(both / square, both**2 / (square * total) if total > 0 else 0.0, float(np.sqrt(total / square)))


def contact_acceleration(bicycle: Bicycle, surface: Surface, q: np.ndarray, qd: np.ndarray) -> np.ndarray:
    """Compute the acceleration J' q' of both contact points along a trajectory, along the ground's tangents.

    It is the acceleration that a wheel's material has at the contact if all nine coordinates' second derivatives are
    zero. Engines whose velocities are those of joints and of a free rear frame omit the same term. It is not the
    ``acceleration`` of `velodrome.engines.rolling.observe_wheel`, which complements the accelerations of the wheel's
    centre and of its angular velocity and belongs to engines with a free wheel.

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
