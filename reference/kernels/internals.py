"""The parts of numba that the kernels' own compilation and cache use, and that numba may change in any release.

Where one of them is missing or takes other arguments, `compilation` leaves everything to numba: the results are the
same, but kernels take longer to compile and to load.
"""

from __future__ import annotations

from importlib import import_module
from inspect import signature

# By module: a name, or a class and what is overridden, called or read of it.
_NAMES: dict[str, tuple[str, ...]] = {
    "numba.core.ccallback": ("CFunc._compile_uncached",),
    "numba.core.codegen": (
        "CPUCodeLibrary._finalize_dynamic_globals",
        "CPUCodeLibrary._finalize_final_module",
        "CPUCodeLibrary._get_compiled_object",
        "CPUCodeLibrary._get_module_for_linking",
        "CPUCodeLibrary._set_compiled_object",
        "CPUCodeLibrary._verify_declare_only_symbols",
        "CPUCodeLibrary.enable_object_caching",
        "CPUCodeLibrary.has_dynamic_globals",
        "JITCPUCodegen.magic_tuple",
        "JITCPUCodegen.set_env",
    ),
    "numba.core.compiler": ("CompileResult._find_referenced_environments", "compile_result"),
    "numba.core.cpu": ("CPUContext.get_executable", "CPUContext.insert_user_function", "CPUContext.refresh"),
    "numba.core.dispatcher": (
        "Dispatcher.add_overload",
        "Dispatcher.compile",
        "Dispatcher.get_call_template",
        "Dispatcher.get_overload",
        "Dispatcher.typeof_pyval",
    ),
    "numba.core.registry": ("CPUDispatcher._numba_type_",),
    "numba.core.runtime": ("_nrt_python.c_helpers",),
    "numba.core.serialize": ("dumps",),
}
# By module: a function or a method, and its parameters.
_PARAMETERS: dict[str, dict[str, tuple[str, ...]]] = {
    "numba.core.compiler": {
        "Compiler.__init__": ("self", "typingctx", "targetctx", "library", "args", "return_type", "flags", "locals"),
    },
    "numba.core.codegen": {"JITCodeLibrary.__init__": ("self", "codegen", "name")},
    "numba.core.cpu": {"CPUContext.get_executable": ("self", "library", "fndesc", "env")},
    "numba.core.dispatcher": {
        "Dispatcher.__init__": ("self", "py_func", "locals", "targetoptions", "pipeline_class"),
        "Dispatcher.typeof_pyval": ("self", "val"),
        "_FunctionCompiler.__init__": ("self", "py_func", "targetdescr", "targetoptions", "locals", "pipeline_class"),
        "_FunctionCompiler._compile_core": ("self", "args", "return_type"),
        "_FunctionCompiler._customize_flags": ("self", "flags"),
    },
}


def find_missing_internals() -> list[str]:
    """Return what the installed numba has not, or has with other parameters."""
    missing = [f"{module}.{name}" for module, names in _NAMES.items() for name in names if _find(module, name) is None]
    for module, functions in _PARAMETERS.items():
        for name, expected in functions.items():
            function = _find(module, name)
            if not callable(function) or tuple(signature(function).parameters) != expected:
                missing.append(f"{module}.{name}({', '.join(expected)})")
    return missing


def _find(module: str, name: str) -> object | None:
    """Return what a dotted name stands for in a module; None if there is no such thing."""
    try:
        found: object = import_module(module)
    except ImportError:
        return None
    for part in name.split("."):
        found = getattr(found, part, None)
    return found
