"""Options of MuJoCo with which forces on wheels cannot be right, or nobody can tell whether they are."""

# MuJoCo's compiled bindings carry no types.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import mujoco
import numpy as np

from . import compiled, layout

# Flags without which the contacts, or the callback that completes them, are not computed.
_NEEDED = {
    compiled.CONTACTS: {"CONTACT": "contacts", "CONSTRAINT": "constraint forces", "ACTUATION": "control callbacks"},
    compiled.ROLLING: {"ACTUATION": "control callbacks"},
}
_ANY = 2**31 - 1


def find_refused_option(model: mujoco.MjModel, kind: int) -> str | None:
    """Return why the model's options are refused; None if they are not.

    Parameters
    ----------
    model : mujoco.MjModel
    kind : int
        `compiled.CONTACTS` or `compiled.ROLLING`.
    """
    for name, what in _NEEDED[kind].items():
        if model.opt.disableflags & getattr(mujoco.mjtDisableBit, f"mjDSBL_{name}"):
            return f"the flag {name.lower()} is disabled, without which there are no {what}"
    if model.opt.enableflags & _sleep_flag():
        return "the flag sleep is enabled; the forces on wheels need all bodies awake"
    if kind == compiled.CONTACTS and model.opt.solver == mujoco.mjtSolver.mjSOL_PGS:
        return "the solver is PGS, whose convergence nobody can tell; knife edges need Newton or CG"
    if kind == compiled.CONTACTS and model.opt.noslip_iterations:
        return "noslip_iterations hide whether the solver has converged; `stiffen` leaves less slip than they do"
    return None


def _sleep_flag() -> int:
    """Return the bit of the flag sleep; releases before 3.4 do not put bodies to sleep."""
    return int(getattr(mujoco.mjtEnableBit, "mjENBL_SLEEP", 0))


def watch_options(board: np.ndarray, model: mujoco.MjModel) -> None:
    """Let the callback look, in every evaluation, at the options that `find_refused_option` refuses.

    Parameters
    ----------
    board : ndarray, shape (1,)
        The blackboard of a state, with its kind.
    model : mujoco.MjModel
    """
    entry, kind = board[0], int(board[0]["kind"])
    for name, address in layout.find_options(model).items():
        entry[name] = address
    bits = [int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{name}")) for name in _NEEDED[kind]]
    entry["never_disabled"] = sum(bits)
    entry["never_enabled"] = _sleep_flag()
    contacts = kind == compiled.CONTACTS
    entry["refused_solver"] = int(mujoco.mjtSolver.mjSOL_PGS) if contacts else -1
    entry["most_noslip"] = 0 if contacts else _ANY
