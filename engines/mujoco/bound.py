"""Kernels that are bound to their arguments, for calls in every step of a ride."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numba import typeof

_compiled: dict[tuple[Any, ...], Any] = {}


def bind_kernel(kernel: Any, *arguments: Any) -> Callable[[], Any]:
    """Return a function without parameters that calls a compiled kernel with some arguments.

    The types of arguments are inferred here and not in the calls: numba takes longer for that than MuJoCo takes for a
    step.

    Parameters
    ----------
    kernel : numba's dispatcher
    *arguments
        Arrays, compiled functions of surfaces, which have one signature, and named tuples whose fields always have the
        same types.
    """
    key = kernel, *(_describe_type(argument) for argument in arguments)
    if key not in _compiled:
        _compiled[key] = kernel.compile(tuple(typeof(argument) for argument in arguments))
    return partial(_compiled[key], *arguments)


def _describe_type(argument: Any) -> Any:
    """Return what determines numba's type of an argument; numba's own inference takes 10 us for a function."""
    if isinstance(argument, np.ndarray):
        flags = argument.flags
        return argument.dtype, argument.ndim, flags.c_contiguous, flags.f_contiguous, flags.writeable, flags.aligned
    return type(argument)
