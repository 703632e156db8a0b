"""Floquet multipliers of periodic orbits of a flow that conserves an energy."""

from __future__ import annotations

import numpy as np


def floquet_multipliers(monodromy: np.ndarray, field: np.ndarray, gradient: np.ndarray) -> tuple[np.ndarray, float]:
    """Compute the Floquet multipliers of a periodic orbit.

    Two multipliers are 1: the field f is carried into itself, M f = f, and the energy's gradient g is conserved,
    g M = g, with g . f = 0. As the period depends on the energy, they belong to a Jordan block, and eigenvalues
    computed of the whole matrix would be off by the root of round-off. In an orthonormal basis that begins with f and
    ends with g the matrix is block triangular: the first and the last entry of its diagonal are these two multipliers,
    and the block between them has the others.

    Parameters
    ----------
    monodromy : ndarray, shape (n, n)
        M, the derivative of the state after a period by that at the start.
    field, gradient : ndarray, shape (n,)
        f and g at the start.

    Returns
    -------
    multipliers : ndarray, shape (n,), complex
        That of time, that of energy, then the others by decreasing size.
    invariance : float
        Largest of the matrix' entries that are zero for an exact orbit, relative to its largest entry.
    """
    basis = np.linalg.qr(np.column_stack([field, gradient]), mode="complete")[0]
    basis = np.column_stack([basis[:, 0], basis[:, 2:], basis[:, 1]])
    turned = basis.T @ monodromy @ basis
    others = np.linalg.eigvals(turned[1:-1, 1:-1])
    others = others[np.argsort(-np.abs(others), kind="stable")]
    lost = np.concatenate([turned[1:, 0], turned[-1, :-1]])
    invariance = float(np.abs(lost).max() / np.abs(turned).max())
    return np.concatenate([[turned[0, 0], turned[-1, -1]], others]).astype(complex), invariance
