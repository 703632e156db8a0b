"""The two forms of a kernel: as Python calls it, and as other kernels do.

numba compiles each function to machine code that Python and C can call, the ones that only others call as well. That
takes two fifths of its time, and the machine code is never run: others are compiled from the bitcode. Here a kernel is
compiled to machine code when Python calls it, and to bitcode when another kernel that calls it is compiled.
"""

# numba has no types.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

from numba.core.compiler import Compiler
from numba.core.dispatcher import _FunctionCompiler
from numba.core.registry import CPUDispatcher

from .cache import KernelCache
from .callbacks import Callback
from .loading import Part, PartLibrary, connect_environments


class _PartPipeline(Compiler):
    """numba's compiler, for a library that is linked into others."""

    def __init__(
        self, typing: Any, target: Any, library: Any, args: Any, return_type: Any, flags: Any, locals: Any
    ) -> None:
        library = PartLibrary(target.codegen(), "part")
        super().__init__(typing, target, library, args, return_type, flags, locals)


class _PartCompiler(_FunctionCompiler):
    """Compilation of a kernel to bitcode."""

    def _customize_flags(self, flags: Any) -> Any:
        flags.no_compile = flags.no_cpython_wrapper = flags.no_cfunc_wrapper = True
        return flags

    def _compile_core(self, args: Any, return_type: Any) -> Any:
        # The entry point stands for this function in the calls that numba compiles.
        result = super()._compile_core(args, return_type)._replace(entry_point=object())
        self.targetdescr.target_context.insert_user_function(result.entry_point, result.fndesc, [result.library])
        return result


class _Compiler(_FunctionCompiler):
    """Compilation of a kernel to machine code for Python."""

    def _customize_flags(self, flags: Any) -> Any:
        flags.no_cfunc_wrapper = True
        return flags

    def _compile_core(self, args: Any, return_type: Any) -> Any:
        return connect_environments(super()._compile_core(args, return_type))


class KernelPart(CPUDispatcher):
    """A kernel as other kernels call it.

    Parameters
    ----------
    py_func : callable
    locals : dict
    targetoptions : dict
        As those of numba's dispatchers, which are unpickled with them.
    """

    def __init__(self, py_func: Callable[..., Any], locals: dict[str, Any], targetoptions: dict[str, Any]) -> None:
        super().__init__(py_func, locals, targetoptions, _PartPipeline)
        self._compiler = _PartCompiler(py_func, self.targetdescr, targetoptions, locals, _PartPipeline)

    def add_overload(self, cres: Any) -> None:
        """Add what was compiled or loaded, for numba's compiler only: Python has nothing to call."""
        self.overloads[tuple(cres.signature.args)] = cres


class Kernel(CPUDispatcher):
    """A kernel as Python calls it.

    Parameters
    ----------
    py_func : callable
    locals : dict
    targetoptions : dict
        As those of numba's dispatchers, which are unpickled with them.

    """

    def __init__(self, py_func: Callable[..., Any], locals: dict[str, Any], targetoptions: dict[str, Any]) -> None:
        super().__init__(py_func, locals, targetoptions)
        self._compiler = _Compiler(py_func, self.targetdescr, targetoptions, locals, Compiler)

    @cached_property
    def part(self) -> KernelPart:
        """The kernel as other kernels call it; made when it is first compiled into one, which is mostly never."""
        part = KernelPart(self.py_func, self.locals, self.targetoptions)
        if isinstance(self._cache, KernelCache):
            part._cache = KernelCache(self.py_func, Part)
        return part

    def typeof_pyval(self, val: Any) -> Any:
        """Return the type of an argument that numba's compiled code does not know; that of a callback is kept."""
        return val.numba_type if type(val) is Callback else super().typeof_pyval(val)

    @property
    def _numba_type_(self) -> Any:
        """Type that numba gives this kernel in functions that it compiles."""
        return self.part._numba_type_
