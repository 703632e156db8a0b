"""Regularity of the equations of motion: whether every motion that the constraints allow has inertia.

The 15 x 15 system of accelerations and contact forces is regular if the six rows of rolling are independent and the
mass matrix, restricted to the three motions that they allow (lean, steer and rolling), is positive definite. Bodies
without inertia therefore do not matter by themselves: a wheel without mass spins as the others roll.
"""

from __future__ import annotations

import numpy as np

from .bicycle import Bicycle
from .dae import consistent_state, contact_parameters, mass_matrix
from .kernels import dynamics as kernel
from .kinematics import FRONT_ANGLE, LEAN, REAR_ANGLE, STEER, constants
from .surface import Plane, Surface

MOTIONS = ("lean", "steer", "rolling")
_WHY = {
    "lean": "every mass stays where it is as the bicycle leans",
    "steer": "neither the front assembly nor what its steering moves has inertia about the steering axis",
    "rolling": "no mass moves as the wheels roll",
}
_UNDETERMINED = 1e-3  # relative round-off of velocities
# A state without any symmetry, for what must hold wherever a bicycle rides [rad].
_SOME_LEAN, _SOME_STEER = 0.3, 0.4


def require_inertia(bicycle: Bicycle, surface: Surface, q: np.ndarray) -> None:
    """Refuse a state in which a motion that the constraints allow has no inertia.

    With N the velocities of the three motions and M the mass matrix, A = N^T M N is compared with
    s_i = (sum_k abs(N_ki) sqrt(M_kk))^2, which bounds the sums that A consists of. A is singular where the smallest
    eigenvalue of A_ij / sqrt(s_i s_j) is below their round-off. That of the products, of nine terms each, and of the
    mass matrix is about 40 operations' and that of N twelve operations' times the condition number of the rolling rows;
    a row of A has three entries. Entries of N below its round-off are zero.

    Parameters
    ----------
    bicycle : Bicycle
    surface : Surface
    q : ndarray, shape (9,)
        Coordinates with both wheels on the ground.

    Raises
    ------
    ValueError
        If the equations are singular. The message names the motion without inertia.
    """
    velocities, error = _find_velocities(bicycle, surface, q)
    if error > _UNDETERMINED:
        return  # rolling does not determine the speeds, which is another fault
    mass = mass_matrix(bicycle, q)
    sizes = np.abs(velocities) @ np.sqrt(np.diag(mass).clip(0))
    sizes = np.where(sizes > 0, sizes, 1.0)
    scaled = velocities @ mass @ velocities.T / np.outer(sizes, sizes)
    values, vectors = np.linalg.eigh(scaled)
    smallest = 3 * (40 * np.finfo(float).eps + error)
    if values[0] > smallest:
        return
    for k, motion in enumerate(MOTIONS):
        if scaled[k, k] <= smallest:
            raise ValueError(f"the equations of motion are singular: {motion} has no inertia: {_WHY[motion]}")
    rates = vectors[:, 0] / sizes
    ratio = " : ".join(f"{rate:.4g}" for rate in rates / rates[np.abs(rates).argmax()] + 0.0)
    raise ValueError(
        "the equations of motion are singular: a combination of lean, steer and rolling has no inertia: with their "
        f"rates in the ratio {ratio}, every mass stays where it is"
    )


def _find_velocities(bicycle: Bicycle, surface: Surface, q: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the velocities (3, 9) of the `MOTIONS` at unit rates, and their round-off relative to their size.

    The third motion is at unit rate of the wheel whose rate determines the other speeds better: a pivoting bicycle has
    no rear rate.
    """
    c, p = constants(bicycle), contact_parameters(bicycle, surface, q)
    rows = np.empty((6, 9))
    kernel.rolling(q, np.zeros(9), p, surface.function.real, surface.parameters, c, rows, np.empty(6), np.empty(6))
    found = []
    for spin in (REAR_ANGLE, FRONT_ANGLE):
        given = [LEAN, STEER, spin]
        solved = [k for k in range(9) if k not in given]
        found.append((float(np.linalg.cond(rows[:, solved])), given, solved))
    condition, given, solved = min(found)
    velocities = np.zeros((3, 9))
    velocities[:, given] = np.eye(3)
    velocities[:, solved] = -np.linalg.lstsq(rows[:, solved], rows[:, given], rcond=None)[0].T
    error = 12 * condition * float(np.finfo(float).eps)
    length = bicycle.wheelbase + bicycle.rear_wheel_radius + bicycle.front_wheel_radius
    sizes = np.array([length] * 3 + [1.0] * 6)  # m/s and rad/s at 1 rad/s
    return np.where(np.abs(velocities) > error * sizes, velocities, 0.0), error


def require_inertia_in_turns(bicycle: Bicycle) -> None:
    """Refuse a bicycle whose equations of motion are singular in turns on the level plane, see `require_inertia`."""
    place = (float(bicycle.reference_point[0]), 0.0)
    try:
        q, _ = consistent_state(bicycle, Plane(), place, _SOME_LEAN, _SOME_STEER, (0.0, 0.0, 1.0))
    except ValueError:
        return  # a bicycle that cannot stand there may ride elsewhere
    require_inertia(bicycle, Plane(), q)


def require_inertia_upright(bicycle: Bicycle) -> None:
    """Refuse a bicycle whose equations of motion are singular where it runs upright, see `require_inertia`."""
    place = (float(bicycle.reference_point[0]), 0.0)
    require_inertia(bicycle, Plane(), consistent_state(bicycle, Plane(), place, 0.0, 0.0, (0.0, 0.0, 1.0))[0])
