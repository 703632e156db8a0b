"""Compilation of kernels by numba, with compiled code kept on disk by `cache`."""

# numba has no types for its caches.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any
from weakref import WeakSet

import numba as nb
from numba.core import event, sigutils, types
from numba.core.ccallback import CFunc
from numba.core.dispatcher import Dispatcher
from numba.extending import typeof_impl

from .cache import KernelCache, is_cacheable


class _CompilationCount(event.Listener):
    """Count of the kernels that numba compiles, not of those that it loads from the disk.

    numba compiles one at a time, with those that it calls inside it.

    Attributes
    ----------
    kernels : WeakSet
        All that have been declared.
    compiled : WeakSet
        Those compiled in this process, for one set of argument types at least.
    depth : int
        Number of kernels that are being compiled, each one called by the one before.
    """

    def __init__(self) -> None:
        self.kernels: WeakSet[Any] = WeakSet()
        self.compiled: WeakSet[Any] = WeakSet()
        self.depth = 0

    def on_start(self, event: Any) -> None:
        self.depth += event.data["dispatcher"] in self.kernels

    def on_end(self, event: Any) -> None:
        kernel = event.data["dispatcher"]
        if kernel in self.kernels:
            self.depth -= 1
            self.compiled.add(kernel)
            if event.data["args"] not in kernel.overloads:  # an error: there is nothing to save
                kernel._cache.release()


_count = _CompilationCount()
event.register("numba:compile", _count)


def find_compilation() -> tuple[int, int] | None:
    """Return how far the compilation of kernels is, for telling a user who waits.

    Returns
    -------
    tuple of int, or None
        How many kernels have been compiled in this process, and how many there are in the modules that are loaded, not
        all of which are needed; None if none is being compiled.
    """
    return (len(_count.compiled), len(_count.kernels)) if _count.depth > 0 else None


def jit(function: Callable[..., Any]) -> Any:
    """Compile a kernel on its first call for each set of argument types."""
    return _declare(nb.njit(error_model="numpy")(function))


def jit_released(function: Callable[..., Any]) -> Any:
    """Compile a kernel as `jit` does; it releases the interpreter's lock, so that threads can share its work."""
    return _declare(nb.njit(error_model="numpy", nogil=True)(function))


def jit_inline(function: Callable[..., Any]) -> Any:
    """Compile a kernel as `jit` does, and always inline it.

    For parts of one function that are separate only for readability: a call that passes a dozen tuples through
    memory costs as much as the arithmetic in it (measured: a quarter of the right-hand side).
    """
    return _declare(nb.njit(error_model="numpy", forceinline=True)(function))


def _declare(kernel: Any) -> Any:
    """Keep a kernel's compiled code on disk, count it as one that may be compiled, and return it."""
    if isinstance(kernel, Dispatcher) and is_cacheable(kernel.py_func):  # no dispatcher with NUMBA_DISABLE_JIT
        kernel._cache = KernelCache(kernel.py_func)
    _count.kernels.add(kernel)
    return kernel


class _Callback(CFunc):
    """A C callback that keeps its type as an argument of kernels, which numba would make anew for every call."""

    @cached_property
    def numba_type(self) -> types.FunctionType:
        """Type of the callback as a first-class function."""
        return types.FunctionType(self._sig)


@typeof_impl.register(_Callback)
def _typeof_callback(callback: _Callback, context: Any) -> types.FunctionType:
    return callback.numba_type


def compile_callback(signature: Any, cache: bool = True, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Make a decorator that compiles a function to a C callback.

    Parameters
    ----------
    signature : numba signature
        Types of the result and the arguments.
    cache : bool
        Whether compiled code is kept on disk; False for a function that is made at run time. That of a function
        whose sources are in no file is not kept.
    **options
        Further options of `numba.cfunc`.
    """

    def compile_function(function: Callable[..., Any]) -> Any:
        callback = _Callback(function, sigutils.normalize_signature(signature), locals={}, options=options)
        if cache and is_cacheable(function):
            callback._cache = KernelCache(function)
        try:
            callback.compile()
        finally:
            if isinstance(callback._cache, KernelCache):
                callback._cache.release()
        return callback

    return compile_function
