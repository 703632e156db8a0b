"""Linearisation to the seven independent variables (Xiong et al. 2020, Eqs. 15-17)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .bicycle import Bicycle
from .dae import contact_parameters
from .inputs import NO_INPUTS, Inputs
from .kernels import reduced as kernel
from .kernels.dynamics import settle
from .kernels.pose import aligned
from .kinematics import FRONT_ANGLE, LEAN, REAR_ANGLE, STEER, YAW, constants
from .surface import Surface, is_level

# Relative to a matrix's largest eigenvalue. Real parts that differ by less than the first are equal: their round-off
# is about 1e-15 times an eigenvalue's condition number, which is 1e2 to 1e4 along the families. A double zero splits
# by the square root of that, 1e-8 to 1e-7; the slowest pair, of circles of a kilometre on the plane, has 1e-4. Growth
# below the last cannot be told from zero: between kernels of BLAS the families' growth rates differ by up to 1e-13
# 1/s, and their largest eigenvalues are about ten. On the flattest bowl that a scenario may have, 1e-12 1/m, circles
# decay at 2e-12 1/s.
_EQUAL, _ZERO, _NO_GROWTH = 1e-9, 1e-6, 2e-14

# x and y in the heading frame.
VARIABLES = ("x", "y", "lean", "steer", "lean_rate", "steer_rate", "rear_rate")


@dataclass(frozen=True)
class Linearisation:
    """The reduced system dv/dt = X(v) about a state, x and y in the heading frame.

    Attributes
    ----------
    variables : tuple of str
        Names of v: `VARIABLES`, but with the front wheel's rate in place of the rear's where the rear wheel stands or
        nearly does (a pivoting motion has no rear rate from which its speed could be seen).
    field : ndarray, shape (7,)
        X(v); zero on a circular motion.
    jacobian : ndarray, shape (7, 7)
    eigenvalues : ndarray, shape (7,), complex
        In the order of `eigenvalue_order` [1/s].
    """

    variables: tuple[str, ...]
    field: np.ndarray
    jacobian: np.ndarray
    eigenvalues: np.ndarray


def independent(q: np.ndarray, qd: np.ndarray) -> np.ndarray:
    """Return the independent variables, named in `VARIABLES`, of states (..., 9); shape (..., 7)."""
    cosine, sine = np.cos(q[..., YAW]), np.sin(q[..., YAW])
    x, y = q[..., 0], q[..., 1]
    columns = (cosine * x + sine * y, -sine * x + cosine * y, q[..., LEAN], q[..., STEER])
    return np.stack([*columns, qd[..., LEAN], qd[..., STEER], qd[..., REAR_ANGLE]], axis=-1)


def linearise(
    bicycle: Bicycle, surface: Surface, q: np.ndarray, qd: np.ndarray, inputs: Inputs = NO_INPUTS
) -> Linearisation:
    """Linearise the reduced equations at a state on the constraints.

    Derivatives are taken by the complex step and are exact to round-off.

    Parameters
    ----------
    bicycle : Bicycle
    surface : Surface
        A surface of revolution about z, or a plane: X does not depend on the heading.
    q, qd : ndarray, shape (9,)
        Coordinates and rates.
    inputs : Inputs
        Held constant.

    Returns
    -------
    Linearisation

    Raises
    ------
    ValueError
        If the wheels do not reach the ground near the state.
    """
    x, y = independent(q, qd)[:2]
    turned = np.concatenate([[x, y, q[2], 0.0], q[LEAN:]])
    p, c, parameters = contact_parameters(bicycle, surface, turned), constants(bicycle, inputs), surface.parameters
    found = settle(turned, p, surface.function.real, parameters, c)
    state, field, jacobian = np.concatenate([turned, qd, p]), np.empty(7), np.empty((7, 7))
    spin = kernel.telling_spin(qd[REAR_ANGLE], qd[FRONT_ANGLE])
    kernel.reduced_jacobian(state, spin, surface.function.complex, parameters, aligned(c), field, jacobian)
    if not found or not np.all(np.isfinite(jacobian)):
        raise ValueError(f"the motion cannot be linearised at lean = {q[LEAN]!r}, steer = {q[STEER]!r}")
    last = "rear_rate" if spin == kernel.REAR else "front_rate"
    return Linearisation((*VARIABLES[:-1], last), field, jacobian, sorted_eigenvalues(jacobian))


def sorted_eigenvalues(jacobians: np.ndarray) -> np.ndarray:
    """Compute eigenvalues of real matrices (..., n, n), shape (..., n), in the order of `eigenvalue_order`.

    Complex eigenvalues come in exactly conjugate pairs.
    """
    eigenvalues = np.linalg.eigvals(jacobians).astype(complex)
    return np.take_along_axis(eigenvalues, eigenvalue_order(eigenvalues), axis=-1)


def eigenvalue_order(eigenvalues: np.ndarray) -> np.ndarray:
    """Order eigenvalues by their real parts, and those with equal real parts by their imaginary parts.

    Real parts are equal where they differ from the next one by no more than round-off, as those of eigenvalues do that
    symmetry puts on the imaginary axis. Eigenvalues that `are_zero` count as zero.

    Parameters
    ----------
    eigenvalues : ndarray, shape (..., n), complex

    Returns
    -------
    ndarray of int, shape (..., n)
    """
    values = np.where(are_zero(eigenvalues), 0, eigenvalues)
    by_real = np.argsort(np.real(values), axis=-1, kind="stable")
    real, imaginary, own = (
        np.take_along_axis(part, by_real, axis=-1) for part in (np.real(values), np.imag(values), np.real(eigenvalues))
    )
    gap = _EQUAL * np.abs(eigenvalues).max(axis=-1, keepdims=True)
    group = np.cumsum(np.diff(real, axis=-1, prepend=real[..., :1]) > gap, axis=-1)
    return np.take_along_axis(by_real, np.lexsort((own, imaginary, group), axis=-1), axis=-1)


def are_zero(eigenvalues: np.ndarray) -> np.ndarray:
    """Return which eigenvalues (..., n) of matrices are zero but for round-off, shape (..., n).

    A double zero, as where the energy is extreme along a family or the bicycle stands, may be computed as a pair.
    """
    size = np.abs(eigenvalues)
    return size <= _ZERO * size.max(axis=-1, keepdims=True)


def structural_eigenvalues(surface: Surface, yaw_rate: np.ndarray | float) -> np.ndarray:
    """Return the eigenvalues that symmetry alone puts on the imaginary axis, shape (..., 1 or 3) for yaw rates (...).

    Circular motions form one-parameter families, hence a zero; on a level plane the circle's centre
    is free too, hence a pair of +-i times the yaw rate.
    """
    turns = np.array([0, 1, -1] if is_level(surface) else [0])
    return 1j * turns * np.asarray(yaw_rate)[..., None]


def free_eigenvalues(surface: Surface, eigenvalues: np.ndarray, yaw_rate: np.ndarray | float) -> np.ndarray:
    """Select the eigenvalues that symmetry does not fix: all but the nearest to each structural one.

    Parameters
    ----------
    surface : Surface
    eigenvalues : ndarray, shape (..., 7)
    yaw_rate : ndarray or float, shape (...)
        [rad/s].

    Returns
    -------
    ndarray, shape (..., 6), or (..., 4) on the level plane
    """
    rest = np.asarray(eigenvalues, complex)
    for known in np.moveaxis(structural_eigenvalues(surface, yaw_rate), -1, 0):
        nearest = np.abs(rest - known[..., None]).argmin(axis=-1)
        others = np.arange(rest.shape[-1]) != nearest[..., None]
        rest = rest[others].reshape(*rest.shape[:-1], -1)
    return rest


def growth_rates(surface: Surface, eigenvalues: np.ndarray, yaw_rate: np.ndarray | float) -> np.ndarray:
    """Return the largest real parts (...) among the eigenvalues (..., 7) that symmetry does not fix [1/s].

    Negative values mean Lyapunov stable. Zero where the sign is round-off, as on a bowl that is level but for 1e-13.
    """
    growth = np.real(free_eigenvalues(surface, eigenvalues, yaw_rate)).max(axis=-1)
    return np.where(np.abs(growth) > _NO_GROWTH * np.abs(eigenvalues).max(axis=-1), growth, 0.0)


def growth_rate(surface: Surface, eigenvalues: np.ndarray, yaw_rate: float) -> float:
    """Return the growth rate of one motion, see `growth_rates`."""
    return float(growth_rates(surface, eigenvalues, yaw_rate))
