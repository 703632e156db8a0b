"""Kernels and callbacks whose compiled code is kept on disk by `cache`.

Only for a numba that has all `internals`.
"""

# numba has no types for its caches.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba.core import sigutils

from .cache import KernelCache, is_cacheable
from .callbacks import Callback
from .dispatchers import Kernel
from .loading import MachineCode


def declare_kept_kernel(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    """Return a kernel.

    Parameters
    ----------
    function : callable
        If its sources are in no file, compiled code is not kept.
    options : dict
        Of `numba.njit`.
    """
    kernel = Kernel(function, {}, {"nopython": True, **options})
    if is_cacheable(function):
        kernel._cache = KernelCache(function, MachineCode)
    return kernel


def compile_kept_callback(
    function: Callable[..., Any], signature: Any, cache: bool, options: dict[str, Any]
) -> Callback:
    """Compile a function to a C callback; for the parameters see `compilation.compile_callback`."""
    callback = Callback(function, sigutils.normalize_signature(signature), locals={}, options=options)
    if cache and is_cacheable(function):
        callback._cache = KernelCache(function, MachineCode)
    try:
        callback.compile()
    finally:
        if isinstance(callback._cache, KernelCache):
            callback._cache.release()
    return callback
