"""Compilation of kernels by numba, with compiled code kept on disk by `cache`."""

# numba has no types for its caches.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any
from weakref import WeakSet

from numba.core import config, event, sigutils, types
from numba.core.ccallback import CFunc
from numba.extending import typeof_impl

from .cache import KernelCache, is_cacheable
from .dispatchers import Kernel, KernelPart, connect_environments
from .loading import MachineCode, Part


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
        self.depth += isinstance(event.data["dispatcher"], Kernel | KernelPart)

    def on_end(self, event: Any) -> None:
        kernel = event.data["dispatcher"]
        if isinstance(kernel, Kernel | KernelPart):
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


def _declare(function: Callable[..., Any], **options: bool) -> Any:
    """Return a kernel, which counts as one that may be compiled and keeps its compiled code on disk."""
    if config.DISABLE_JIT:
        return function
    kernel = Kernel(function, {}, {"nopython": True, "error_model": "numpy", **options})
    if is_cacheable(function):
        kernel._cache = KernelCache(function, MachineCode)
        kernel.part._cache = KernelCache(function, Part)
    _count.kernels.add(function)
    return kernel


class _Callback(CFunc):
    """A C callback that keeps its type as an argument of kernels, which numba would make anew for every call."""

    def _compile_uncached(self) -> Any:
        return connect_environments(super()._compile_uncached())

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
            callback._cache = KernelCache(function, MachineCode)
        try:
            callback.compile()
        finally:
            if isinstance(callback._cache, KernelCache):
                callback._cache.release()
        return callback

    return compile_function
