"""How far the compilation of kernels is, for those who wait for it."""

from __future__ import annotations

import sys

# Loaded by commands that need it. It is looked up here because its import, with numba's, takes half a second.
_COMPILATION = f"{__name__.partition('.scenarios.')[0]}.reference.kernels.compilation"


def describe_compilation() -> str | None:
    """Say how many kernels have been compiled; None if none is being compiled."""
    # The module may be there and still be at its imports.
    find_compilation = getattr(sys.modules.get(_COMPILATION), "find_compilation", None)
    found = None if find_compilation is None else find_compilation()
    if found is None:
        return None
    compiled, most = found
    return f"compiling kernels, once on this machine: {compiled} of at most {most}"
