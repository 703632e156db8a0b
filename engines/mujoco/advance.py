"""Step MuJoCo from given states: for the errors of single steps, and for the sensitivity of a ride to its state."""

# MuJoCo's compiled bindings carry no types.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import mujoco
import numpy as np

from ..engine import EngineError
from .ride import Rig, find_trouble, no_report
from .state import from_mujoco, to_mujoco


def advance_states(rig: Rig, q: np.ndarray, qd: np.ndarray, steps: int) -> tuple[np.ndarray, np.ndarray]:
    """Take a number of steps from each of n states.

    Parameters
    ----------
    rig : Rig
        Built at the first state.
    q, qd : ndarray, shape (n, 9)
        States along a ride, in its order: contacts are searched for from those of the state before.
    steps : int

    Returns
    -------
    q, qd : ndarray, shape (n, 9)
        Yaw and pitch without their whole turns.

    Raises
    ------
    EngineError
        If a wheel has no contact point, or the state becomes infinite.
    """
    model, data = rig.model, rig.data
    qpos, qvel = np.empty((len(q), 10)), np.empty((len(q), 9))
    with no_report(), rig.callbacks():
        for i in range(len(q)):
            data.qpos[:], data.qvel[:] = to_mujoco(q[i], qd[i])
            data.qacc_warmstart[:] = 0  # so that the result does not depend on the state before
            standing, left = rig.follow(), steps
            while left and standing:
                more = min(left, rig.stride)
                mujoco.mj_step(model, data, more)
                left, standing = left - more, rig.follow()
            if not standing:
                raise EngineError("a wheel lies flat or has no contact point with the surface")
            qpos[i], qvel[i] = data.qpos, data.qvel
        trouble = find_trouble(data, True)
    if trouble is not None:
        raise EngineError(trouble)
    return from_mujoco(np.zeros(len(q)), qpos, qvel, q[0])
