"""The wheels of an open block as the callbacks have recorded them: gaps, forces, and whether these can be right."""

# MuJoCo's compiled bindings carry no types.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from ..engine import EngineError
from . import compiled
from .callbacks import REPLACED
from .convergence import SolverConvergence, share
from .library import control_slot
from .options import find_refused_option

# Rolling constraints that leave more than this share of the accelerations contradict each other. Consistent ones leave
# some hundred roundings; an angle of 1e-8 rad between two axles that should be one leaves about as much.
CONTRADICTION = 1e-9
# Share in a dependence or a contradiction from which on a wheel is named: a tenth in amplitude.
NAMED = 0.01
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
        rolling = self._board["kind"][0] == compiled.ROLLING
        return self._find_missed(rolling) or self._find_changed() or (self._find_strain() if rolling else None)

    def _find_missed(self, rolling: bool) -> str | None:
        """Return what the callbacks have missed."""
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
        # Exact contacts put the callback back before it is missed.
        if self._is_open() and rolling and control_slot().value != compiled.control.address:
            return REPLACED
        if record["missed"]:
            return (
                f"MuJoCo solved {record['missed']} evaluations of this state without its control callback, and so "
                "without its wheels: with a copy of the model, by single stages or with other callbacks; a state that "
                "was copied in by mj_copyData looks the same, one copied by mj_getState and mj_setState does not"
            )
        return None

    def _find_changed(self) -> str | None:
        """Return what was changed inside the block that must not change."""
        record, wheels = self._board[0], len(self._reach)
        # Blocks that leave options to the caller do not watch them.
        watched = record["disableflags"] != 0
        refused = find_refused_option(self._model, int(record["kind"])) if watched else None
        if refused is not None:
            return f"inside the block, {refused}"
        if record["altered"]:
            return (
                f"options were changed inside the block, for {record['altered']} evaluations, to some that are refused "
                "at its start"
            )
        sizes = self._model.geom_size[record["geom"][:wheels], 0]
        if changed := [k for k in range(wheels) if sizes[k] != record["radius"][k]]:
            return (
                f"the radius of the wheel {self._name(changed[0])} was changed inside the block, which began with "
                f"{record['radius'][changed[0]]:g} m"
            )
        return None

    def _find_strain(self) -> str | None:
        """Return why forces of rolling are not those of the model's wheels."""
        record, wheels = self._board[0], len(self._reach)
        if record["crowded"]:
            return (
                f"MuJoCo's own constraints acted in {record['crowded']} evaluations, of which the forces of rolling "
                "know nothing; remove contacts, limits, equalities and friction losses, or use knife_edges"
            )
        if record["infinite"]:
            return f"the forces of rolling were not finite in {record['infinite']} evaluations"
        if np.any(record["unreached"][:wheels]):
            k = int(np.argmax(record["unreached"][:wheels]))
            return (
                f"the wheel {self._name(k)} had no contact point with the ground in {record['unreached'][k]} "
                "evaluations, and so no force"
            )
        if record["contradiction"] > CONTRADICTION:
            return (
                f"the constraints of rolling contradict each other by {record['contradiction']:.2g} of the "
                f"accelerations, on {self._name_all('contradicting')}; `constrained` can leave out the lateral "
                "velocity of all but one wheel on an axle"
            )
        if record["dependence"] > 0:
            return (
                f"the constraints of rolling on {self._name_all('dependent')} are nearly redundant: they differ by "
                f"{np.sqrt(record['dependence']):.2g} rad, which is neither nothing nor enough to tell their forces "
                "apart; make them equal, or leave some out by `constrained`"
            )
        if record["changed"]:
            return (
                f"forces other than the wheels' were changed after MuJoCo's control callback in {record['changed']} "
                "evaluations, so that the wheels' do not belong to them: set controls and applied forces before "
                "mj_step1, and copy states with mj_getState and mj_setState"
            )
        return None

    def _is_open(self) -> bool:
        return bool(self._board["data"][0])

    def _name(self, wheel: int) -> str:
        return repr(self._model.geom(int(self._board["geom"][0, wheel])).name)

    def _name_all(self, field: str) -> str:
        """Return the names of the wheels with a share in what a field records."""
        shares = self._board[field][0, : len(self._reach)]
        names = [self._name(k) for k in range(len(shares)) if shares[k] > NAMED]
        return f"the wheel{'s' if len(names) > 1 else ''} {', '.join(names)}"

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
