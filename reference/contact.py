"""Contact points, gaps and slip of both wheels along a trajectory (Xiong et al. 2020, Eqs. 1-7)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .bicycle import Bicycle
from .kernels.observation import observe_states
from .kinematics import constants
from .rim import bicycle_rim_search
from .surface import Surface


@dataclass(frozen=True)
class Observation:
    """Contacts and energies along a trajectory; wheels in the order rear, front.

    Attributes
    ----------
    point, normal : ndarray, shape (n, 2, 3)
        Rim point of closest approach [m] and unit normal of the surface there.
    gap : ndarray, shape (n, 2)
        Signed distance of that point from the surface along the normal [m].
    slip : ndarray, shape (n, 2, 2)
        Lateral and forward material velocity of that point [m/s].
    kinetic_energy, potential_energy : ndarray, shape (n,)
        Energies [J]; the potential energy is zero at z = 0.
    lost : ndarray, shape (n,), bool
        Samples in which a closest approach could not be computed.
    """

    point: np.ndarray
    normal: np.ndarray
    gap: np.ndarray
    slip: np.ndarray
    kinetic_energy: np.ndarray
    potential_energy: np.ndarray
    lost: np.ndarray

    @property
    def found(self) -> bool:
        """False where a closest approach could not be computed in some sample."""
        return not self.lost.any()


def observe(
    bicycle: Bicycle, surface: Surface, q: np.ndarray, qd: np.ndarray, contact: np.ndarray | None = None
) -> Observation:
    """Measure contacts and energies of a trajectory.

    Parameters
    ----------
    bicycle : Bicycle
    surface : Surface
    q, qd : ndarray, shape (n, 9)
        Coordinates and rates.
    contact : ndarray, shape (n, 2, 3), optional
        Contact parameters (xi, eta, rim angle), where an integrator has them. Without them the contact is computed from
        each pose alone, as the point where the rim is deepest.
    """
    n = len(q)
    contacts = np.empty((n, 6)) if contact is None else np.array(contact, float).reshape(n, 6)
    point, normal, gap = np.empty((n, 2, 3)), np.empty((n, 2, 3)), np.empty((n, 2))
    slip, energy, found = np.empty((n, 2, 2)), np.empty((n, 2)), np.empty(n, np.bool_)
    observe_states(
        np.ascontiguousarray(q, float),
        np.ascontiguousarray(qd, float),
        contacts,
        contact is not None,
        bicycle_rim_search(bicycle, surface),
        surface.function.real,
        surface.parameters,
        constants(bicycle),
        point,
        normal,
        gap,
        slip,
        energy,
        found,
    )
    return Observation(point, normal, gap, slip, energy[:, 0].copy(), energy[:, 1].copy(), ~found)
