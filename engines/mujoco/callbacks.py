"""Install compiled callbacks in MuJoCo temporarily and for one user at a time: MuJoCo has one set per process."""

# MuJoCo's compiled bindings carry no types.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock
from typing import Any

import mujoco

from ..engine import EngineError
from .compiled import board
from .library import collision_slot

_in_use = Lock()


@contextmanager
def install_callbacks(control: Any, collision: Any = None) -> Iterator[None]:
    """Let MuJoCo call compiled functions inside the block, and restore the previous callbacks afterwards.

    They are restored also where the block ends with an exception.

    Parameters
    ----------
        control : numba cfunc
            Called in every evaluation of the dynamics, after MuJoCo has computed its constraints and bias forces.
        collision : numba cfunc, optional
            Called for each pair of a plane and a cylinder.

    Raises
    ------
        EngineError
            If callbacks are in use already, by this package or by other code in this process.
    """
    if not _in_use.acquire(blocking=False):
        raise EngineError("another model with compiled callbacks runs in this process; one must end before the next")
    try:
        if mujoco.get_mjcb_control() is not None:
            raise EngineError("MuJoCo has a control callback already; mujoco.set_mjcb_control(None) removes it")
        slot = collision_slot()
        before = slot.value
        try:
            if collision is not None:
                board["collision"] = before
                slot.value = ctypes.cast(collision.ctypes, ctypes.c_void_p).value
            mujoco.set_mjcb_control(control.ctypes)
            yield
        finally:
            mujoco.set_mjcb_control(None)
            slot.value = before
    finally:
        _in_use.release()
