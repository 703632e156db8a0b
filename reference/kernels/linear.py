"""Small dense solvers that stay analytic.

LAPACK conjugates complex matrices, which breaks the complex step. These functions factorise A = L D L^T for a
complex *symmetric* matrix and solve square systems with pivots chosen by their real parts.
"""

from __future__ import annotations

import numpy as np

from .arrays import copy_array
from .compilation import jit


@jit
def factorise(a, n):
    """Overwrite the lower triangle of symmetric ``a`` (n, n) with L and its diagonal with D."""
    for j in range(n):
        for k in range(j):
            a[j, j] -= a[j, k] * a[j, k] * a[k, k]
        inverse = 1.0 / a[j, j]
        for i in range(j + 1, n):
            s = a[i, j]
            for k in range(j):
                s -= a[i, k] * a[j, k] * a[k, k]
            a[i, j] = s * inverse


@jit
def solve_factorised(a, b, n):
    """Overwrite ``b`` (n,) with the solution of L D L^T x = b."""
    for i in range(n):
        for k in range(i):
            b[i] -= a[i, k] * b[k]
    for i in range(n):
        b[i] /= a[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            b[i] -= a[k, i] * b[k]


@jit
def solve(a, b, n):
    """Overwrite ``b`` (n,) with the solution of a x = b by Gaussian elimination; ``a`` is destroyed."""
    for k in range(n):
        p = k
        for i in range(k + 1, n):
            if abs(a[i, k].real) > abs(a[p, k].real):
                p = i
        if p != k:
            for j in range(k, n):
                a[k, j], a[p, j] = a[p, j], a[k, j]
            b[k], b[p] = b[p], b[k]
        inverse = 1.0 / a[k, k]
        for i in range(k + 1, n):
            factor = a[i, k] * inverse
            for j in range(k + 1, n):
                a[i, j] -= factor * a[k, j]
            b[i] -= factor * b[k]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            b[i] -= a[i, j] * b[j]
        b[i] /= a[i, i]


@jit
def solve_three(a, b):
    """Return the solution of a 3 x 3 system by Cramer's rule; rows ``a`` and right-hand side ``b`` as tuples."""
    (a00, a01, a02), (a10, a11, a12), (a20, a21, a22) = a
    c0, c1, c2 = a11 * a22 - a12 * a21, a12 * a20 - a10 * a22, a10 * a21 - a11 * a20
    inverse = 1.0 / (a00 * c0 + a01 * c1 + a02 * c2)
    x0 = b[0] * c0 + a01 * (a12 * b[2] - b[1] * a22) + a02 * (b[1] * a21 - a11 * b[2])
    x1 = a00 * (b[1] * a22 - a12 * b[2]) + b[0] * c1 + a02 * (a10 * b[2] - b[1] * a20)
    x2 = a00 * (a11 * b[2] - b[1] * a21) + a01 * (b[1] * a20 - a10 * b[2]) + b[0] * c2
    return x0 * inverse, x1 * inverse, x2 * inverse


@jit
def invert(a, n):
    """Overwrite ``a`` (n, n) with its inverse by Gauss-Jordan elimination; return its determinant's sign."""
    order, sign = np.arange(n), 1.0
    for k in range(n):
        p = k
        for i in range(k + 1, n):
            if abs(a[i, k]) > abs(a[p, k]):
                p = i
        if p != k:
            sign = -sign
        order[k], order[p] = order[p], order[k]
        for j in range(n):
            a[k, j], a[p, j] = a[p, j], a[k, j]
        sign *= np.sign(a[k, k])
        inverse = 1.0 / a[k, k]
        a[k, k] = 1.0
        for j in range(n):
            a[k, j] *= inverse
        for i in range(n):
            if i != k:
                factor = a[i, k]
                a[i, k] = 0.0
                for j in range(n):
                    a[i, j] -= factor * a[k, j]
    row = np.empty(n)
    for i in range(n):
        for k in range(n):
            row[order[k]] = a[i, k]
        copy_array(row, a[i])
    return sign
