"""Surfaces of revolution z = g(r), r^2 = x^2 + y^2 = s, from the derivatives of their profiles.

As a function of s, which is analytic on the axis, z = G(s):

    grad z = 2 G' (x, y),    Hessian = 2 G' 1 + 4 G'' (x, y) (x, y)^T

As a function of r, with e = (x, y) / r the outward direction:

    grad z = g' e,    Hessian = (g' / r) 1 + (g'' - g' / r) e e^T
"""

from __future__ import annotations

import numpy as np

from .compilation import jit

_AXIS = 1e-60  # smaller s are on the axis: the complex step itself leaves s = -1e-60 there
_TIP = 1e-25  # larger slopes on the axis are those of a tip


@jit
def of_square(x, y, g, first, second):
    """Compute height, gradient and Hessian from G, G' and G'' at s = x^2 + y^2."""
    mixed = 4 * x * y * second
    return g, 2 * x * first, 2 * y * first, 2 * first + 4 * x * x * second, mixed, 2 * first + 4 * y * y * second


@jit
def of_radius(x, y, r, g, first, second):
    """Compute height, gradient and Hessian from g, g' and g'' at r; nan on the axis if there is a tip."""
    square = x * x + y * y
    if square.real > _AXIS:
        ratio, bend = first / r, (second - first / r) / square
    else:
        # g' / r tends to g''.
        ratio = second if abs(first.real) < _TIP else np.nan * second
        bend = 0 * second
    return g, ratio * x, ratio * y, ratio + bend * x * x, bend * x * y, ratio + bend * y * y
