"""Properties of circular motions along a curve: rates, energy, forces and stability of many at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .circular import LEAN, PITCH, STEER, Steady
from .kernels import curve as kernel
from .kinematics import constants
from .stability import growth_rates, sorted_eigenvalues


@dataclass(frozen=True)
class Samples:
    """Properties of n circular motions, all run so that the rear wheel rolls forward.

    Attributes
    ----------
    yaw_rate, rear_rate, front_rate : ndarray, shape (n,)
        [rad/s].
    lean, steer, pitch : ndarray, shape (n,)
        [rad].
    radius : ndarray, shape (n,)
        Distance of D from the axis [m].
    energy : ndarray, shape (n,)
        Kinetic plus potential energy [J].
    normal_force : ndarray, shape (n, 2)
        Normal force of the ground on the rear and the front wheel [N].
    eigenvalues : ndarray, shape (n, 7), complex
        In the order of `velodrome.reference.stability.eigenvalue_order` [1/s].
    growth_rate : ndarray, shape (n,)
        Largest real part among those that symmetry does not fix [1/s].
    """

    yaw_rate: np.ndarray
    rear_rate: np.ndarray
    front_rate: np.ndarray
    lean: np.ndarray
    steer: np.ndarray
    pitch: np.ndarray
    radius: np.ndarray
    energy: np.ndarray
    normal_force: np.ndarray
    eigenvalues: np.ndarray
    growth_rate: np.ndarray

    @property
    def stable(self) -> np.ndarray:
        """Whether each motion is Lyapunov stable, shape (n,)."""
        return self.growth_rate < 0

    @property
    def pushed(self) -> np.ndarray:
        """Whether the ground pushes on both wheels, shape (n,)."""
        return np.all(self.normal_force > 0, axis=1)


def sample_curve(equations: Steady, unknowns: np.ndarray) -> Samples:
    """Evaluate circular motions.

    Parameters
    ----------
    equations : Steady
    unknowns : ndarray, shape (n, 22)
        Solutions, see `velodrome.reference.kernels.steady`.

    Returns
    -------
    Samples

    Raises
    ------
    ValueError
        If a motion cannot be linearised.
    """
    u = np.ascontiguousarray(unknowns, float)
    jacobians, seen = np.empty((len(u), 7, 7)), np.empty((len(u), 6))
    kernel.sample(u, *equations.where, constants(equations.bicycle), jacobians, seen)
    if not np.all(np.isfinite(jacobians)):
        lost = u[np.flatnonzero(~np.isfinite(jacobians).all(axis=(1, 2)))[0]]
        raise ValueError(f"the motion cannot be linearised at lean = {lost[LEAN]!r}, steer = {lost[STEER]!r}")
    yaw_rate, rear_rate, front_rate = seen[:, :3].T
    eigenvalues = sorted_eigenvalues(jacobians)
    return Samples(
        yaw_rate=yaw_rate,
        rear_rate=rear_rate,
        front_rate=front_rate,
        lean=u[:, LEAN],
        steer=u[:, STEER],
        pitch=u[:, PITCH],
        radius=np.hypot(u[:, 0], u[:, 1]),
        energy=seen[:, 3],
        normal_force=seen[:, 4:],
        eigenvalues=eigenvalues,
        growth_rate=growth_rates(equations.surface, eigenvalues, yaw_rate),
    )
