"""The linearised DAE without reduction (Xiong et al. 2020, Eqs. 14 and 15), and its generalised eigenvalues.

In the heading frame, with coordinates u = (x, y, z, lean, pitch, steer), rates w of all nine coordinates,
contact parameters p and forces f, the equations about a circular motion are

    u' = w_u,    R(u, w, w', p, f) = 0,

27 in the 27 unknowns y = (u, w, p, f), and to first order E y' = H y. The three cyclic coordinates do not
appear. E has rank 15, and of the 27 eigenvalues of lambda E - H seven are finite: those of the reduced system.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.linalg import eigvals

from ...reference.bicycle import Bicycle
from ...reference.circular import CircularMotion
from ...reference.dae import dynamics, residual
from ...reference.kernels.steady import STEP
from ...reference.kinematics import COORDINATES, YAW
from ...reference.surface import SurfaceOfRevolution

_CYCLIC = (YAW, 7, 8)
_STILL = [k for k in range(len(COORDINATES)) if k not in _CYCLIC]
_SHIFT = 1.7  # [1/s] of the size of the eigenvalues, but not one of them
_INDEX = 3  # of the DAE: gaps at the level of positions
# Relative to the largest singular value: those that count are above 1e-6, round-off is below 1e-15.
_COUNTS = 1e-10


def linearised_dae(
    bicycle: Bicycle, surface: SurfaceOfRevolution, motion: CircularMotion
) -> tuple[np.ndarray, np.ndarray]:
    """Compute E and H, shapes (27, 27), at a circular motion; derivatives are taken by the complex step."""
    q, qd = motion.state()
    now, rates = dynamics(bicycle, surface, q, qd), np.zeros(len(q))
    rates[list(_CYCLIC)] = qd[list(_CYCLIC)]
    weight = bicycle.mass * bicycle.gravity
    arguments = (q, rates, np.zeros(len(q)), now.contact.ravel(), now.force.ravel() / weight)
    slopes = [_argument_jacobian(bicycle, surface, arguments, k) for k in range(len(arguments))]
    still = len(_STILL)
    size = still + sum(len(arguments[k]) for k in (1, 3, 4))
    e, h = np.zeros((2, size, size))
    e[:still, :still] = np.eye(still)
    h[range(still), [still + k for k in _STILL]] = 1
    e[still:, still : still + len(q)] = slopes[2]
    h[still:] = -np.hstack([slopes[0][:, _STILL], slopes[1], slopes[3], slopes[4]])
    return e, h


def _argument_jacobian(
    bicycle: Bicycle, surface: SurfaceOfRevolution, arguments: tuple[np.ndarray, ...], which: int
) -> np.ndarray:
    columns = []
    for k in range(len(arguments[which])):
        varied = [values.astype(complex) for values in arguments]
        varied[which][k] += 1j * STEP
        columns.append(np.imag(_turning_residual(bicycle, surface, *varied)) / STEP)
    return np.array(columns).T


def _turning_residual(
    bicycle: Bicycle,
    surface: SurfaceOfRevolution,
    q: np.ndarray,
    rates: np.ndarray,
    accelerations: np.ndarray,
    p: np.ndarray,
    force: np.ndarray,
) -> np.ndarray:
    """Evaluate the 21 equations with x, y and their derivatives in the heading frame and forces over the weight."""
    qd, qdd, w, (x, y) = rates.copy(), accelerations.copy(), rates[YAW], q[:2]
    qd[:2] += (-w * y, w * x)
    turning = accelerations[YAW]
    qdd[0] += -2 * w * rates[1] - turning * y - w * w * x
    qdd[1] += 2 * w * rates[0] + turning * x - w * w * y
    return residual(bicycle, surface, q, qd, qdd, p, force * bicycle.mass * bicycle.gravity)


def generalised_eigenvalues(e: np.ndarray, h: np.ndarray) -> np.ndarray:
    """Compute all eigenvalues of lambda E - H by the QZ method, as it returns them, finite or not [1/s]."""
    pairs: Any = eigvals(h, e, homogeneous_eigvals=True)
    alpha, beta = pairs
    with np.errstate(divide="ignore", invalid="ignore"):
        values = alpha / beta
    return np.where(np.isfinite(values), values, np.inf)


def number_of_finite(e: np.ndarray, h: np.ndarray) -> int:
    """Count the finite eigenvalues of lambda E - H.

    They are the eigenvalues 1 / (lambda - s) of (H - s E)^-1 E; the infinite ones are a nilpotent part, which vanishes
    in the power of the index.
    """
    power = np.linalg.matrix_power(np.linalg.solve(h - _SHIFT * e, e), _INDEX)
    values = np.linalg.svd(power, compute_uv=False)
    return int(np.sum(values > _COUNTS * values[0]))


def spurious(found: np.ndarray, reduced: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the largest distance of the reduced eigenvalues from distinct ones of those found, and the others."""
    rest, off = found.astype(complex), 0.0
    for value in reduced:
        nearest = int(np.abs(rest - value).argmin())
        off = max(off, float(abs(rest[nearest] - value)))
        rest = np.delete(rest, nearest)
    return off, rest
