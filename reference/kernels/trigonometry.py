"""Sine and cosine of one angle together.

The C library's two functions reduce the same angle twice, and are calls, which force everything else out of the
registers. Here both are plain arithmetic: the angle is reduced by Cody's and Waite's method, with pi/2 in
three parts and fused multiply-adds, then come the polynomials of fdlibm (`k_sin.c` and `k_cos.c`, Sun Microsystems
1993), of errors below 2^-58 on [-pi/4, pi/4], with the reduced angle's second half. The errors are below one unit in
the last place up to `LARGEST_ANGLE`, and the bits are the same on every machine.
"""

# numba fills its types in at run time.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types
from numba.extending import overload

from .compilation import jit_inline
from .fused import multiply_add

# Beyond it the number of quarter turns is no longer found to within a hundredth [rad].
LARGEST_ANGLE = 2.0**45

_PER_QUARTER_TURN = 2 / np.pi
# pi/2 in three parts: the double next to it, that next to the rest, and that next to the rest of this.
_QUARTER_TURN = 1.5707963267948966
_QUARTER_TURN_2 = 6.123233995736766e-17
_QUARTER_TURN_3 = -1.4973849048591698e-33


@jit_inline
def _sine_and_cosine(x):
    turns = np.rint(x * _PER_QUARTER_TURN)
    # The difference is exact: it is a multiple of 2^-53 or, without a turn, x itself.
    rest = multiply_add(-turns, _QUARTER_TURN, x)
    shift = turns * _QUARTER_TURN_2
    r = rest - shift
    low = (rest - r) - shift
    low -= multiply_add(turns, _QUARTER_TURN_2, -shift)
    low = multiply_add(-turns, _QUARTER_TURN_3, low)

    z = r * r
    w = z * z
    p = multiply_add(z, 1.58969099521155010221e-10, -2.50507602534068634195e-08)
    p = multiply_add(
        z * w,
        p,
        multiply_add(
            z, multiply_add(z, 2.75573137070700676789e-06, -1.98412698298579493134e-04), 8.33333333332248946124e-03
        ),
    )
    v = z * r
    sine = r - (multiply_add(z, multiply_add(-v, p, 0.5 * low), -low) + v * 1.66666666666666324348e-01)

    p = multiply_add(
        z, multiply_add(z, 2.48015872894767294178e-05, -1.38888888888741095749e-03), 4.16666666666666019037e-02
    )
    p2 = multiply_add(
        z, multiply_add(z, -1.13596475577881948265e-11, 2.08757232129817482790e-09), -2.75573143513906633035e-07
    )
    p = z * multiply_add(w * z, p2, p)
    half = 0.5 * z
    one = 1.0 - half
    cosine = one + (((1.0 - one) - half) + multiply_add(z, p, -r * low))

    if not abs(x) <= LARGEST_ANGLE:
        return np.nan, np.nan
    quadrant = np.int64(turns) & 3
    odd = (quadrant & 1) != 0
    s, c = (cosine, sine) if odd else (sine, cosine)
    s = -s if quadrant >= 2 else s
    c = -c if quadrant == 1 or quadrant == 2 else c
    return s, c


def sine_and_cosine(x: Any) -> Any:
    """Return (sin x, cos x) in a kernel, of a real angle up to `LARGEST_ANGLE` (nan beyond) or of a complex one."""
    raise NotImplementedError("sine_and_cosine is for compiled kernels")


@overload(sine_and_cosine, inline="never", jit_options={"forceinline": True})
def _choose_sine_and_cosine(x):
    if isinstance(x, types.Complex):
        return lambda x: (np.sin(x), np.cos(x))
    return lambda x: _sine_and_cosine(x + 0.0)
