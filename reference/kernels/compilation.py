"""Compilation of kernels by numba, with compiled code cached on disk.

numba renews a cached function when the function's own file changes, but not when a kernel that it calls from
another file does. The name of the cache folder therefore contains a fingerprint of all kernels, and of the files beside
a kernel that stands elsewhere in the package: a changed kernel starts a new folder, and so does another version of
numba. The folder is used only for the functions compiled here;
numba's settings are restored to those of the user's process after each of them.
"""

# numba fills its configuration in at run time.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import hashlib
import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any
from weakref import WeakSet

import numba as nb
from numba.core import config, event

_lock = threading.Lock()


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
        if event.data["dispatcher"] in self.kernels:
            self.depth -= 1
            self.compiled.add(event.data["dispatcher"])


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
    with _cache_folder_set(function):
        return _declare(nb.njit(cache=True, error_model="numpy")(function))


def jit_released(function: Callable[..., Any]) -> Any:
    """Compile a kernel as `jit` does; it releases the interpreter's lock, so that threads can share its work."""
    with _cache_folder_set(function):
        return _declare(nb.njit(cache=True, error_model="numpy", nogil=True)(function))


def jit_inline(function: Callable[..., Any]) -> Any:
    """Compile a kernel as `jit` does, and always inline it.

    For parts of one function that are separate only for readability: a call that passes a dozen tuples through
    memory costs as much as the arithmetic in it (measured: a quarter of the right-hand side).
    """
    with _cache_folder_set(function):
        return _declare(nb.njit(cache=True, error_model="numpy", forceinline=True)(function))


def _declare(kernel: Any) -> Any:
    """Count a kernel as one that may be compiled, and return it."""
    _count.kernels.add(kernel)
    return kernel


def compile_callback(signature: Any, cache: bool = True, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Make a decorator that compiles a function to a C callback.

    Parameters
    ----------
    signature : numba signature
        Types of the result and the arguments.
    cache : bool
        Whether compiled code is kept on disk; False for a function that is made at run time.
    **options
        Further options of `numba.cfunc`.
    """

    def compile_function(function: Callable[..., Any]) -> Any:
        with _cache_folder_set(function):
            return nb.cfunc(signature, cache=cache, **options)(function)

    return compile_function


@contextmanager
def _cache_folder_set(function: Callable[..., Any]) -> Iterator[None]:
    """Set numba's cache folder for a function; numba reads the setting only when a function is decorated."""
    with _lock:
        before = config.CACHE_DIR
        config.CACHE_DIR = _cache_folder(before, Path(function.__code__.co_filename).parent)
        try:
            yield
        finally:
            config.CACHE_DIR = before


@cache
def _cache_folder(chosen: str, folder: Path) -> str:
    """Return the folder for compiled code, below the one chosen through NUMBA_CACHE_DIR if there is one.

    ``folder`` is that of the kernel's file. Kernels call others in it only where it belongs to the package.
    """
    here = Path(__file__).parent
    digest = hashlib.sha256(nb.__version__.encode())
    package = here.parents[1]
    for place in [here] if folder == here or package not in folder.parents else [here, folder]:
        for source in sorted(place.glob("*.py")):
            digest.update(source.read_bytes())
    if chosen:
        parent = Path(chosen)
    elif os.access(here, os.W_OK):
        parent = here / "__pycache__"
    else:  # a package that an administrator has installed
        parent = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "velodrome"
    return str(parent / f"kernels-{digest.hexdigest()[:16]}")
