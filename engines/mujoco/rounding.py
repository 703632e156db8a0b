"""MuJoCo's steps in double precision with a state that is rounded to float32 after every step.

What a port in single precision loses by the digits of its state alone, without those of its forces. Not announced as an
engine: nobody rides like this but to compare.
"""

# MuJoCo's compiled bindings carry no types.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np

from ..engine import Problem
from .planes import build_planes
from .ride import Rig
from .settings import RoundedSettings


def build_rounded_planes(problem: Problem, settings: RoundedSettings) -> Rig:
    """Build the model of `planes.build_planes` with a state that is rounded at the start and after every step.

    Raises
    ------
    EngineError
        If MuJoCo refuses the model or a wheel has no contact point.
    """
    rig = build_planes(problem, settings)
    data = rig.data

    def round_and_follow() -> bool:
        _round_state(data, settings.rounded)
        return rig.follow()

    return replace(rig, follow=round_and_follow, stride=1)


def _round_state(data: mujoco.MjData, rounded: str) -> None:
    if rounded != "velocities":
        data.qpos[:] = data.qpos.astype(np.float32)
    if rounded != "positions":
        data.qvel[:] = data.qvel.astype(np.float32)
