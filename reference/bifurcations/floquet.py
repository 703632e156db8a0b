"""Floquet multipliers of periodic orbits of a flow that conserves an energy."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

# Sizes of multipliers whose ratio is larger are told apart before products are formed: their round-off is eps times the
# largest of a group. The angles between subspaces shrink by that ratio with each sweep, to round-off.
_APART, _SWEEPS = 1e4, 4


def floquet_multipliers(legs: np.ndarray, fields: np.ndarray, gradients: np.ndarray) -> tuple[np.ndarray, float]:
    """Compute the Floquet multipliers of a periodic orbit that consists of m legs.

    Two multipliers are 1: the field f is carried into itself, M f = f, and the energy's gradient g is conserved,
    g M = g, with g . f = 0. As the period depends on the energy, they belong to a Jordan block, and eigenvalues
    computed of the whole matrix would be off by the root of round-off. In orthonormal bases that begin with f and
    end with g the matrix of each leg is block triangular: the products of the first and the last entries of their
    diagonals are these two multipliers, and the blocks between them have the others.

    Parameters
    ----------
    legs : ndarray, shape (m, n, n)
        Derivatives of the state at the end of each leg by that at its start. M is their product.
    fields, gradients : ndarray, shape (m, n)
        f and g at the starts of the legs.

    Returns
    -------
    multipliers : ndarray, shape (n,), complex
        That of time, that of energy, then the others by decreasing size.
    invariance : float
        Largest of the matrices' entries that are zero for an exact orbit, relative to the matrix' largest entry.
    """
    bases = [_adapt_basis(field, gradient) for field, gradient in zip(fields, gradients, strict=True)]
    turned = np.array(
        [after.T @ leg @ basis for basis, leg, after in zip(bases, legs, bases[1:] + bases[:1], strict=True)]
    )
    others = eigenvalues_of_product(turned[:, 1:-1, 1:-1])
    others = others[np.argsort(-np.abs(others), kind="stable")]
    lost = np.concatenate([turned[:, 1:, 0], turned[:, -1, :-1]], axis=1)
    invariance = float((np.abs(lost).max(axis=1) / np.abs(turned).max(axis=(1, 2))).max())
    return np.concatenate(
        [turned[:, 0, 0].prod(keepdims=True), turned[:, -1, -1].prod(keepdims=True), others]
    ), invariance


def _adapt_basis(field: np.ndarray, gradient: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis (n, n) that begins with the field and ends with the gradient."""
    basis = np.linalg.qr(np.column_stack([field, gradient]), mode="complete")[0]
    return np.column_stack([basis[:, 0], basis[:, 2:], basis[:, 1]])


def eigenvalues_of_product(matrices: Sequence[np.ndarray] | np.ndarray) -> np.ndarray:
    """Compute the eigenvalues of a product of matrices, small ones beside large ones.

    Round-off of the product itself would be that of its largest eigenvalue. Sweeps of orthogonal iteration over the
    factors make them block triangular instead, with blocks for eigenvalues of different size, and products are formed
    of the blocks alone (the periodic Schur form: Bojanczyk, Golub and Van Dooren 1992).

    Parameters
    ----------
    matrices : sequence of ndarray, shape (m, n, n)
        The first is the factor on the right.

    Returns
    -------
    ndarray, shape (n,), complex

    References
    ----------
    A. Bojanczyk, G. H. Golub, P. Van Dooren: The periodic Schur decomposition. Algorithms and applications. Proc. SPIE
    1770 (1992) 31-42.
    """
    size = len(matrices[0])
    basis, first = np.eye(size), np.eye(size)
    triangles: list[np.ndarray] = []
    for _ in range(_SWEEPS):
        first, triangles = basis, []
        for matrix in matrices:
            basis, triangle = np.linalg.qr(matrix @ basis)
            triangles.append(triangle)
    with np.errstate(divide="ignore"):
        sizes = np.log(np.abs([np.diag(triangle) for triangle in triangles])).sum(axis=0)
    cuts = [0, *(k for k in range(1, size) if sizes[k - 1] - sizes[k] > np.log(_APART)), size]
    turn, found = first.T @ basis, []
    for start, stop in pairwise(cuts):
        product = np.eye(stop - start)
        for triangle in triangles:
            product = triangle[start:stop, start:stop] @ product
        found.append(np.linalg.eigvals(turn[start:stop, start:stop] @ product))
    return np.concatenate(found).astype(complex)
