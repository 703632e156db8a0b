"""The fused multiply-add, rounded once.

It is the instruction of the processor where there is one (x86-64 since 2013, all 64-bit ARM), and the C library's
`fma` elsewhere. It is written out and not left to the compiler, which may contract products and sums of one source
differently wherever it inlines them: so a kernel has the same bits in every caller.
"""

# numba fills its types in at run time.
# pyright: reportAttributeAccessIssue=false, reportCallIssue=false

from __future__ import annotations

from typing import Any

from numba import types
from numba.extending import intrinsic, overload


@intrinsic
def _fuse(typing_context, a, b, c):  # pyright: ignore[reportUnusedParameter]
    def generate(context, builder, signature, values):  # pyright: ignore[reportUnusedParameter]
        return builder.fma(*values)

    return types.float64(types.float64, types.float64, types.float64), generate


def multiply_add(a: Any, b: Any, c: Any) -> Any:
    """Return a b + c in a kernel: rounded once if all are real, by complex arithmetic otherwise."""
    raise NotImplementedError("multiply_add is for compiled kernels")


@overload(multiply_add, inline="never")
def _choose_multiply_add(a, b, c):
    if any(isinstance(number, types.Complex) for number in (a, b, c)):
        return lambda a, b, c: a * b + c
    return lambda a, b, c: _fuse(a, b, c)
