"""Knife-edge wheels on curved ground for any MuJoCo model.

    <geom name="ground" type="plane" size="0 0 1"/>                            in the world
    <geom name="wheel" type="cylinder" size="0.3 0.001"/>                      on the wheel's body
    <pair geom1="ground" geom2="wheel" condim="3" margin="1e-3" gap="1e9"      in <contact>
          solref="0.05 1" solimp="0.9999 0.9999 0.001 0.5 2" friction="2 2 0 0 0"/>

    with knife_edges(model, data, Paraboloid(0.1), {"wheel": "ground"}):
        mujoco.mj_step(model, data)

Inside the block the cylinder touches the ground z = f(x, y) as a circle without thickness does, at the
exact point of closest approach, with the exact normal, in every stage of every integrator. MuJoCo's
reference accelerations get the contact's own acceleration, which MuJoCo omits. Solver, friction cone and
lift-off stay MuJoCo's own. The plane only names the ground; its position does not matter.

In every evaluation, MuJoCo's solver starts from the forces of wheels that neither slide nor lift off. Where it
stops at forces that are wrong, the block ends with an error (`convergence`).

MuJoCo's rows stay soft, even if only by the factor (1 - impedance) / impedance: a force F on a row leaves

    slip = R F / b,    gap = R F / k

with R = efc_R the row's softness, b = 2 / (impedance time constant) and k its stiffness. `stiffen` makes R
smaller than any impedance can.
"""

# MuJoCo's compiled bindings carry no types.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

import mujoco
import numpy as np

from ...reference.rim import rim_search
from ...reference.surface import Surface
from ..engine import EngineError
from . import compiled, layout
from .callbacks import install_callbacks
from .convergence import WRONG, SolverConvergence, judge_solver, share


@contextmanager
def knife_edges(
    model: mujoco.MjModel, data: mujoco.MjData, surface: Surface, wheels: Mapping[str, str]
) -> Iterator[SolverConvergence]:
    """Let wheels touch a surface as knife edges.

    Parameters
    ----------
    model : mujoco.MjModel
        Each wheel's geom is a cylinder and paired with a plane; see the module's example.
    data : mujoco.MjData
        The state that is stepped inside the block; other states are not affected.
    surface : Surface
    wheels : mapping
        Plane's geom name by wheel's geom name.

    Yields
    ------
    SolverConvergence
        Residuals of MuJoCo's solver so far. With ``noslip_iterations`` they cannot be determined.

    Raises
    ------
    ValueError
        If a geom or pair is missing or of the wrong kind.
    EngineError
        If callbacks are in use already or this version of MuJoCo has another memory layout; at the end of the block, if
        MuJoCo's solver ever gave forces that are wrong by more than `convergence.WRONG`.
    """
    with watched_edges(model, data, surface, wheels, WRONG) as convergence:
        yield convergence
        convergence.look()
        if convergence.wrong is not None:
            raise EngineError(f"MuJoCo's contact solver stopped unconverged: {share(convergence.wrong[1])}")


@contextmanager
def watched_edges(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    surface: Surface,
    wheels: Mapping[str, str],
    converged_below: float,
) -> Iterator[SolverConvergence]:
    """Let wheels touch as in `knife_edges`, but leave it to the caller to check the solver's convergence.

    Parameters
    ----------
    model, data, surface, wheels
        As in `knife_edges`.
    converged_below : float
        Relative residual up to which a step counts as converged.
    """
    _check_pairs(model, wheels)
    with (
        install_callbacks(compiled.correct_reference, compiled.touch),
        _write_blackboard(model, surface, wheels),
        judge_solver(model, data, converged_below) as convergence,
    ):
        yield convergence


@contextmanager
def rolling_forces(
    model: mujoco.MjModel, data: mujoco.MjData, surface: Surface, wheels: Mapping[str, str], stabilisation: float
) -> Iterator[SolverConvergence]:
    """Apply the exact forces of rolling without slip to wheels, in place of MuJoCo's contacts.

    The forces are solved from MuJoCo's own mass matrix and bias forces in every evaluation of the dynamics and
    stored in ``qfrc_applied``, together with the generalised forces that were there when the block began. The
    constraints are bilateral: wheels neither lift off nor slide. Nothing is iterated.

    Parameters
    ----------
    model, data, surface, wheels
        As in `knife_edges`; no contact pairs are needed.
    stabilisation : float
        Rate at which gaps and slip decay to zero [1/s].
    """
    with (
        install_callbacks(compiled.press),
        _write_blackboard(model, surface, wheels, stabilisation),
        judge_solver(model, data, WRONG) as convergence,
    ):
        held = data.qfrc_applied.copy()
        compiled.board[0]["held"] = held.ctypes.data
        yield convergence


def standing() -> bool:
    """Return whether every wheel has had a contact point with the ground ever since the block began.

    A wheel without one moves on without contact forces.

    Raises
    ------
    EngineError
        If MuJoCo never called the collision callback.
    """
    found, lost = int(compiled.board["found"][0]), int(compiled.board["lost"][0])
    if found + lost == 0:
        raise EngineError(f"MuJoCo {mujoco.__version__} did not call the wheels' contacts; MuJoCo 4.0 does")
    return lost == 0


def pressing_forces(wheels: int) -> np.ndarray:
    """Return the forces of the last evaluation inside `rolling_forces`, shape (wheels, 3), inertial axes [N]."""
    return compiled.board["force"][0, :wheels].copy()


def stiffen(model: mujoco.MjModel, wheels: Mapping[str, str], softness: float) -> None:
    """Multiply the softness of the wheels' contact rows by a factor, in place.

    MuJoCo takes R = (1 - impedance) / impedance times the mean inverse weight of the wheel's body. This function
    scales that weight, which only constraints use.
    """
    for name in wheels:
        model.body_invweight0[model.geom(name).bodyid[0]] *= softness


def _check_pairs(model: mujoco.MjModel, wheels: Mapping[str, str]) -> None:
    for wheel, ground in wheels.items():
        ids = {model.geom(wheel).id, model.geom(ground).id}
        pairs = [i for i in range(model.npair) if {int(model.pair_geom1[i]), int(model.pair_geom2[i])} == ids]
        if len(pairs) != 1:
            raise ValueError(f"there must be one contact pair of {ground!r} and {wheel!r}, not {len(pairs)}")
        if model.pair_dim[pairs[0]] != 3:
            raise ValueError(f"the pair of {ground!r} and {wheel!r} must have condim 3")
        if not model.pair_margin[pairs[0]] > 0:
            raise ValueError(f"the pair of {ground!r} and {wheel!r} must have a margin above 0, such as 1e-3")


@contextmanager
def _write_blackboard(
    model: mujoco.MjModel, surface: Surface, wheels: Mapping[str, str], stabilisation: float = 0.0
) -> Iterator[None]:
    """Write wheels and ground on the blackboard; the arrays that it points to live as long as the block."""
    if not 0 < len(wheels) <= compiled.WHEEL_COUNT:
        raise ValueError(f"there are {len(wheels)} wheels; there must be 1 to {compiled.WHEEL_COUNT}")
    offsets, function = layout.find_layout(), surface.function.real
    parameters = np.ascontiguousarray(surface.parameters, float)
    board = compiled.board[0]
    board["surface"], board["parameters"] = function.address, parameters.ctypes.data
    board["parameter_count"] = len(parameters)
    for name in ("ncon", "contact", "efc_aref", "efc_KBIP", "efc_R"):
        board[f"{name}_at"] = offsets.data[name]
    for name, field in (
        ("frame", "frame"),
        ("margin", "includemargin"),
        ("friction", "friction"),
        ("geom", "geom"),
        ("row", "efc_address"),
    ):
        board[f"{name}_at"] = offsets.contact[field]
    board["contact_size"], board["stabilisation"] = offsets.contact_size, stabilisation
    board["pyramidal"] = model.opt.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL
    _write_wheels(board, model, wheels)
    search = rim_search(surface, [float(radius) for radius in board["radius"][: len(wheels)]])
    board["curved"] = search.curved
    board["bends"], board["bend_count"] = search.bends.ctypes.data, len(search.bends)
    board["bend_width"], board["detail"], board["samples"] = search.width, search.detail, search.samples
    yield


def _write_wheels(board: np.void, model: mujoco.MjModel, wheels: Mapping[str, str]) -> None:
    board["wheels"], board["lost"], board["found"] = len(wheels), 0, 0
    for k, (wheel, ground) in enumerate(wheels.items()):
        geom, plane = model.geom(wheel), model.geom(ground)
        if geom.type[0] != mujoco.mjtGeom.mjGEOM_CYLINDER:
            raise ValueError(f"{wheel!r} must be a cylinder, whose radius and axis are the wheel's")
        if plane.type[0] != mujoco.mjtGeom.mjGEOM_PLANE or plane.bodyid[0] != 0:
            raise ValueError(f"{ground!r} must be a plane that belongs to the world")
        board["geom"][k], board["body"][k], board["ground"][k] = geom.id, geom.bodyid[0], plane.id
        board["radius"][k] = geom.size[0]
