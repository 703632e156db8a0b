"""The creep of MuJoCo's contacts, and the acceleration that it comes from.

MuJoCo's contact rows ask for J q'' = -b J q' and leave out J' q', the acceleration that the contact point of
a rolling wheel has at zero slip. So the slip v = J q' changes at J q'' + J' q' = -b v + J' q', and settles at

    slip = J' q' / b,    b = 2 / (largest impedance * time constant)

On a circle of radius R at speed v its size is (v^2 / R) / b, whatever the friction.
"""

from __future__ import annotations

import numpy as np

from reference.bicycle import Bicycle
from reference.dae import contact_parameters
from reference.kernels import contact
from reference.kernels import dynamics as kernel
from reference.kinematics import constants
from reference.surface import Surface


def contact_acceleration(bicycle: Bicycle, surface: Surface, q: np.ndarray, qd: np.ndarray) -> np.ndarray:
    """Acceleration J' q' of both contact points along a trajectory, as the ground's tangents see it.

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
        kernel.rolling(q[n], qd[n], p, function, parameters, c, jacobian, gamma, rate)
        for k, (centre, x, axle, z, radius) in enumerate(kernel.wheels(q[n], c)):
            xi, eta, angle = p[3 * k : 3 * k + 3]
            here = contact.equations(centre, x, z, radius, xi, eta, angle, function, parameters)
            out[n, k] = [axis @ gamma[3 * k : 3 * k + 3] for axis in contact.tangents(axle, here.normal)]
    return out
