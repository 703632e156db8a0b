"""Compiled code as it is kept in files, and as it is loaded.

A file has the machine code of a kernel and LLVM's bitcode, from which the kernel is compiled into others. numba parses
the bitcode of all that it loads; here it is parsed once another kernel that calls this one is compiled, which a process
that finds all kernels compiled never does. Nor does such a process need what numba imports before it compiles, the
implementations of all functions that it knows and SciPy's linear algebra: half of the time that numba takes to start.
"""

# numba has no types, and fills its classes in at run time.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import re
from collections import Counter
from functools import cache
from typing import Any, NamedTuple

import llvmlite.binding as llvm
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompileResult
from numba.core.runtime import _nrt_python

_ENVIRONMENT = re.compile(r'@"?(_ZN08NumbaEnv[\w.$]*)')


class CompiledCode(NamedTuple):
    """The compiled code of one kernel for one set of argument types.

    Attributes
    ----------
    defined : tuple of str
        Names of the functions that the machine code defines.
    needed : tuple of str
        Names of the functions and variables that it needs and does not define.
    parts : tuple
        What numba reduces a result of compilation to; the machine code and the bitcode are in the first.
    """

    defined: tuple[str, ...]
    needed: tuple[str, ...]
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

    def __init__(self, target: Any, code: CompiledCode) -> None:
        self._target = target
        self._code = code

    def __getattr__(self, name: str) -> Any:
        return getattr(self._target, name)

    def codegen(self) -> _Loader:
        return self

    def unserialize_library(self, data: Any) -> _LoadedLibrary:
        codegen = self._target.codegen()
        engine = codegen._engine
        _add_runtime_symbols()
        if any(
            llvm.address_of_symbol(name) is None and name not in engine._defined_symbols for name in self._code.needed
        ):
            self._target.refresh()  # numba's further libraries have it, and LLVM would end the process without it
        name, _, (machine_code, bitcode) = data
        library = _LoadedLibrary(codegen, name)
        library.bitcode = bitcode
        library.enable_object_caching()
        library._set_compiled_object(machine_code)
        library._finalize_final_module()
        engine._defined_symbols.update(self._code.defined)
        return library


def take_code(result: Any) -> CompiledCode:
    """Return what is kept of a result of compilation."""
    module = result.library._get_module_for_linking()
    functions = list(module.functions)
    # The annotated source, for people to read, is as long as the machine code.
    *parts, environments = result._replace(type_annotation="")._reduce()
    # Those of functions that were compiled into this one are declared, and mostly used by nothing.
    mentions = Counter(_ENVIRONMENT.findall(str(module)))
    used = tuple(environment for environment in environments if mentions[environment.env_name] > 1)
    return CompiledCode(
        defined=tuple(function.name for function in functions if not function.is_declaration),
        needed=tuple(
            value.name
            for value in (*functions, *module.global_variables)
            if value.is_declaration and not value.name.startswith("llvm.")
        ),
        parts=(*parts, used),
    )


def load_code(target: Any, code: CompiledCode) -> Any:
    """Return the result of compilation of which code was kept, with its machine code ready to be called."""
    result = CompileResult._rebuild(_Loader(target, code), *code.parts)
    return result._replace(target_context=target)


@cache
def _add_runtime_symbols() -> None:
    """Tell LLVM where numba's functions for memory are.

    numba does so as it compiles its further functions for memory; the machine code in files brings its own of these.
    """
    for name, address in _nrt_python.c_helpers.items():
        llvm.add_symbol(name if name.startswith("_") else f"NRT_{name}", address)
