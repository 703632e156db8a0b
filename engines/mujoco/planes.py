"""Build the bicycle on planes: one fixed plane, or one per wheel that moves with the surface's tangent plane."""

# MuJoCo's compiled bindings carry no types.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from functools import partial

import numpy as np

from ...reference.kernels.dynamics import guess_contacts
from ...reference.kinematics import constants
from ...reference.surface import is_level
from ..engine import EngineError, Problem
from .bound import bind_kernel
from .convergence import leave_unwatched, watch_solver
from .releases import RESIDUAL, is_present
from .ride import Rig, bodies, look_stride, make_look, read_contact_forces, rim_stride, set_start, wheel_geoms
from .settings import ContactSettings
from .tangent import place_planes


def build_planes(problem: Problem, settings: ContactSettings) -> Rig:
    """Build the model and its state at the start of a problem.

    On level ground the planes do not move, and `Rig.follow` only searches for the contacts.

    Raises
    ------
    EngineError
        If MuJoCo refuses the model or a wheel has no contact point.
    """
    moving = not is_level(problem.surface)
    model, data = set_start(problem, settings, "planes" if moving else "plane")
    position, quaternion = (data.mocap_pos, data.mocap_quat) if moving else (np.empty((2, 3)), np.empty((2, 4)))
    c, contact = constants(problem.bicycle), np.empty(6)
    function, parameters = problem.surface.function.real, problem.surface.parameters
    guess_contacts(problem.q, contact, function, parameters, c)
    follow = bind_kernel(place_planes, data.qpos, c, function, parameters, contact, position, quaternion)
    if not follow():
        raise EngineError("a wheel has no contact point with the surface at the start")
    wheels, watched = wheel_geoms(model), is_present(RESIDUAL)
    return Rig(
        model=model,
        data=data,
        bodies=bodies(model),
        wheels=wheels,
        follow=follow,
        stride=1 if moving else look_stride(settings.step),
        look=make_look(data, problem, rim_stride(problem, settings.step)),
        forces=partial(read_contact_forces, model, data, wheels),
        callbacks=lambda: watch_solver(model, data, settings.converged_below) if watched else leave_unwatched(),
        judged=watched and settings.noslip_iterations == 0,
    )
