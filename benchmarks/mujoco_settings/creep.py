"""The creep of MuJoCo's contacts, and the acceleration that causes it.

MuJoCo's contact rows demand J q'' = -b J q' and omit J' q', the acceleration that the contact point of
a rolling wheel has at zero slip. The slip v = J q' therefore changes by J q'' + J' q' = -b v + J' q', and settles at

    slip = J' q' / b,    b = 2 / (largest impedance * time constant)

On a circle of radius R at speed v its magnitude is (v^2 / R) / b, whatever the friction. Two corrections make
the law accurate to a few per cent at any setting:

- Rows are soft. A force F on a row with MuJoCo's softness R (efc_R) adds R F / b:

      slip = (J' q' - R F) / b,    R = w (1 - d) / d / impratio,    0.9 <= d <= 0.95 at MuJoCo's impedances

    w is the inverse weight that MuJoCo gives the wheel's body. Like the law itself, this is proportional to 1 / b: at
    impratio 1 it adds 14 to 24 % on a tight circle of the plane, at 100 a hundredth of that.
  - Wheels sink in. MuJoCo places the contact half the depth inside the wheel, and the rows use the velocity of that
    point; the velocity of the rim differs by w_wheel x (n gap / 2), about spin * gap / 2 forward. The depth is
    proportional to 1 / b^2, so this is the law's next power of 1 / b.
"""

from __future__ import annotations

import numpy as np

from velodrome.engines.engine import Problem, Trajectory
from velodrome.engines.mujoco.settings import ContactSettings
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.contact import observe
from velodrome.reference.kernels import contact
from velodrome.reference.kernels import dynamics as kernel
from velodrome.reference.kinematics import angular_velocities, constants
from velodrome.reports.measure import contact_acceleration


def impedance(depth: np.ndarray, shape: tuple[float, float, float, float, float]) -> np.ndarray:
    """Compute MuJoCo's impedance at depths [m], any shape, from the smallest to the largest over a width (solimp)."""
    least, largest, width, middle, power = shape
    x = np.clip(depth / width, 0.0, 1.0)
    rising = x**power / middle ** (power - 1) if middle > 0 else np.ones_like(x)
    falling = 1 - (1 - x) ** power / (1 - middle) ** (power - 1) if middle < 1 else np.zeros_like(x)
    return least + (largest - least) * np.where(x <= middle, rising, falling)


def settled_slip(
    problem: Problem, trajectory: Trajectory, settings: ContactSettings, weights: tuple[float, float]
) -> np.ndarray:
    """Compute the slip of both rims by the whole law: missing acceleration, softness and sinking.

    Parameters
    ----------
    problem : Problem
    trajectory : Trajectory
        Must have contact forces and gaps.
    settings : ContactSettings
        Must have the elliptic cone; the pyramid's rows are not along the tangents.
    weights : tuple of float
        MuJoCo's inverse weight of each wheel's body, ``body_invweight0`` [1/kg].

    Returns
    -------
    ndarray, shape (n, 2, 2)
        Lateral and forward [m/s].
    """
    bicycle, surface, q, qd = problem.bicycle, problem.surface, trajectory.q, trajectory.qd
    assert trajectory.contact_force is not None
    assert trajectory.gap is not None
    d = impedance(np.abs(trajectory.gap), settings.impedance)
    softness = (1 - d) / d * np.array(weights) / settings.impratio
    normal = observe(bicycle, surface, q, qd).normal
    directions = _tangents(bicycle, q, normal)
    force = np.einsum("nkij,nkj->nki", directions, trajectory.contact_force)
    turn = np.cross(angular_velocities(bicycle, q, qd)[:, 2:], normal * trajectory.gap[..., None] / 2)
    sinking = np.einsum("nkij,nkj->nki", directions, turn)
    missing = contact_acceleration(bicycle, surface, q, qd)
    return (missing - softness[..., None] * force) / settings.damping + sinking


def _tangents(bicycle: Bicycle, q: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Return the lateral and forward directions at both contacts, shape (n, 2, 2, 3)."""
    c = constants(bicycle)
    return np.array(
        [
            [contact.tangents(wheel[2], tuple(n)) for wheel, n in zip(kernel.wheels(here, c), normals, strict=True)]
            for here, normals in zip(q, normal, strict=True)
        ]
    )
