"""Linearisation to the seven independent variables (Xiong et al. 2020, Eqs. 15-17)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .bicycle import Bicycle
from .dae import contact_parameters
from .kernels import steady as kernel
from .kinematics import LEAN, REAR_ANGLE, STEER, YAW, constants
from .surface import Surface, is_level

VARIABLES = ("x", "y", "lean", "steer", "lean_rate", "steer_rate", "rear_rate")


@dataclass(frozen=True)
class Linearisation:
    """The reduced system dv/dt = X(v) about a state, v as named in `VARIABLES`, x and y in the heading frame.

    Attributes
    ----------
    field : ndarray, shape (7,)
        X(v); zero on a circular motion.
    jacobian : ndarray, shape (7, 7)
    eigenvalues : ndarray, shape (7,), complex
        Sorted by real part, then by imaginary part [1/s].
    """

    field: np.ndarray
    jacobian: np.ndarray
    eigenvalues: np.ndarray


def linearise(bicycle: Bicycle, surface: Surface, q: np.ndarray, qd: np.ndarray) -> Linearisation:
    """Reduced Jacobian and eigenvalues at a state on the constraints.

    Derivatives are taken by the complex step and exact to round-off.

    Parameters
    ----------
    bicycle : Bicycle
    surface : Surface
        A surface of revolution about z, or a plane: X depends on no heading.
    q, qd : ndarray, shape (9,)

    Returns
    -------
    Linearisation

    Raises
    ------
    ValueError
        If the wheels do not reach the ground near the state.
    """
    cosine, sine = np.cos(q[YAW]), np.sin(q[YAW])
    x, y = cosine * q[0] + sine * q[1], -sine * q[0] + cosine * q[1]
    v = np.array([x, y, q[LEAN], q[STEER], qd[LEAN], qd[STEER], qd[REAR_ANGLE]])
    turned = np.concatenate([[x, y, q[2], 0.0], q[LEAN:]])
    p, c = contact_parameters(bicycle, surface, turned), constants(bicycle)
    field, jacobian = np.empty(7), np.empty((7, 7))
    found = kernel.reduced_field(v, turned, p, surface.function.real, surface.parameters, c, field)
    found = found and kernel.reduced_jacobian(v, turned, p, surface.function.complex, surface.parameters, c, jacobian)
    if not found or not np.all(np.isfinite(jacobian)):
        raise ValueError(f"the motion cannot be linearised at lean = {q[LEAN]!r}, steer = {q[STEER]!r}")
    eigenvalues = np.linalg.eigvals(jacobian)
    return Linearisation(field, jacobian, eigenvalues[np.lexsort((eigenvalues.imag, eigenvalues.real))])


def structural_eigenvalues(surface: Surface, yaw_rate: float) -> list[complex]:
    """Eigenvalues that symmetry alone puts on the imaginary axis.

    Circular motions come in one-parameter families, hence a zero; on a level plane the circle's centre
    is free too, hence a pair of +-i times the yaw rate.
    """
    return [0j, complex(0, yaw_rate), complex(0, -yaw_rate)] if is_level(surface) else [0j]


def free_eigenvalues(surface: Surface, eigenvalues: np.ndarray, yaw_rate: float) -> list[complex]:
    """Eigenvalues that symmetry does not fix: all but the nearest to each structural one."""
    rest = list(eigenvalues)
    for known in structural_eigenvalues(surface, yaw_rate):
        rest.remove(min(rest, key=lambda value: abs(value - known)))
    return rest


def growth_rate(surface: Surface, eigenvalues: np.ndarray, yaw_rate: float) -> float:
    """Largest real part among the eigenvalues that symmetry does not fix [1/s]; negative: Lyapunov stable."""
    return max(value.real for value in free_eigenvalues(surface, eigenvalues, yaw_rate))
