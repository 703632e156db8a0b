"""Compiled code as it is kept in files, and as it is loaded.

A file has the machine code of a kernel and LLVM's bitcode, from which the kernel is compiled into others. numba parses
the bitcode of all that it loads; here it is parsed once another kernel that calls this one is compiled, which a process
that finds all kernels compiled never does.
"""

# numba has no types, and fills its classes in at run time.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from typing import Any, NamedTuple

import llvmlite.binding as llvm
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompileResult


class CompiledCode(NamedTuple):
    """The compiled code of one kernel for one set of argument types.

    Attributes
    ----------
    symbols : frozenset of str
        Names of the functions and variables that the machine code defines.
    parts : tuple
        What numba reduces a result of compilation to; the machine code and the bitcode are in the first.
    """

    symbols: frozenset[str]
    parts: tuple[Any, ...]


class _LoadedLibrary(JITCodeLibrary):
    """A library from a file, whose bitcode is parsed when it is linked into another library."""

    bitcode: bytes

    def _get_module_for_linking(self) -> Any:
        if self._shared_module is None:
            self._shared_module = llvm.parse_bitcode(self.bitcode)
        return self._shared_module


class _Loader:
    """Stands for a target whose libraries are loaded, in the call in which numba restores a result of compilation."""

    def __init__(self, target: Any, symbols: frozenset[str]) -> None:
        self._target = target
        self._symbols = symbols

    def __getattr__(self, name: str) -> Any:
        return getattr(self._target, name)

    def codegen(self) -> _Loader:
        return self

    def unserialize_library(self, data: Any) -> _LoadedLibrary:
        codegen = self._target.codegen()
        name, _, (machine_code, bitcode) = data
        library = _LoadedLibrary(codegen, name)
        library.bitcode = bitcode
        library.enable_object_caching()
        library._set_compiled_object(machine_code)
        library._finalize_final_module()
        codegen._engine._defined_symbols |= self._symbols
        return library


def take_code(result: Any) -> CompiledCode:
    """Return what is kept of a result of compilation."""
    module = result.library._get_module_for_linking()
    named = (*module.functions, *module.global_variables)
    return CompiledCode(frozenset(value.name for value in named if not value.is_declaration), result._reduce())


def load_code(target: Any, code: CompiledCode) -> Any:
    """Return the result of compilation of which code was kept, with its machine code ready to be called."""
    result = CompileResult._rebuild(_Loader(target, code.symbols), *code.parts)
    return result._replace(target_context=target)
