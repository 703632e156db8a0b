"""Three-vectors as tuples: they stay in registers, so a kernel allocates no memory for them."""

from __future__ import annotations

from .compilation import jit
from .fused import multiply_add


@jit
def add(a, b):
    """Return the sum a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@jit
def subtract(a, b):
    """Return the difference a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@jit
def scale(s, a):
    """Return the product s a."""
    return s * a[0], s * a[1], s * a[2]


@jit
def combine(s, a, t, b):
    """Return the linear combination s a + t b."""
    return multiply_add(t, b[0], s * a[0]), multiply_add(t, b[1], s * a[1]), multiply_add(t, b[2], s * a[2])


@jit
def dot(a, b):
    """Return the scalar product a . b."""
    return multiply_add(a[2], b[2], multiply_add(a[1], b[1], a[0] * b[0]))


@jit
def cross(a, b):
    """Return the vector product a x b."""
    return (
        multiply_add(a[1], b[2], -a[2] * b[1]),
        multiply_add(a[2], b[0], -a[0] * b[2]),
        multiply_add(a[0], b[1], -a[1] * b[0]),
    )
