"""Compiled code as it is kept in files, and as it is loaded.

Loading needs little of numba. Before it compiles, numba imports the implementations of all functions that it knows, and
SciPy's linear algebra: half of the time that it takes to start. A process that finds all kernels compiled does without.
"""

# numba has no types, and fills its classes in at run time.
# pyright: reportAttributeAccessIssue=false, reportCallIssue=false

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import llvmlite.binding as llvm
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import compile_result
from numba.core.runtime import _nrt_python

_ENVIRONMENT = re.compile(r'@"?(_ZN08NumbaEnv[\w.$]*)')


class PartLibrary(JITCodeLibrary):
    """LLVM's bitcode of a kernel, to be linked into that of others, without machine code of its own.

    Attributes
    ----------
    bitcode : bytes or None
        If it is from a file; it is parsed when it is linked.
    """

    bitcode: bytes | None = None

    def _get_module_for_linking(self) -> Any:
        if self._shared_module is None and self.bitcode is not None:
            self._shared_module = llvm.parse_bitcode(self.bitcode)
        return super()._get_module_for_linking()

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True


class _Common(NamedTuple):
    """What is kept of any result of compilation.

    Attributes
    ----------
    name : str
        Of the library.
    description : numba FunctionDescriptor
    environment : numba Environment
        Globals and constants of the function.
    signature : numba signature
    preparations : tuple of callable
        To be called before the code is used.
    environments : tuple of numba Environment
        Those that the code refers to, of functions that were compiled into it too.
    """

    name: str
    description: Any
    environment: Any
    signature: Any
    preparations: tuple[Callable[[], object], ...]
    environments: tuple[Any, ...]


class MachineCode(NamedTuple):
    """The machine code of a kernel for one set of argument types, for calls from Python or C.

    Attributes
    ----------
    common : _Common
    code : bytes
        An object file.
    defined : tuple of str
        Names of the functions that the machine code defines.
    needed : tuple of str
        Names of the functions and variables that it needs and does not define.
    """

    common: _Common
    code: bytes
    defined: tuple[str, ...]
    needed: tuple[str, ...]

    @classmethod
    def take(cls, result: Any) -> MachineCode:
        """Return what is kept of a result of compilation."""
        module = result.library._final_module
        functions = list(module.functions)
        return cls(
            common=_take_common(result),
            code=result.library._get_compiled_object(),
            defined=tuple(function.name for function in functions if not function.is_declaration),
            needed=tuple(
                value.name
                for value in (*functions, *module.global_variables)
                if value.is_declaration and not value.name.startswith("llvm.")
            ),
        )

    def load(self, target: Any) -> Any:
        """Return the result of compilation of which code was kept, with the machine code ready to be called."""
        codegen = target.codegen()
        engine = codegen._engine
        for prepare in self.common.preparations:
            prepare()
        _add_runtime_symbols()
        if any(llvm.address_of_symbol(name) is None and name not in engine._defined_symbols for name in self.needed):
            target.refresh()  # what numba imports then may bring it; LLVM would end the process without it
        library = JITCodeLibrary(codegen, self.common.name)
        library.enable_object_caching()
        library._set_compiled_object(self.code)
        library._finalize_final_module()
        engine._defined_symbols.update(self.defined)
        entry_point = target.get_executable(library, self.common.description, self.common.environment)
        for environment in self.common.environments:
            codegen.set_env(environment.env_name, environment)
        return _restore(target, self.common, library, entry_point)


class Part(NamedTuple):
    """The bitcode of a kernel for one set of argument types, for kernels that call it.

    Attributes
    ----------
    common : _Common
    bitcode : bytes
    """

    common: _Common
    bitcode: bytes

    @classmethod
    def take(cls, result: Any) -> Part:
        """Return what is kept of a result of compilation."""
        return cls(_take_common(result), result.library._get_module_for_linking().as_bitcode())

    def load(self, target: Any) -> Any:
        """Return the result of compilation of which the bitcode was kept."""
        library = PartLibrary(target.codegen(), self.common.name)
        library.bitcode = self.bitcode
        library._finalized = True
        if hasattr(library, "_reload_init"):  # in numba 0.61, what calls a function does not prepare it
            library._reload_init.update(self.common.preparations)
        return _restore(target, self.common, library, object())


def find_environments(result: Any) -> tuple[Any, ...]:
    """Return the environments that the code of a result of compilation refers to.

    It declares those of all functions that were compiled into it as well, which mostly nothing uses.
    """
    result.library._ensure_finalized()
    mentions = Counter(_ENVIRONMENT.findall(str(result.library._final_module)))
    return tuple(env for env in result._find_referenced_environments() if mentions[env.env_name] > 1)


def connect_environments(result: Any) -> Any:
    """Let machine code find the environments of the parts that it was linked from, which are in no other machine code.

    Returns
    -------
    numba CompileResult
        With these environments, so that they live as long.
    """
    result.library._ensure_finalized()
    environments = find_environments(result)
    for environment in environments:
        result.library.codegen.set_env(environment.env_name, environment)
    return result._replace(referenced_envs=environments)


def _take_common(result: Any) -> _Common:
    # For the compilation only, and not always possible to write to a file.
    result.fndesc.typemap = result.fndesc.calltypes = None
    return _Common(
        name=result.library.name,
        description=result.fndesc,
        environment=result.environment,
        signature=result.signature,
        preparations=tuple(result.reload_init),
        environments=find_environments(result),
    )


def _restore(target: Any, common: _Common, library: Any, entry_point: Any) -> Any:
    return compile_result(
        target_context=target,
        typing_context=target.typing_context,
        library=library,
        environment=common.environment,
        entry_point=entry_point,
        fndesc=common.description,
        type_annotation="",
        signature=common.signature,
        objectmode=False,
        lifted=(),
        reload_init=list(common.preparations),
        referenced_envs=common.environments,
    )


@cache
def _add_runtime_symbols() -> None:
    """Tell LLVM where numba's functions for memory are.

    numba does so as it compiles its further functions for memory; the machine code in files brings its own of these.
    """
    for name, address in _nrt_python.c_helpers.items():
        llvm.add_symbol(name if name.startswith("_") else f"NRT_{name}", address)
