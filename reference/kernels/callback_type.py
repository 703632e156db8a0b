"""The type of a C callback as an argument of kernels.

numba passes one as a first-class function: to find out its type and address takes longer than many a kernel, and a call
through it checks for a Python object first. Here a callback is its address, with a type that has its signature.
"""

# numba has no types.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.datamodel import models
from numba.core.typing.templates import signature
from numba.extending import NativeValue, lower_builtin, register_model, unbox


class CallbackType(types.Callable):
    """The type of a C callback, which compiled code calls as any function.

    Parameters
    ----------
    signature : numba signature
        Types of its result and arguments.
    """

    def __init__(self, signature: Any) -> None:
        self.signature = signature
        super().__init__(name=f"Callback[{signature}]")

    def get_call_type(self, context: Any, args: Any, kws: Any) -> Any:
        """Return the signature of a call, for numba: arguments are converted to its types."""
        if kws or len(args) != len(self.signature.args):
            return None
        return signature(self.signature.return_type, *self.signature.args, recvr=self)

    def get_call_signatures(self) -> tuple[list[Any], bool]:
        """Return the signatures that a call may have, for numba."""
        return [self.signature], False

    def get_impl_key(self, sig: Any) -> Any:
        """Return what numba finds `_call_callback` by."""
        return type(self)


# A pointer that is nobody's to free.
register_model(CallbackType)(models.OpaqueModel)


@lower_builtin(CallbackType, CallbackType, types.VarArg(types.Any))
def _call_callback(context, builder, called, values):
    """Call a callback with arguments that it borrows."""
    address, *arguments = values
    kinds = [context.get_value_type(kind) for kind in called.args[1:]]
    pointer = ir.FunctionType(context.get_value_type(called.return_type), kinds).as_pointer()
    return builder.call(builder.bitcast(address, pointer), arguments)


@unbox(CallbackType)
def _unbox_callback(_, callback, c):
    """Return the address of a callback, which Python has as a whole number."""
    address = c.pyapi.object_getattr_string(callback, "address")
    value = c.pyapi.long_as_voidptr(address)
    c.pyapi.decref(address)
    return NativeValue(value, is_error=cgutils.is_null(c.builder, value))
