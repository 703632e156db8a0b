"""Compilation of kernels by numba, with compiled code kept on disk by `cache`."""

# numba has no types for its caches.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any
from weakref import WeakSet

import numba as nb
from numba.core import config, event

from .cache import KernelCache, is_cacheable
from .internals import find_missing_internals

# Whether code is compiled and kept by the suite's own dispatchers; otherwise numba does it all, with its own cache.
OWN = not find_missing_internals()
if OWN or TYPE_CHECKING:
    from .keeping import compile_kept_callback, declare_kept_kernel


class _CompilationCount(event.Listener):
    """Count of the kernels that numba compiles, not of those that it loads from the disk.

    numba compiles one at a time, with those that it calls inside it.

    Attributes
    ----------
    kernels : WeakSet
        The functions of all that have been declared.
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
        self.depth += event.data["dispatcher"].py_func in self.kernels

    def on_end(self, event: Any) -> None:
        kernel = event.data["dispatcher"]
        if kernel.py_func in self.kernels:
            self.depth -= 1
            self.compiled.add(kernel.py_func)
            if event.data["args"] not in kernel.overloads and isinstance(kernel._cache, KernelCache):
                kernel._cache.release()  # an error: there is nothing to save


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
    return _declare(function)


def jit_released(function: Callable[..., Any]) -> Any:
    """Compile a kernel as `jit` does; it releases the interpreter's lock, so that threads can share its work."""
    return _declare(function, nogil=True)


def jit_inline(function: Callable[..., Any]) -> Any:
    """Compile a kernel as `jit` does, and always inline it.

    For parts of one function that are separate only for readability: a call that passes a dozen tuples through
    memory costs as much as the arithmetic in it (measured: a quarter of the right-hand side).
    """
    return _declare(function, forceinline=True)


def _declare(function: Callable[..., Any], **options: Any) -> Any:
    """Return a kernel, which counts as one that may be compiled and keeps its compiled code on disk."""
    if config.DISABLE_JIT:
        return function
    options |= {"error_model": "numpy"}
    if OWN:
        kernel = declare_kept_kernel(function, options)
    else:
        kernel = nb.njit(cache=is_cacheable(function), **options)(function)
    _count.kernels.add(function)
    return kernel


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
        if OWN:
            return compile_kept_callback(function, signature, cache, options)
        return nb.cfunc(signature, cache=cache and is_cacheable(function), **options)(function)

    return compile_function
