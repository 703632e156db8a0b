"""Splines of degree five for surfaces: four continuous derivatives, of which two are evaluated.

The ground enters an integrator of order 8 through its Hessian. Where that is only continuous, steps lose
their order; that of a quintic spline is twice continuously differentiable.
"""

from __future__ import annotations

import numpy as np

from .compilation import jit

DEGREE = 5


@jit
def polynomial(coefficients, t):
    """Return value, first and second derivative at t of a polynomial with rising powers."""
    value, first, second = 0 * t, 0 * t, 0 * t
    for k in range(coefficients.size - 1, -1, -1):
        second = second * t + 2 * first
        first = first * t + value
        value = value * t + coefficients[k]
    return value, first, second


@jit
def piecewise(parameters, t):
    """Return value, first and second derivative at t of a piecewise quintic; nan outside its pieces.

    ``parameters`` (7 n + 1,) are the n + 1 breaks, then six coefficients per piece in powers of the
    distance from the piece's left end.
    """
    pieces = (parameters.size - 1) // 7
    breaks = parameters[: pieces + 1]
    # The complex step on the axis leaves t = -1e-60.
    if not (t.real + 1e-30 >= breaks[0] and t.real <= breaks[pieces]):
        hole = np.nan + 0 * t
        return hole, hole, hole
    low, high = 0, pieces
    while high - low > 1:
        middle = (low + high) // 2
        if t.real < breaks[middle]:
            high = middle
        else:
            low = middle
    start = pieces + 1 + 6 * low
    return polynomial(parameters[start : start + 6], t - breaks[low])


@jit
def uniform_cell(position, samples):
    """Return the cell of a grid at a position (in grid spacings from the first sample); -1 outside the grid."""
    if not 0 <= position.real <= samples - 1:
        return -1
    return min(int(position.real), samples - 2)


@jit
def _spline_weights(u):
    """Return the weights of a cell's six uniform B-splines at u = 0 to 1, and their first and second derivatives.

    Those of degree 5 are computed from those of degree 4 (de Boor 1978): with b the n + 1 weights of degree n,
    those of the next degree are ((u + n - k) b[k - 1] + (k + 1 - u) b[k]) / (n + 1), and their
    derivatives b[k - 1] - b[k].
    """
    v = 1 - u
    b0, b1, b2, b3 = v * v * v / 6, 2 / 3 - u * u * (2 - u) / 2, 2 / 3 - v * v * (2 - v) / 2, u * u * u / 6
    c0, c1, c2 = v * b0 / 4, ((u + 3) * b0 + (2 - u) * b1) / 4, ((u + 2) * b1 + (3 - u) * b2) / 4
    c3, c4 = ((u + 1) * b2 + (4 - u) * b3) / 4, u * b3 / 4
    weights = (
        v * c0 / 5,
        ((u + 4) * c0 + (2 - u) * c1) / 5,
        ((u + 3) * c1 + (3 - u) * c2) / 5,
        ((u + 2) * c2 + (4 - u) * c3) / 5,
        ((u + 1) * c3 + (5 - u) * c4) / 5,
        u * c4 / 5,
    )
    first = (-c0, c0 - c1, c1 - c2, c2 - c3, c3 - c4, c4)
    second = (b0, b1 - 2 * b0, b0 - 2 * b1 + b2, b1 - 2 * b2 + b3, b2 - 2 * b3, b3)
    return weights, first, second


@jit
def _weigh(w, c):
    return w[0] * c[0] + w[1] * c[1] + w[2] * c[2] + w[3] * c[3] + w[4] * c[4] + w[5] * c[5]


@jit
def _evaluate_row(weights, row, j):
    """Return value, first and second derivative of one row of coefficients in cell j."""
    c = (row[j], row[j + 1], row[j + 2], row[j + 3], row[j + 4], row[j + 5])
    return _weigh(weights[0], c), _weigh(weights[1], c), _weigh(weights[2], c)


@jit
def tensor(coefficients, i, j, u, v):
    """Return value and derivatives (f, fu, fv, fuu, fuv, fvv) of a uniform tensor spline in cell (i, j) at (u, v).

    f = sum_ab w_a(u) c[i + a, j + b] w_b(v)
    """
    along, across = _spline_weights(u), _spline_weights(v)
    r0, r1 = _evaluate_row(across, coefficients[i], j), _evaluate_row(across, coefficients[i + 1], j)
    r2, r3 = _evaluate_row(across, coefficients[i + 2], j), _evaluate_row(across, coefficients[i + 3], j)
    r4, r5 = _evaluate_row(across, coefficients[i + 4], j), _evaluate_row(across, coefficients[i + 5], j)
    value = (r0[0], r1[0], r2[0], r3[0], r4[0], r5[0])
    slope = (r0[1], r1[1], r2[1], r3[1], r4[1], r5[1])
    bend = (r0[2], r1[2], r2[2], r3[2], r4[2], r5[2])
    w, first, second = along
    return (
        _weigh(w, value),
        _weigh(first, value),
        _weigh(w, slope),
        _weigh(second, value),
        _weigh(first, slope),
        _weigh(w, bend),
    )
