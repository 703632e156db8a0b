"""MuJoCo's shared library: its C functions for compiled code, its control callback and its collision functions."""

# MuJoCo's compiled bindings carry no types.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import mujoco
import numpy as np
from numpy.lib.stride_tricks import as_strided

from ..engine import EngineError

_GEOM_TYPES = 9  # mjNGEOMTYPES, the table's width
_CALLBACKS = ("control", "passive", "contactfilter", "sensor", "act_dyn", "act_gain", "act_bias")
_PATTERNS = ("libmujoco.so*", "libmujoco*.dylib", "mujoco.dll")


@cache
def load_library() -> ctypes.CDLL:
    """Return the library that MuJoCo's Python package has loaded.

    Raises
    ------
    EngineError
        If it is not in the package's folder.
    """
    folder = Path(mujoco.__file__).parent
    found = [path for pattern in _PATTERNS for path in sorted(folder.glob(pattern))]
    if not found:
        raise EngineError(f"no library of MuJoCo in {folder}; reinstalling the package mujoco restores it")
    return ctypes.CDLL(str(found[0]))


def announce_collision(*names: str) -> None:
    """Make C functions of MuJoCo known to the linker of compiled code.

    Raises
    ------
    EngineError
        If the library lacks one of them.
    """
    for name in names:
        try:
            function = getattr(load_library(), name)
        except AttributeError as error:
            raise EngineError(f"MuJoCo {mujoco.__version__} has no function {name}; MuJoCo 4.0 has") from error
        llvm.add_symbol(name, ctypes.cast(function, ctypes.c_void_p).value)


def collision_slot() -> Any:
    """Return MuJoCo's pointer to the collision function of planes with cylinders; its ``value`` can be set.

    Raises
    ------
    EngineError
        If the library has no such table.
    """
    index = int(mujoco.mjtGeom.mjGEOM_PLANE) * _GEOM_TYPES + int(mujoco.mjtGeom.mjGEOM_CYLINDER)
    try:
        table = (ctypes.c_void_p * _GEOM_TYPES**2).in_dll(load_library(), "mjCOLLISIONFUNC")
    except ValueError as error:
        raise EngineError(f"MuJoCo {mujoco.__version__} has no table mjCOLLISIONFUNC; MuJoCo 4.0 has") from error
    return ctypes.c_void_p.from_buffer(table, index * ctypes.sizeof(ctypes.c_void_p))


def control_slot() -> Any:
    """Return MuJoCo's pointer to the control callback; its ``value`` can be set.

    Raises
    ------
    EngineError
        If the library has no such pointer.
    """
    return _callback_slot("control")


def read_energy(data: mujoco.MjData) -> np.ndarray:
    """Return potential and kinetic energy, shape (2,) [J], as MuJoCo has computed them last.

    Before MuJoCo 3.1.4 its view of them has a stride of zero, and shows the potential energy twice.
    """
    energy = data.energy
    return energy if energy.strides[0] else as_strided(energy, (2,), (energy.itemsize,))


@contextmanager
def callbacks_set_aside() -> Iterator[None]:
    """Take the user's callbacks out of MuJoCo inside the block: those in Python fail while a model is compiled."""
    slots = [_callback_slot(name) for name in _CALLBACKS]
    before = [slot.value for slot in slots]
    try:
        for slot in slots:
            slot.value = None
        yield
    finally:
        for slot, value in zip(slots, before, strict=True):
            slot.value = value


def _callback_slot(name: str) -> Any:
    try:
        return ctypes.c_void_p.in_dll(load_library(), f"mjcb_{name}")
    except ValueError as error:
        raise EngineError(f"MuJoCo {mujoco.__version__} has no pointer mjcb_{name}; MuJoCo 4.0 has") from error
