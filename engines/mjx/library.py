"""MJX, imported without the lines that it prints where its optional back end for NVIDIA GPUs is not installed."""

from __future__ import annotations

from contextlib import redirect_stdout
from io import StringIO

with redirect_stdout(StringIO()):
    from mujoco import mjx
    from mujoco.mjx._src.smooth import solve_m
    from mujoco.mjx._src.support import contact_force, jac_dot

__all__ = ["contact_force", "jac_dot", "mjx", "solve_m"]
