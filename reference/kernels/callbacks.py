"""C callbacks whose compiled code is kept on disk by `cache`.

Only for a numba that has all `internals`.
"""

# numba has no types.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from functools import cached_property
from typing import Any

from numba.core.ccallback import CFunc
from numba.extending import typeof_impl

from .callback_type import CallbackType
from .loading import connect_environments


class Callback(CFunc):
    """A C callback that kernels take as its address."""

    def _compile_uncached(self) -> Any:
        return connect_environments(super()._compile_uncached())

    @cached_property
    def numba_type(self) -> CallbackType:
        """Type of the callback as an argument."""
        return CallbackType(self._sig)


@typeof_impl.register(Callback)
def _typeof_callback(callback: Callback, context: Any) -> CallbackType:
    return callback.numba_type
