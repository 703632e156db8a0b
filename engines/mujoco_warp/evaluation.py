"""One ride's part of what MuJoCo Warp has evaluated, in double precision."""

# MuJoCo Warp is an extra, without which its types are not known; MuJoCo's compiled bindings carry none.
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

from functools import cached_property
from typing import Any

import mujoco_warp
import numpy as np
import warp

from ..mujoco.ride import Recording, Rig


class Evaluation:
    """What MuJoCo Warp has evaluated of the ride at one place of a batch; to be read before the next step.

    Parameters
    ----------
    rig : Rig
        The model in MuJoCo.
    model : mujoco_warp.Model
    data : mujoco_warp.Data
    place : int
    """

    def __init__(self, rig: Rig, model: Any, data: Any, place: int) -> None:
        self._rig, self._model, self._data, self._place = rig, model, data, place

    def _read(self, name: str) -> np.ndarray:
        return getattr(self._data, name).numpy()[self._place].astype(float)

    @property
    def qpos(self) -> np.ndarray:
        """Positions (10,)."""
        return self._read("qpos")

    @property
    def qvel(self) -> np.ndarray:
        """Velocities (9,)."""
        return self._read("qvel")

    @property
    def mass_matrix(self) -> np.ndarray:
        """Mass matrix (9, 9)."""
        model = self._rig.model
        lower = np.zeros((model.nv, model.nv))
        lower[np.repeat(np.arange(model.nv), model.M_rownnz), model.M_colind] = self._read("M")
        return lower + np.tril(lower, -1).T

    @cached_property
    def residual(self) -> float:
        """Residual of the contact solver, relative to the forces, as `velodrome.engines.mujoco.convergence` has it."""
        mass, smooth, forces = self.mass_matrix, self._read("qacc_smooth"), self._read("qfrc_constraint")
        gradient = mass @ (self._read("qacc") - smooth) - forces
        scale = max(smooth @ self._read("qfrc_smooth"), forces @ np.linalg.solve(mass, forces))
        return float(np.sqrt(gradient @ np.linalg.solve(mass, gradient) / (scale if scale > 0 else 1.0)))

    @property
    def overflow(self) -> str | None:
        """What there was no room for, in words; None if there was room for everything."""
        data = self._data
        found = max(int(data.ncollision.numpy()[0]), int(data.nacon.numpy()[0]))
        if found > data.naconmax:
            return f"contacts than it has room for, {found} of {data.naconmax},"
        rows = int(data.nefc.numpy()[self._place])
        return f"constraint rows than it has room for, {rows} of {data.njmax}," if rows > data.njmax else None

    @property
    def contact_force(self) -> np.ndarray:
        """Contact forces on the wheels (2, 3), inertial axes [N]; zero without contact."""
        data, forces = self._data, np.zeros((2, 3))
        count = min(int(data.nacon.numpy()[0]), data.naconmax)
        wrenches = warp.zeros(data.naconmax, dtype=warp.spatial_vector)
        numbers = warp.array(np.arange(data.naconmax, dtype=np.int32))
        mujoco_warp.contact_force(self._model, data, numbers, True, wrenches)
        owner, geoms, found = data.contact.worldid.numpy(), data.contact.geom.numpy(), wrenches.numpy()
        for i in range(count):
            if owner[i] == self._place:
                # The normal points from the plane, the first geom, to the wheel.
                forces[self._rig.wheels[int(geoms[i, 1])]] += found[i, :3]
        return forces

    def record(self, recording: Recording, k: int, time: float) -> None:
        """Record the state as sample k, at a time [s]."""
        recording.time[k], recording.qpos[k], recording.qvel[k] = time, self.qpos, self.qvel
        recording.position[k] = self._read("xipos")[self._rig.bodies]
        recording.quaternion[k] = self._read("xquat")[self._rig.bodies]
        recording.energy[k] = self._read("energy")
        recording.force[k] = self.contact_force
