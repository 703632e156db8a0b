"""Find and check the memory layout of MuJoCo's structures before anything runs.

MuJoCo's Python views give the addresses of arrays that keep their place. Arrays in MuJoCo's arena move in
every step; for them the callbacks follow the pointers in `mjData`. The offsets of these pointers come from MuJoCo's own
description of its structures and are compared with the addresses of the views, so that a version of MuJoCo that
moves a field gives an error here and not a crash in a step.
"""

# MuJoCo's compiled bindings carry no types.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from ..engine import EngineError
from .library import callbacks_set_aside
from .releases import CONTACT_FORM, EDGES, is_present

_SIZES = {
    "mjtNum": 8,
    "double": 8,
    "mjtSize": 8,
    "size_t": 8,
    "uintptr_t": 8,
    "uint64_t": 8,
    "int": 4,
    "float": 4,
    "mjtBool": 1,
    "mjtByte": 1,
}
# The C functions that the callbacks call, with the parameters that MuJoCo must describe them with.
_CALLED = {
    "mj_jac": "const mjModel * | const mjData * | mjtNum * | mjtNum * | const mjtNum [3] | int",
    "mj_jacDot": "const mjModel * | const mjData * | mjtNum * | mjtNum * | const mjtNum [3] | int",
    "mj_solveM": "const mjModel * | mjData * | mjtNum * | const mjtNum * | int",
    "mj_fwdActuation": "const mjModel * | mjData *",
    "mj_fwdAcceleration": "const mjModel * | mjData *",
}
_OPTIONS = ("disableflags", "enableflags", "solver", "noslip_iterations")
# Fields of the structure that collision functions fill. Normal and tangent are the first rows of mjContact's frame.
_PRE_CONTACT = {"dist": 0, "pos": 8, "normal": 32, "tangent": 56}
_CONTACT_START = {"dist": 0, "pos": 8, "frame": 32}
# Two spheres sunk into a plane; raised by 1 m they have no contacts.
_PROBE = """<mujoco><option cone="elliptic"/><worldbody><geom type="plane" size="0 0 1"/>
<body pos="0 0 .09"><freejoint/><geom size=".1"/></body><body pos="1 0 .09"><freejoint/><geom size=".1"/></body>
</worldbody></mujoco>"""


@dataclass(frozen=True)
class Layout:
    """Offsets of fields in MuJoCo's structures [bytes].

    Attributes
    ----------
    data, contact : dict
        Offset by name of the fields of `mjData` and of `mjContact`.
    contact_size : int
        Size of `mjContact`.
    solutions, inverses : int
        Offsets of `mjData`'s counters of solutions, those of inverse dynamics included, and of inverse dynamics.
    """

    data: dict[str, int]
    contact: dict[str, int]
    contact_size: int
    solutions: int
    inverses: int


def _layout_error(what: str) -> EngineError:
    return EngineError(
        f"MuJoCo {mujoco.__version__} keeps {what} elsewhere than its description says; "
        "mujoco-native needs none of it, MuJoCo 4.0 has it in place"
    )


@cache
def _describe(part: str) -> Any:
    """Return a module of MuJoCo's description of its own structures.

    Raises
    ------
    EngineError
        If this release has none. That of another release which is installed beside it describes other structures.
    """
    try:
        module = import_module(f"mujoco.introspect.{part}")
    except ImportError:
        module = None
    own = Path(mujoco.__file__).parent
    if module is None or Path(str(module.__file__)).parent.parent != own:
        raise EngineError(
            f"MuJoCo {mujoco.__version__} has no description of its structures, mujoco.introspect; MuJoCo 3.3 has"
        )
    return module


def _type_size(kind: Any) -> tuple[int, int]:
    """Return size and alignment of a type [bytes]."""
    ast_nodes = _describe("ast_nodes")
    if isinstance(kind, ast_nodes.PointerType):
        size = ctypes.sizeof(ctypes.c_void_p)
        return size, size
    if isinstance(kind, ast_nodes.ArrayType):
        size, alignment = _type_size(kind.inner_type)
        return size * int(np.prod(kind.extents)), alignment
    if isinstance(kind, ast_nodes.ValueType):
        if kind.name in _SIZES:
            return _SIZES[kind.name], _SIZES[kind.name]
        if kind.name in _describe("enums").ENUMS:
            return 4, 4
        if kind.name in _describe("structs").STRUCTS:
            return _structure_layout(kind.name)[1:]
    raise EngineError(f"MuJoCo {mujoco.__version__} has a field of the unknown type {kind}")


@cache
def _structure_layout(name: str) -> tuple[dict[str, int], int, int]:
    """Return the offsets of a structure's fields, its size and its alignment, by the rules of C [bytes]."""
    offsets, at, widest = {}, 0, 1
    for field in _describe("structs").STRUCTS[name].fields:
        size, alignment = _type_size(field.type)
        at = -(-at // alignment) * alignment
        offsets[field.name] = at
        at, widest = at + size, max(widest, alignment)
    return offsets, -(-at // widest) * widest, widest


def _check_functions() -> None:
    if (refusal := EDGES.find_refusal("a knife edge")) is not None:
        raise EngineError(refusal)
    known = _describe("functions").FUNCTIONS
    for name, expected in _CALLED.items():
        parameters = known[name].parameters if name in known else ()
        if " | ".join(str(parameter.type) for parameter in parameters) != expected:
            raise EngineError(f"MuJoCo {mujoco.__version__} has another function {name}; MuJoCo 4.0 has the right one")
    new = is_present(CONTACT_FORM)
    name, fields = ("mjPreContact", _PRE_CONTACT) if new else ("mjContact", _CONTACT_START)
    found = _structure_layout(name)[0] if name in _describe("structs").STRUCTS else {}
    if not fields.items() <= found.items() or (new and len(found) != len(fields)):
        raise EngineError(f"MuJoCo {mujoco.__version__} takes contacts in another form; MuJoCo 4.0 has the right one")


def _check_state(layout: Layout, data: mujoco.MjData) -> None:
    """Compare the offsets with the addresses of a state's views."""
    base = data._address
    # This array is part of the structure itself: no memory is read before its offset is known to be right.
    if data.energy.ctypes.data != base + layout.data["energy"]:
        raise _layout_error("its state")
    for name in ("ncon", "nefc"):
        if ctypes.c_int.from_address(base + layout.data[name]).value != getattr(data, name):
            raise _layout_error(name)
    for name, offset in (("CONSTRAINT", layout.solutions), ("INVERSE", layout.inverses)):
        number = data.timer[int(getattr(mujoco.mjtTimer, f"mjTIMER_{name}"))].number
        if not 0 < number == ctypes.c_int.from_address(base + offset).value:
            raise _layout_error("its counters")
    views = {"qpos": data.qpos, "qvel": data.qvel, "geom_xpos": data.geom_xpos}
    if data.nefc:
        views |= {
            "efc_aref": data.efc_aref,
            "efc_KBIP": data.efc_KBIP,
            "efc_R": data.efc_R,
            "efc_type": data.efc_type,
            "efc_vel": data.efc_vel,
            "efc_pos": data.efc_pos,
            "efc_margin": data.efc_margin,
            "contact": data.contact.dist,
        }
    for name, view in views.items():
        if ctypes.c_void_p.from_address(base + layout.data[name]).value != view.ctypes.data:
            raise _layout_error(name)
    for name in ("frame", "includemargin", "friction", "geom", "efc_address") if data.ncon else ():
        view = getattr(data.contact, name)
        if view.ctypes.data - data.contact.dist.ctypes.data != layout.contact[name]:
            raise _layout_error(f"a contact's {name}")
        if view.strides[0] != layout.contact_size:
            raise _layout_error("its contacts")


def find_options(model: mujoco.MjModel) -> dict[str, int]:
    """Return the addresses of a model's options that blocks watch, by name.

    Raises
    ------
    EngineError
        If this version of MuJoCo has another layout than it describes.
    """
    offsets = _structure_layout("mjOption")[0]
    base = model.opt.gravity.ctypes.data - offsets["gravity"]
    found = {name: base + offsets[name] for name in _OPTIONS}
    for name, address in found.items():
        if ctypes.c_int.from_address(address).value != getattr(model.opt, name):
            raise _layout_error(f"the option {name}")
    return found


def _find_counter(name: str) -> int:
    """Return the offset in `mjData` of the number of calls that a timer has counted."""
    fields, size, _ = _structure_layout("mjTimerStat")
    return _structure_layout("mjData")[0]["timer"] + size * int(getattr(mujoco.mjtTimer, name)) + fields["number"]


@cache
def find_layout() -> Layout:
    """Find and check all offsets, once per process.

    Raises
    ------
    EngineError
        If this version of MuJoCo has another layout than it describes.
    """
    try:
        _check_functions()
        contact, contact_size, _ = _structure_layout("mjContact")
        layout = Layout(
            data=_structure_layout("mjData")[0],
            contact=contact,
            contact_size=contact_size,
            solutions=_find_counter("mjTIMER_CONSTRAINT"),
            inverses=_find_counter("mjTIMER_INVERSE"),
        )
        with callbacks_set_aside():
            model = mujoco.MjModel.from_xml_string(_PROBE)
            if not model._address:
                raise _layout_error("its model")
            for height in (0.0, 1.0):
                data = mujoco.MjData(model)
                data.qpos[[2, 9]] += height
                mujoco.mj_forward(model, data)
                mujoco.mj_inverse(model, data)
                _check_state(layout, data)
            # Numbers that no other field has.
            model.opt.disableflags, model.opt.enableflags, model.opt.noslip_iterations = 21, 5, 37
            find_options(model)
    except (AttributeError, KeyError) as error:
        raise EngineError(f"MuJoCo {mujoco.__version__} describes itself otherwise than 4.0: {error}") from error
    return layout
