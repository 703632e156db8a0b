"""Linear combinations of the stages of Dormand's and Prince's method, with the coefficients compiled in.

The coefficients are those of `tableau`, without the zeros: each sum is written out, as in Hairer's program, so that a
loop over the 24 states needs neither a loop over the stages nor a look at their coefficients, and several states are
summed at once. ``k`` (384,) has the derivatives at the stages one after another, 24 numbers each: the first 12, that at
the end of the step, and three more for the dense output.
"""

from __future__ import annotations

import math

from .compilation import jit
from .tableau import DENSE_OUTPUT, ERROR_3, ERROR_5, EXTRA_STAGES, STAGES, SUM

SIZE = 24
# In Hairer's letters; tuples, which numba compiles in.
_A = tuple(tuple(row.values()) for row in STAGES)
_B, _E3, _E5 = tuple(SUM.values()), tuple(ERROR_3.values()), tuple(ERROR_5.values())
_EXTRA = tuple(tuple(row.values()) for row in EXTRA_STAGES)
_D = tuple(tuple(row.values()) for row in DENSE_OUTPUT)


@jit
def fill_stage(s, y, h, k, out):
    """Fill ``out`` (24,), the state at which stage ``s`` of 1 to 11 is evaluated, from the stages before it."""
    if s == 1:
        for i in range(SIZE):
            out[i] = y[i] + h * (_A[1][0] * k[i])
    elif s == 2:
        for i in range(SIZE):
            out[i] = y[i] + h * (_A[2][0] * k[i] + _A[2][1] * k[SIZE + i])
    elif s == 3:
        for i in range(SIZE):
            out[i] = y[i] + h * (_A[3][0] * k[i] + _A[3][1] * k[2 * SIZE + i])
    elif s == 4:
        for i in range(SIZE):
            out[i] = y[i] + h * (_A[4][0] * k[i] + _A[4][1] * k[2 * SIZE + i] + _A[4][2] * k[3 * SIZE + i])
    elif s == 5:
        for i in range(SIZE):
            out[i] = y[i] + h * (_A[5][0] * k[i] + _A[5][1] * k[3 * SIZE + i] + _A[5][2] * k[4 * SIZE + i])
    elif s == 6:
        for i in range(SIZE):
            out[i] = y[i] + h * (
                _A[6][0] * k[i] + _A[6][1] * k[3 * SIZE + i] + _A[6][2] * k[4 * SIZE + i] + _A[6][3] * k[5 * SIZE + i]
            )
    elif s == 7:
        for i in range(SIZE):
            out[i] = y[i] + h * (
                _A[7][0] * k[i]
                + _A[7][1] * k[3 * SIZE + i]
                + _A[7][2] * k[4 * SIZE + i]
                + _A[7][3] * k[5 * SIZE + i]
                + _A[7][4] * k[6 * SIZE + i]
            )
    elif s == 8:
        for i in range(SIZE):
            out[i] = y[i] + h * (
                _A[8][0] * k[i]
                + _A[8][1] * k[3 * SIZE + i]
                + _A[8][2] * k[4 * SIZE + i]
                + _A[8][3] * k[5 * SIZE + i]
                + _A[8][4] * k[6 * SIZE + i]
                + _A[8][5] * k[7 * SIZE + i]
            )
    elif s == 9:
        for i in range(SIZE):
            out[i] = y[i] + h * (
                _A[9][0] * k[i]
                + _A[9][1] * k[3 * SIZE + i]
                + _A[9][2] * k[4 * SIZE + i]
                + _A[9][3] * k[5 * SIZE + i]
                + _A[9][4] * k[6 * SIZE + i]
                + _A[9][5] * k[7 * SIZE + i]
                + _A[9][6] * k[8 * SIZE + i]
            )
    elif s == 10:
        for i in range(SIZE):
            out[i] = y[i] + h * (
                _A[10][0] * k[i]
                + _A[10][1] * k[3 * SIZE + i]
                + _A[10][2] * k[4 * SIZE + i]
                + _A[10][3] * k[5 * SIZE + i]
                + _A[10][4] * k[6 * SIZE + i]
                + _A[10][5] * k[7 * SIZE + i]
                + _A[10][6] * k[8 * SIZE + i]
                + _A[10][7] * k[9 * SIZE + i]
            )
    elif s == 11:
        for i in range(SIZE):
            out[i] = y[i] + h * (
                _A[11][0] * k[i]
                + _A[11][1] * k[3 * SIZE + i]
                + _A[11][2] * k[4 * SIZE + i]
                + _A[11][3] * k[5 * SIZE + i]
                + _A[11][4] * k[6 * SIZE + i]
                + _A[11][5] * k[7 * SIZE + i]
                + _A[11][6] * k[8 * SIZE + i]
                + _A[11][7] * k[9 * SIZE + i]
                + _A[11][8] * k[10 * SIZE + i]
            )


@jit
def fill_step(y, h, k, out):
    """Fill ``out`` (24,), the state at the end of a step."""
    for i in range(SIZE):
        out[i] = y[i] + h * (
            _B[0] * k[i]
            + _B[1] * k[5 * SIZE + i]
            + _B[2] * k[6 * SIZE + i]
            + _B[3] * k[7 * SIZE + i]
            + _B[4] * k[8 * SIZE + i]
            + _B[5] * k[9 * SIZE + i]
            + _B[6] * k[10 * SIZE + i]
            + _B[7] * k[11 * SIZE + i]
        )


@jit
def error_norm(y, new, h, k, tolerance, squares3, squares5):
    """Return the error norm of a step in units of the tolerance, which is relative above 1 and absolute below.

    ``squares3`` and ``squares5`` (24,) are overwritten.
    """
    for i in range(SIZE):
        before, after = abs(y[i]), abs(new[i])
        unit = tolerance * (1 + (before if before > after else after))
        error3 = (
            _E3[0] * k[i]
            + _E3[1] * k[5 * SIZE + i]
            + _E3[2] * k[6 * SIZE + i]
            + _E3[3] * k[7 * SIZE + i]
            + _E3[4] * k[8 * SIZE + i]
            + _E3[5] * k[9 * SIZE + i]
            + _E3[6] * k[10 * SIZE + i]
            + _E3[7] * k[11 * SIZE + i]
        ) / unit
        error5 = (
            _E5[0] * k[i]
            + _E5[1] * k[5 * SIZE + i]
            + _E5[2] * k[6 * SIZE + i]
            + _E5[3] * k[7 * SIZE + i]
            + _E5[4] * k[8 * SIZE + i]
            + _E5[5] * k[9 * SIZE + i]
            + _E5[6] * k[10 * SIZE + i]
            + _E5[7] * k[11 * SIZE + i]
        ) / unit
        squares3[i], squares5[i] = error3 * error3, error5 * error5
    norm3 = norm5 = 0.0
    for i in range(SIZE):
        norm3 += squares3[i]
        norm5 += squares5[i]
    denominator = norm5 + 0.01 * norm3
    return 0.0 if denominator == 0 else abs(h) * norm5 / math.sqrt(denominator * SIZE)


@jit
def fill_extra_stage(s, y, h, k, out):
    """Fill ``out`` (24,), the state at which stage ``s`` of 13 to 15 is evaluated, for the dense output."""
    if s == 13:
        for i in range(SIZE):
            out[i] = y[i] + h * (
                _EXTRA[0][0] * k[i]
                + _EXTRA[0][1] * k[6 * SIZE + i]
                + _EXTRA[0][2] * k[7 * SIZE + i]
                + _EXTRA[0][3] * k[8 * SIZE + i]
                + _EXTRA[0][4] * k[9 * SIZE + i]
                + _EXTRA[0][5] * k[10 * SIZE + i]
                + _EXTRA[0][6] * k[11 * SIZE + i]
                + _EXTRA[0][7] * k[12 * SIZE + i]
            )
    elif s == 14:
        for i in range(SIZE):
            out[i] = y[i] + h * (
                _EXTRA[1][0] * k[i]
                + _EXTRA[1][1] * k[5 * SIZE + i]
                + _EXTRA[1][2] * k[6 * SIZE + i]
                + _EXTRA[1][3] * k[7 * SIZE + i]
                + _EXTRA[1][4] * k[10 * SIZE + i]
                + _EXTRA[1][5] * k[11 * SIZE + i]
                + _EXTRA[1][6] * k[12 * SIZE + i]
                + _EXTRA[1][7] * k[13 * SIZE + i]
            )
    elif s == 15:
        for i in range(SIZE):
            out[i] = y[i] + h * (
                _EXTRA[2][0] * k[i]
                + _EXTRA[2][1] * k[5 * SIZE + i]
                + _EXTRA[2][2] * k[6 * SIZE + i]
                + _EXTRA[2][3] * k[7 * SIZE + i]
                + _EXTRA[2][4] * k[8 * SIZE + i]
                + _EXTRA[2][5] * k[12 * SIZE + i]
                + _EXTRA[2][6] * k[13 * SIZE + i]
                + _EXTRA[2][7] * k[14 * SIZE + i]
            )


@jit
def fill_dense_output(y, new, h, k, out):
    """Fill ``out`` (7, 24), the coefficients of the dense output, from all 16 stages."""
    for i in range(SIZE):
        delta = new[i] - y[i]
        out[0, i] = delta
        out[1, i] = h * k[i] - delta
        out[2, i] = 2 * delta - h * (k[12 * SIZE + i] + k[i])
    for i in range(SIZE):
        out[3, i] = h * (
            _D[0][0] * k[i]
            + _D[0][1] * k[5 * SIZE + i]
            + _D[0][2] * k[6 * SIZE + i]
            + _D[0][3] * k[7 * SIZE + i]
            + _D[0][4] * k[8 * SIZE + i]
            + _D[0][5] * k[9 * SIZE + i]
            + _D[0][6] * k[10 * SIZE + i]
            + _D[0][7] * k[11 * SIZE + i]
            + _D[0][8] * k[12 * SIZE + i]
            + _D[0][9] * k[13 * SIZE + i]
            + _D[0][10] * k[14 * SIZE + i]
            + _D[0][11] * k[15 * SIZE + i]
        )
    for i in range(SIZE):
        out[4, i] = h * (
            _D[1][0] * k[i]
            + _D[1][1] * k[5 * SIZE + i]
            + _D[1][2] * k[6 * SIZE + i]
            + _D[1][3] * k[7 * SIZE + i]
            + _D[1][4] * k[8 * SIZE + i]
            + _D[1][5] * k[9 * SIZE + i]
            + _D[1][6] * k[10 * SIZE + i]
            + _D[1][7] * k[11 * SIZE + i]
            + _D[1][8] * k[12 * SIZE + i]
            + _D[1][9] * k[13 * SIZE + i]
            + _D[1][10] * k[14 * SIZE + i]
            + _D[1][11] * k[15 * SIZE + i]
        )
    for i in range(SIZE):
        out[5, i] = h * (
            _D[2][0] * k[i]
            + _D[2][1] * k[5 * SIZE + i]
            + _D[2][2] * k[6 * SIZE + i]
            + _D[2][3] * k[7 * SIZE + i]
            + _D[2][4] * k[8 * SIZE + i]
            + _D[2][5] * k[9 * SIZE + i]
            + _D[2][6] * k[10 * SIZE + i]
            + _D[2][7] * k[11 * SIZE + i]
            + _D[2][8] * k[12 * SIZE + i]
            + _D[2][9] * k[13 * SIZE + i]
            + _D[2][10] * k[14 * SIZE + i]
            + _D[2][11] * k[15 * SIZE + i]
        )
    for i in range(SIZE):
        out[6, i] = h * (
            _D[3][0] * k[i]
            + _D[3][1] * k[5 * SIZE + i]
            + _D[3][2] * k[6 * SIZE + i]
            + _D[3][3] * k[7 * SIZE + i]
            + _D[3][4] * k[8 * SIZE + i]
            + _D[3][5] * k[9 * SIZE + i]
            + _D[3][6] * k[10 * SIZE + i]
            + _D[3][7] * k[11 * SIZE + i]
            + _D[3][8] * k[12 * SIZE + i]
            + _D[3][9] * k[13 * SIZE + i]
            + _D[3][10] * k[14 * SIZE + i]
            + _D[3][11] * k[15 * SIZE + i]
        )
