"""Knife-edge wheels on curved ground for any MuJoCo model.

    <geom name="ground" type="plane" size="0 0 1"/>                            in the world
    <geom name="wheel" type="cylinder" size="0.3 0.001"/>                      on the wheel's body
    <pair geom1="ground" geom2="wheel" condim="3" margin="1e-3" gap="1e9"      in <contact>
          solref="0.05 1" solimp="0.9999 0.9999 0.001 0.5 2" friction="2 2 0 0 0"/>

    with knife_edges(model, data, Paraboloid(0.1), {"wheel": "ground"}) as contacts:
        mujoco.mj_step(model, data)

Inside the block the cylinder touches the ground z = f(x, y) as a circle without thickness does, at the
exact point of closest approach, with the exact normal, in every stage of every integrator. MuJoCo's
reference accelerations get the contact's own acceleration, which MuJoCo omits. Solver, friction cone and
lift-off stay MuJoCo's own. The plane only names the ground; its position does not matter. A wheel may hang on any
body of any tree. `stiffen` makes the rows harder than any impedance can:

    slip = R F / b,    gap = R F / k

with F the force on a row, R = efc_R its softness, b = 2 / (impedance time constant) and k its stiffness.

In every evaluation MuJoCo's solver starts from the forces of wheels that neither slide nor lift off, and inside the
block it may iterate as long as nearly rigid rows need. Where it stops at forces that are wrong, or MuJoCo leaves a
wheel out, the block ends with an error, which `EdgeContacts.check` raises earlier.

`rolling_forces` replaces MuJoCo's contacts by the exact forces of rolling without slip.

Several blocks may be open at once, in threads as well, one for each state. The user's control callback is called first;
under `rolling_forces` it must be set before the block. ``mj_inverse`` is not corrected.
"""

# MuJoCo's compiled bindings carry no types.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from numbers import Real
from typing import Any

import mujoco
import numpy as np

from ...reference.rim import rim_search
from ...reference.surface import Surface
from . import compiled, layout
from .callbacks import claim_board, find_board
from .convergence import WRONG, watch_state
from .edge_contacts import EdgeContacts
from .options import find_refused_option, watch_options
from .solver_limits import raise_solver_limits

ALL_AXES = (True, True, True)
# Numbers and pointers of `mjData` that the callbacks read anew in every evaluation.
_FOLLOWED = (
    *("ncon", "nefc", "contact", "efc_aref", "efc_KBIP", "efc_R"),
    *("efc_type", "efc_vel", "efc_pos", "efc_margin"),
)
# Largest tilt of a plane that counts as level [rad]; round-off in a quaternion is 1e-16.
LEVEL = 1e-9
# Largest product of the rate of stabilisation and the step at which slip, v' = -2 s v, and gaps,
# x" = -2 s x' - s^2 x, decay. RK4 is stable on the real axis down to -2.785, twice the product. MuJoCo's other methods
# take v += h a, x += h v, so that gaps begin to grow where 4 - 4 s h - (s h)^2 = 0, and slip at s h = 1.
FASTEST_RK4, FASTEST_EULER = 2.785 / 2, 2 * (2**0.5 - 1)


@contextmanager
def knife_edges(
    model: mujoco.MjModel, data: mujoco.MjData, surface: Surface, wheels: Mapping[str, str]
) -> Iterator[EdgeContacts]:
    """Let wheels touch a surface as knife edges.

    Parameters
    ----------
    model : mujoco.MjModel
        Each wheel's geom is a cylinder and paired with a plane; see the module's example. Inside the block its solver
        has room to iterate.
    data : mujoco.MjData
        The state that is stepped inside the block. Another state of the same model needs a block of its own.
    surface : Surface
    wheels : mapping
        Plane's geom name by wheel's geom name.

    Yields
    ------
    EdgeContacts
        Gaps, forces and the solver's residuals so far.

    Raises
    ------
    ValueError
        If a geom or pair is missing or of the wrong kind, or an option is set with which the forces cannot be right or
        nobody can tell: PGS and ``noslip_iterations``, whose results satisfy the equations of motion whatever the
        forces; sleeping; disabled contacts, constraints or actuation.
    EngineError
        If the state has a block already or this version of MuJoCo has another memory layout; at the end of the
        block, if forces were wrong by more than `convergence.WRONG` or a wheel was left out.
    """
    _check_arguments(model, data, surface, wheels, compiled.CONTACTS)
    with (
        raise_solver_limits(model),
        watched_edges(model, data, surface, wheels, WRONG) as contacts,
    ):
        watch_options(find_board(data), model)
        yield contacts
        contacts.check()


@contextmanager
def watched_edges(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    surface: Surface,
    wheels: Mapping[str, str],
    converged_below: float,
) -> Iterator[EdgeContacts]:
    """Let wheels touch as in `knife_edges`, but leave options as they are and checks to the caller.

    Parameters
    ----------
    model, data, surface, wheels
        As in `knife_edges`.
    converged_below : float
        Relative residual up to which a step counts as converged.
    """
    margins = [model.pair_margin[_find_pair(model, wheel, ground)] for wheel, ground in wheels.items()]
    with (
        claim_board(data, compiled.CONTACTS) as board,
        _write_blackboard(board, model, surface, wheels),
        watch_state(board, model, data, converged_below),
        _record(EdgeContacts(board, model, data, margins)) as contacts,
    ):
        yield contacts


@contextmanager
def rolling_forces(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    surface: Surface,
    wheels: Mapping[str, str],
    stabilisation: float,
    constrained: Mapping[str, tuple[bool, bool, bool]] | None = None,
) -> Iterator[EdgeContacts]:
    """Apply the exact forces of rolling without slip to wheels, in place of MuJoCo's contacts.

    The forces are solved from MuJoCo's own mass matrix and all its other forces in every evaluation of the dynamics and
    added to ``qfrc_passive``. The constraints are bilateral: wheels neither lift off nor slide. Nothing is iterated.
    Where constraints are redundant, such as the lateral ones of two wheels on one axle, accelerations are determined,
    the division of the force between the wheels is not, and the smallest forces are taken. Constraints that are nearly
    redundant, as of axles that differ by less than 0.2 degrees and more than a millionth of a radian, are an error.

    The forces belong to the controls, applied forces and wrenches at the moment at which MuJoCo calls its control
    callback. With ``mj_step1`` and ``mj_step2`` these must be set before ``mj_step1``, or in a control callback: other
    forces between the two are an error. Copy states with ``mj_getState`` and ``mj_setState``; ``mj_copyData`` copies
    MuJoCo's counters too, and may look like steps without the callback. Sensors of force and ``cfrc_int`` do not know
    the force of the ground, which is among the passive forces.

    Parameters
    ----------
    model, data, surface, wheels
        As in `knife_edges`; no contact pairs are needed.
    stabilisation : float
        Rate at which gaps and slip decay to zero [1/s]; at most 0.8 (RK4: 1.3) a step.
    constrained : mapping, optional
        Which velocities of a wheel's contact are zero, by the wheel's geom name: lateral, forward and normal. All of
        those of wheels that it does not name.

    Raises
    ------
    ValueError
        As in `knife_edges` for wheels, sleeping and disabled actuation; for a rate that is negative or faster than the
        step allows; for unknown names in ``constrained``, values that are not three truth values, or if nothing is
        constrained.
    EngineError
        As in `knife_edges`; at the end of the block, if MuJoCo's own constraints acted (contacts, limits, equalities,
        friction losses), constraints of rolling contradicted each other or were nearly redundant, a wheel had no
        contact point, MuJoCo solved with other forces than the callback saw, or the control callback was replaced.
    """
    _check_arguments(model, data, surface, wheels, compiled.ROLLING)
    _check_rate(stabilisation, model)
    for name, given in dict(constrained or {}).items():
        _check_axes(name, given)
    chosen = dict.fromkeys(wheels, ALL_AXES) | dict(constrained or {})
    if unknown := [name for name in chosen if name not in wheels]:
        raise ValueError(f"constrained names {unknown[0]!r}, which is none of the wheels {', '.join(wheels)}")
    if not any(any(axes) for axes in chosen.values()):
        raise ValueError("nothing is constrained; at least one velocity of a wheel must be")
    axes = [chosen[name] for name in wheels]
    with watched_rolling(model, data, surface, wheels, stabilisation, axes) as contacts:
        watch_options(find_board(data), model)
        yield contacts
        contacts.check()


@contextmanager
def watched_rolling(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    surface: Surface,
    wheels: Mapping[str, str],
    stabilisation: float,
    constrained: Sequence[tuple[bool, bool, bool]],
) -> Iterator[EdgeContacts]:
    """Apply forces as in `rolling_forces`, but leave checks to the caller.

    Parameters
    ----------
    model, data, surface, wheels, stabilisation
        As in `rolling_forces`.
    constrained : sequence
        Which velocities of each wheel's contact are zero: lateral, forward and normal.
    """
    with (
        claim_board(data, compiled.ROLLING) as board,
        _write_blackboard(board, model, surface, wheels, stabilisation, constrained),
        watch_state(board, model, data, WRONG),
        _record(EdgeContacts(board, model, data, [np.inf] * len(wheels))) as contacts,
    ):
        yield contacts


def stiffen(model: mujoco.MjModel, wheels: Mapping[str, str], softness: float) -> None:
    """Multiply the softness of the wheels' contact rows by a factor, in place.

    MuJoCo takes R = (1 - impedance) / impedance times the mean inverse weight of the wheel's body. This function
    scales that weight, which only constraints use.

    Raises
    ------
    ValueError
        If a geom is missing or the factor is not a finite number above 0.
    """
    if not (isinstance(softness, Real) and 0 < float(softness) < np.inf):
        raise ValueError(f"softness must be a finite number above 0, such as 1e-5, not {softness!r}")
    for body in {int(_find_geom(model, name).bodyid[0]) for name in wheels}:
        model.body_invweight0[body] *= softness


@contextmanager
def _record(contacts: EdgeContacts) -> Iterator[EdgeContacts]:
    try:
        yield contacts
    finally:
        contacts.look()
        contacts.detach()


def _check_arguments(
    model: mujoco.MjModel, data: mujoco.MjData, surface: Surface, wheels: Mapping[str, str], kind: int
) -> None:
    refused = find_refused_option(model, kind)
    if refused is not None:
        raise ValueError(refused)
    if data.signature != model.signature:
        raise ValueError("data belongs to another model; mujoco.MjData(model) makes one for this model")
    if not isinstance(surface, Surface):
        raise ValueError(f"surface must be one of velodrome.reference.surface, not {surface!r}")
    for name in (*wheels, *wheels.values()):
        _find_geom(model, name)


def _check_rate(stabilisation: float, model: mujoco.MjModel) -> None:
    if not (isinstance(stabilisation, Real) and 0 <= float(stabilisation) < np.inf):
        raise ValueError(f"stabilisation must be a finite rate of 0 or more [1/s], not {stabilisation!r}")
    fastest = FASTEST_RK4 if model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4 else FASTEST_EULER
    if stabilisation * model.opt.timestep > fastest:
        raise ValueError(
            f"stabilisation is {stabilisation:g} 1/s; at steps of {model.opt.timestep:g} s gaps or slip grow from "
            f"{fastest / model.opt.timestep:.4g} 1/s on"
        )


def _check_axes(name: str, axes: Any) -> None:
    three = isinstance(axes, Sequence | np.ndarray) and len(axes) == 3
    if not three or any(not isinstance(axis, bool | np.bool_) for axis in axes):
        raise ValueError(f"constrained[{name!r}] must be three truth values, lateral, forward and normal, not {axes!r}")


def _find_geom(model: mujoco.MjModel, name: str) -> Any:
    """Return MuJoCo's view of a geom.

    Raises
    ------
    ValueError
        If there is none of this name.
    """
    try:
        return model.geom(name)
    except (KeyError, TypeError) as error:
        names = [model.geom(i).name for i in range(model.ngeom)]
        known = ", ".join(repr(each) for each in names if each) or "none with a name"
        raise ValueError(f"the model has no geom {name!r}; its geoms are {known}") from error


def _moves(model: mujoco.MjModel, body: int) -> bool:
    """Return whether a joint can move a body; those of the world and of mocap have none."""
    while body:
        if model.body_dofnum[body]:
            return True
        body = int(model.body_parentid[body])
    return False


def _find_pair(model: mujoco.MjModel, wheel: str, ground: str) -> int:
    ids = {_find_geom(model, wheel).id, _find_geom(model, ground).id}
    pairs = [i for i in range(model.npair) if {int(model.pair_geom1[i]), int(model.pair_geom2[i])} == ids]
    if len(pairs) != 1:
        raise ValueError(f"there must be one contact pair of {ground!r} and {wheel!r}, not {len(pairs)}")
    if model.pair_dim[pairs[0]] != 3:
        raise ValueError(f"the pair of {ground!r} and {wheel!r} must have condim 3")
    if not model.pair_margin[pairs[0]] > 0:
        raise ValueError(f"the pair of {ground!r} and {wheel!r} must have a margin above 0, such as 1e-3")
    return pairs[0]


@contextmanager
def _write_blackboard(
    entries: np.ndarray,
    model: mujoco.MjModel,
    surface: Surface,
    wheels: Mapping[str, str],
    stabilisation: float = 0.0,
    constrained: Sequence[tuple[bool, bool, bool]] = (),
) -> Iterator[None]:
    """Write wheels and ground on a blackboard (1,); the arrays that it points to live as long as the block."""
    if not 0 < len(wheels) <= compiled.WHEEL_COUNT:
        raise ValueError(f"there are {len(wheels)} wheels; there must be 1 to {compiled.WHEEL_COUNT}")
    offsets, function = layout.find_layout(), surface.function.real
    parameters = np.ascontiguousarray(surface.parameters, float)
    board = entries[0]
    board["surface"], board["parameters"] = function.address, parameters.ctypes.data
    board["parameter_count"] = len(parameters)
    for name in _FOLLOWED:
        board[f"{name}_at"] = offsets.data[name]
    for name, field in (
        ("dist", "dist"),
        ("frame", "frame"),
        ("margin", "includemargin"),
        ("friction", "friction"),
        ("geom", "geom"),
        ("row", "efc_address"),
    ):
        board[f"{name}_at"] = offsets.contact[field]
    board["contact_size"], board["stabilisation"] = offsets.contact_size, stabilisation
    board["pyramidal_type"] = int(mujoco.mjtConstraint.mjCNSTR_CONTACT_PYRAMIDAL)
    for k, axes in enumerate(constrained):
        board["constrained"][k] = axes
    _write_wheels(board, model, wheels)
    search = rim_search(surface, [float(radius) for radius in board["radius"][: len(wheels)]])
    board["curved"] = search.curved
    board["bends"], board["bend_count"] = search.bends.ctypes.data, len(search.bends)
    board["bend_width"], board["detail"], board["samples"] = search.width, search.detail, search.samples
    yield


def _write_wheels(board: np.void, model: mujoco.MjModel, wheels: Mapping[str, str]) -> None:
    board["wheels"] = len(wheels)
    for k, (wheel, ground) in enumerate(wheels.items()):
        geom, plane = _find_geom(model, wheel), _find_geom(model, ground)
        if geom.type[0] != mujoco.mjtGeom.mjGEOM_CYLINDER:
            raise ValueError(f"{wheel!r} must be a cylinder, whose radius and axis are the wheel's")
        if plane.type[0] != mujoco.mjtGeom.mjGEOM_PLANE or plane.bodyid[0] != 0:
            raise ValueError(f"{ground!r} must be a plane that belongs to the world")
        tilt = 2 * float(np.hypot(plane.quat[1], plane.quat[2]))
        if tilt > LEVEL:
            raise ValueError(
                f"{ground!r} is tilted by {tilt:.3g} rad; the plane only names the ground and must be level, "
                "the surface has the slope, such as InclinedPlane"
            )
        if not _moves(model, int(geom.bodyid[0])):
            raise ValueError(f"{wheel!r} must belong to a body that moves by a joint")
        board["geom"][k], board["body"][k], board["ground"][k] = geom.id, geom.bodyid[0], plane.id
        board["radius"][k] = geom.size[0]
