"""The wheels of an open block as the callbacks have recorded them: gaps, forces, and whether these can be right."""

# MuJoCo's compiled bindings carry no types.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from ..engine import EngineError
from . import compiled
from .convergence import SolverConvergence, share

# Rolling constraints that leave more than this share of the accelerations contradict each other. Consistent ones leave
# `compiled.REFINED`; a hundredth of a degree between two axles that should be one leaves 1e-4.
CONTRADICTION = 1e-6
# Share of the largest normal force up to which one that pulls counts as round-off of a wheel without load.
UNLOADED = 1e-9
_UNSTABLE = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)


class EdgeContacts(SolverConvergence):
    """Contacts of wheels inside a block.

    Parameters
    ----------
    board : ndarray, shape (1,)
        The blackboard of the state.
    model, data
        MuJoCo's.
    reach : sequence of float
        Largest gap of each wheel at which it counts as touching the ground [m].
    """

    def __init__(self, board: np.ndarray, model: mujoco.MjModel, data: mujoco.MjData, reach: Sequence[float]) -> None:
        super().__init__(board)
        self._model, self._data, self._reach = model, data, np.array(reach)

    def gaps(self) -> np.ndarray:
        """Return the gaps of the last evaluation, shape (wheels,) [m]; nan for a wheel without a contact point."""
        self._require_calls()
        return self._board["gap"][0, : len(self._reach)].copy()

    def forces(self) -> np.ndarray:
        """Return the contact forces on the wheels in the last evaluation, shape (wheels, 3), inertial axes [N].

        Of wheels that share a redundant constraint only the sums are determined.
        """
        self._require_calls()
        wheels = len(self._reach)
        if self._board["kind"][0] == compiled.ROLLING:
            return self._board["force"][0, :wheels].copy()
        found, wrench, contacts = np.zeros((wheels, 3)), np.empty(6), self._data.contact
        geoms = {int(geom): k for k, geom in enumerate(self._board["geom"][0, :wheels])}
        for i in range(self._data.ncon):
            k = geoms.get(int(contacts.geom[i, 1]))
            if k is not None and contacts.geom[i, 0] == self._board["ground"][0, k]:
                mujoco.mj_contactForce(self._model, self._data, i, wrench)
                found[k] += contacts.frame[i].reshape(3, 3).T @ wrench[:3]
        return found

    def standing(self) -> bool:
        """Return whether every wheel touches the ground, has had a contact point ever since, and the forces are right.

        A wheel without a contact point moves on without contact forces. Forces of rolling may also hold a wheel down,
        which no ground does: it does not stand any more either.

        Raises
        ------
        EngineError
            If MuJoCo never called the callbacks.
        """
        touching = bool(np.all(self.gaps() <= self._reach))
        return self.complete() and touching and not self.held_down() and self.find_fault() is None

    def held_down(self) -> bool:
        """Return whether forces of rolling have ever pulled a wheel towards the ground."""
        return float(self._board["pull"][0]) > UNLOADED * float(self._board["push"][0])

    def complete(self) -> bool:
        """Return whether every wheel has had a contact point ever since the block began, however far away.

        Raises
        ------
        EngineError
            If MuJoCo never called the callbacks.
        """
        self._require_calls()
        return int(self._board["lost"][0]) == 0

    def find_fault(self) -> str | None:
        """Return why forces of an evaluation in this block cannot be right; None if they are."""
        self.look()
        if self.wrong is not None:
            return f"MuJoCo's contact solver stopped unconverged: {share(self.wrong[1])}"
        if any(self._data.warning[kind].number for kind in _UNSTABLE):
            return "MuJoCo's state became infinite or huge"
        record = self._board[0]
        if record["skipped"]:
            return (
                f"MuJoCo left out a wheel's contact in {record['skipped']} evaluations; its pair needs "
                'gap="1e9", and neither a flag nor full memory may remove its rows'
            )
        if record["strange"]:
            return (
                f"another state of the same model was evaluated {record['strange']} times, without its wheels; "
                "it needs a block of its own"
            )
        if record["crowded"]:
            return (
                f"MuJoCo's own constraints acted in {record['crowded']} evaluations, of which the forces of rolling "
                "know nothing; remove contacts, limits, equalities and friction losses, or use knife_edges"
            )
        if record["contradiction"] > CONTRADICTION:
            return (
                f"the constraints of rolling contradict each other by {record['contradiction']:.2g} of the "
                "accelerations; `constrained` can leave out the lateral velocity of all but one wheel on an axle"
            )
        return None

    def check(self) -> None:
        """Raise an error if forces of an evaluation in this block cannot be right.

        Raises
        ------
        EngineError
            If `find_fault` finds a fault.
        """
        fault = self.find_fault()
        if fault is not None:
            raise EngineError(fault)

    def _require_calls(self) -> None:
        if not self._board["found"][0] + self._board["lost"][0]:
            raise EngineError(f"MuJoCo {mujoco.__version__} did not call the wheels' contacts; MuJoCo 4.0 does")
