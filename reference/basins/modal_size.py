"""The size of a small deviation from a circle, in its modes.

With d the deviation of the independent variables, w and r the left and right eigenvectors of the Jacobian there
(w r = 1), a = w d is a mode's amplitude, and |a| |r_angle|, doubled for a pair, what it contributes to an angle, the
larger of lean and steer. The squares of these, added up, are a quadratic form d^T P d that decays as the modes do. The
zero mode, which leads along the family of circles, is left out: it is zero on a level set of energy to first order.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..bicycle import Bicycle
from ..stability import VARIABLES, linearise
from ..surface import Surface, is_level

_ANGLES = VARIABLES.index("lean"), VARIABLES.index("steer")
# Real parts of the halves of a pair differ by round-off, 1e-13 1/s; those of different modes by 1e-3 1/s and more but
# at isolated circles.
_SAME = 1e-8


@dataclass(frozen=True, eq=False)
class ModalSize:
    """How deviations from a circle are measured.

    Attributes
    ----------
    slowest : complex
        The eigenvalue of the largest real part but for the structural ones, of imaginary part >= 0 [1/s].
    fastest_turn : float
        The largest imaginary part of an eigenvalue [rad/s].
    forms : ndarray, shape (2, 7, 7)
        P of the slowest mode alone, and of all.
    """

    slowest: complex
    fastest_turn: float
    forms: np.ndarray


def measure_modes(bicycle: Bicycle, surface: Surface, q: np.ndarray, qd: np.ndarray) -> ModalSize:
    """Return the measure of deviations from a circular motion.

    On the level plane the position is left out, since the circle may have any centre.

    Parameters
    ----------
    bicycle : Bicycle
    surface : Surface
    q, qd : ndarray, shape (9,)
        The motion.
    """
    first = 2 if is_level(surface) else 0
    jacobian = linearise(bicycle, surface, q, qd).jacobian[first:, first:]
    values, right = np.linalg.eig(jacobian)
    values, right = values.astype(complex), right.astype(complex)
    left = np.zeros((len(values), len(VARIABLES)), complex)
    left[:, first:] = np.linalg.inv(right)
    free = np.delete(np.arange(len(values)), np.argmin(np.abs(values)))
    slowest = max(values[free].tolist(), key=lambda value: (value.real, value.imag))
    parts = []
    for k in free:
        share = max(abs(right[angle - first, k]) for angle in _ANGLES) * (2**0.5 if np.imag(values[k]) else 1.0)
        row = share * left[k]
        parts.append(np.real(np.outer(np.conj(row), row)))
    slow = [part for part, k in zip(parts, free, strict=True) if slowest.real - values[k].real < _SAME]
    forms = np.stack([np.sum(slow, axis=0), np.sum(parts, axis=0)])
    return ModalSize(complex(slowest.real, abs(slowest.imag)), float(np.abs(np.imag(values)).max()), forms)


def deviation_sizes(forms: np.ndarray, deviations: np.ndarray) -> np.ndarray:
    """Return the sizes [rad] of deviations (n, m, 7) by forms (n, 2, 7, 7), shape (n, 2, m)."""
    squares = np.einsum("nmi,nkij,nmj->nkm", deviations, forms, deviations, optimize=True)
    return np.sqrt(np.maximum(squares, 0.0))  # round-off may leave a zero negative
