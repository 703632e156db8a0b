"""Calls of a surface's compiled function.

It is a C callback (`compilation.compile_callback`), which numba calls directly if its type is the suite's own
(`callback_type`). Where numba keeps the compiled code, or a kernel has the function from a struct, it is a first-class
function. That is called through a check for a Python object in its place, with a reference to the array of parameters
counted before and after each call, atomically. Surfaces borrow their parameters, so neither is needed.
"""

# numba fills its types in at run time.
# pyright: reportAttributeAccessIssue=false, reportCallIssue=false

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, overload


@intrinsic
def _call_callback(typing_context, function, x, y, parameters):  # pyright: ignore[reportUnusedParameter]
    """Call the C callback of a first-class function, without a reference to the array of parameters."""
    signature = function.signature

    def generate(context, builder, _, values):
        callback = cgutils.create_struct_proxy(function)(context, builder, value=values[0])
        arguments = [context.get_value_type(kind) for kind in signature.args]
        pointer = ir.FunctionType(context.get_value_type(signature.return_type), arguments).as_pointer()
        return builder.call(builder.bitcast(callback.c_addr, pointer), values[1:])

    return signature.return_type(function, *signature.args), generate


def evaluate_surface(function: Any, x: Any, y: Any, parameters: Any) -> Any:
    """Return (f, fx, fy, fxx, fxy, fyy) at (x, y) in a kernel; ``function`` that of a surface, compiled."""
    raise NotImplementedError("evaluate_surface is for compiled kernels")


@overload(evaluate_surface, inline="never", jit_options={"forceinline": True})
def _choose_surface_call(function, x, y, parameters):
    if isinstance(function, types.FunctionType):
        return lambda function, x, y, parameters: _call_callback(function, x, y, parameters)
    return lambda function, x, y, parameters: function(x, y, parameters)
