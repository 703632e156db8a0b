"""Copies between arrays.

numba compiles ``a[:] = b`` together with the text of the error for arrays that do not fit, and with all functions for
text that this takes: seconds where it is the first such assignment, and tens of milliseconds in each kernel after.
"""

from __future__ import annotations

from .compilation import jit_inline


@jit_inline
def copy_array(source, target):
    """Fill ``target`` (n,) with the first n elements of ``source``."""
    for i in range(len(target)):
        target[i] = source[i]
