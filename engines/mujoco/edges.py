"""Build the bicycle on knife edges, with MuJoCo's contact solver or with solved rolling forces."""

# MuJoCo's compiled bindings carry no types.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from functools import partial

import mujoco
import numpy as np

from ...reference.kinematics import WHEELS
from ..engine import Problem
from .callbacks import find_board
from .edge_contacts import EdgeContacts
from .knife_edge import ALL_AXES, stiffen, watched_edges, watched_rolling
from .ride import Rig, bodies, make_look, read_contact_forces, rim_stride, set_start, wheel_geoms
from .settings import ExactContactSettings, MultiplierSettings

GROUNDS: dict[str, str] = dict.fromkeys(WHEELS, "ground")


def find_block_contacts(model: mujoco.MjModel, data: mujoco.MjData) -> EdgeContacts:
    """Return the wheels of the block that is open for a state.

    Raises
    ------
    EngineError
        If there is no such block.
    """
    return EdgeContacts(find_board(data), model, data, [np.inf] * len(WHEELS))


def build_contacts(problem: Problem, settings: ExactContactSettings) -> Rig:
    """Build the bicycle with exact contacts, MuJoCo's contact rows and MuJoCo's solver.

    Raises
    ------
    EngineError
        If MuJoCo refuses the model.
    """
    model, data = set_start(problem, settings, "edges")
    stiffen(model, GROUNDS, settings.softness)
    wheels = wheel_geoms(model)
    return Rig(
        model=model,
        data=data,
        bodies=bodies(model),
        wheels=wheels,
        follow=lambda: find_block_contacts(model, data).complete(),
        stride=rim_stride(problem, settings.step),
        look=make_look(data, problem),
        forces=partial(read_contact_forces, model, data, wheels),
        callbacks=lambda: watched_edges(model, data, problem.surface, GROUNDS, settings.converged_below),
        judged=settings.noslip_iterations == 0,
    )


def build_multipliers(problem: Problem, settings: MultiplierSettings) -> Rig:
    """Build MuJoCo's tree of bodies under the exact forces of rolling.

    Raises
    ------
    EngineError
        If MuJoCo refuses the model.
    """
    model, data = set_start(problem, settings, "nothing")

    def forces(out: np.ndarray) -> None:
        out[:] = find_block_contacts(model, data).forces()

    return Rig(
        model=model,
        data=data,
        bodies=bodies(model),
        wheels=wheel_geoms(model),
        follow=lambda: find_block_contacts(model, data).complete(),
        stride=rim_stride(problem, settings.step),
        look=make_look(data, problem),
        forces=forces,
        callbacks=lambda: watched_rolling(
            model, data, problem.surface, GROUNDS, settings.stabilisation, [ALL_AXES] * len(GROUNDS)
        ),
    )
