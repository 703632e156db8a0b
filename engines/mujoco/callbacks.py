"""Install compiled callbacks in MuJoCo while blocks need them: MuJoCo has one set per process.

Several blocks may be open at once, each for a state of its own. The first one installs the callbacks and the last one
restores what was there. A control callback of the user is called first in every evaluation of the dynamics, whether it
was set before the block or inside it.
"""

# MuJoCo's compiled bindings carry no types.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock

import mujoco
import numpy as np

from ..engine import EngineError
from . import compiled
from .library import collision_slot, control_slot

REPLACED = (
    "MuJoCo's control callback was replaced inside the block, so that evaluations were missed; "
    "set your own before the block, which calls it"
)
_lock = Lock()
_owners: dict[int, int] = {}  # board's number by the address of the state


@contextmanager
def claim_board(data: mujoco.MjData, kind: int) -> Iterator[np.ndarray]:
    """Let MuJoCo call compiled functions inside the block, and yield an empty blackboard (1,) for a state.

    The callbacks do nothing for the state until its address is on the blackboard.

    Parameters
    ----------
    data : mujoco.MjData
    kind : int
        `compiled.CONTACTS`, `ROLLING` or `WATCHING`.

    Raises
    ------
    EngineError
        If the state has a block already or there are too many blocks; at the end of a block without exact contacts, if
        the control callback was replaced inside it.
    """
    with _lock:
        number = _claim(data)
        board = compiled.boards[number : number + 1]
        board[:] = np.zeros(1, compiled.BLACKBOARD)
        board["kind"] = kind
    try:
        yield board
        # Exact contacts put the callback back before it is missed.
        if kind != compiled.CONTACTS and control_slot().value != compiled.control.address:
            raise EngineError(REPLACED)
    finally:
        with _lock:
            board["model"] = board["data"] = 0
            del _owners[data._address]
            _keep_callbacks() if _owners else _restore_callbacks()


def find_board(data: mujoco.MjData) -> np.ndarray:
    """Return the blackboard (1,) of a state whose block is open.

    Raises
    ------
    EngineError
        If there is no such block.
    """
    number = _owners.get(data._address)
    if number is None:
        raise EngineError("no block of wheels is open for this state")
    return compiled.boards[number : number + 1]


def _claim(data: mujoco.MjData) -> int:
    if data._address in _owners:
        raise EngineError("this state is in a block of wheels already; one must end before the next")
    free = set(range(compiled.BOARD_COUNT)) - set(_owners.values())
    if not free:
        raise EngineError(f"{compiled.BOARD_COUNT} blocks of wheels are open in this process; there cannot be more")
    number = min(free)
    if not _owners:
        _install_callbacks()
    compiled.header["count"] = max(number + 1, int(compiled.header["count"][0]))
    _owners[data._address] = number
    return number


def _install_callbacks() -> None:
    control, collision = control_slot(), collision_slot()
    head = compiled.header[0]
    head["count"], head["control"] = 0, compiled.control.address
    head["control_before"], head["collision"] = control.value or 0, collision.value
    head["control_at"] = ctypes.addressof(control)
    # MuJoCo's bindings keep a Python callback when its pointer is replaced here, and it stays callable.
    collision.value, control.value = compiled.touch.address, compiled.control.address


def _keep_callbacks() -> None:
    control = control_slot()
    if control.value != compiled.control.address:
        compiled.header["control_before"], control.value = control.value or 0, compiled.control.address


def _restore_callbacks() -> None:
    control, collision, head = control_slot(), collision_slot(), compiled.header[0]
    # What somebody else has set meanwhile stays.
    if control.value == compiled.control.address:
        control.value = int(head["control_before"]) or None
    if collision.value == compiled.touch.address:
        collision.value = int(head["collision"])
