"""Creep of wheels: their mean slip against the contact's own acceleration on the reference's ride.

A method that prescribes the velocity of a contact at the end of a step, or its acceleration without the part that comes
from the contact's motion along the rim and the ground, omits that part: J' q' in the rolling constraint J q' = 0. The
slip v then follows v' = -b v + J' q' and settles at

    b v = J' q'

with b the rate at which the method brings a slip to zero; 1 / b is the step where this happens within one step. On a
circle of radius R at speed u the size of J' q' is u^2 / R.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...engines.engine import Trajectory
from ...engines.rolling import observe_wheel
from ...reference.bicycle import BODIES, Bicycle
from ...reference.kinematics import angular_velocities, body_positions, body_velocities, rotations
from ...reference.surface import Surface
from .consistency import evaluate_ride
from .metrics import SETTLED_SHARE

_WHEELS = [BODIES.index("rear_wheel"), BODIES.index("front_wheel")]


@dataclass(frozen=True)
class Creep:
    """Mean slip of a ride, and what it is compared with.

    Attributes
    ----------
    slip : float
        Mean magnitude of the slip of both wheels, from 0.2 s on [m/s].
    acceleration : float
        Mean magnitude of the contacts' own acceleration along the ground in the reference's ride, over the same
        samples [m/s^2].
    """

    slip: float
    acceleration: float

    @property
    def time(self) -> float:
        """Time 1 / b of the law b slip = J' q' [s]."""
        return self.slip / self.acceleration


def measure_creep(trajectory: Trajectory, reference: Trajectory, bicycle: Bicycle, surface: Surface) -> Creep | None:
    """Measure the mean slip of a ride and the contacts' own acceleration in the reference's.

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
        None where the ride ends before contacts have settled, a wheel has no contact, or there is no such acceleration,
        as in a straight ride.
    """
    n = min(len(trajectory.time), len(reference.time))
    settled = trajectory.time[:n] >= SETTLED_SHARE
    if not settled.any():
        return None
    slip = evaluate_ride(trajectory, bicycle, surface).slip
    assert slip is not None
    speed = np.linalg.norm(slip[:n][settled], axis=2)
    own = contact_accelerations(bicycle, surface, reference.q[:n][settled], reference.qd[:n][settled])
    found = Creep(float(speed.mean()), float(np.linalg.norm(own, axis=2).mean()))
    return found if np.isfinite(found.slip) and found.acceleration > 0 else None


def contact_accelerations(bicycle: Bicycle, surface: Surface, q: np.ndarray, qd: np.ndarray) -> np.ndarray:
    """Compute the contacts' own acceleration J' q' along the ground.

    Parameters
    ----------
    bicycle : Bicycle
    surface : Surface
    q, qd : ndarray, shape (n, 9)

    Returns
    -------
    ndarray, shape (n, 2, 2)
        Lateral and forward part for each wheel [m/s^2]; nan without a contact.
    """
    radii = np.array([bicycle.rear_wheel_radius, bicycle.front_wheel_radius])
    wheels = observe_wheel(
        surface,
        radii,
        body_positions(bicycle, q)[:, _WHEELS],
        rotations(bicycle, q)[:, _WHEELS][..., 1],
        body_velocities(bicycle, q, qd)[:, _WHEELS],
        angular_velocities(bicycle, q, qd)[:, _WHEELS],
    )
    parts = [np.einsum("nki,nki->nk", wheels.acceleration, axis) for axis in (wheels.lateral, wheels.forward)]
    return np.stack(parts, axis=2)
