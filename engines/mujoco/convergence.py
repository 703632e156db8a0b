"""Check that MuJoCo's contact solver converged in every evaluation of the dynamics.

The solver looks for the acceleration a at which the gradient of its cost vanishes,

    g = M (a - a_smooth) - J^T f(a),    a_smooth: the acceleration without contacts

and stops without a message where its line search finds no better point: the contact forces may then be arbitrarily
wrong. The cost is sufficiently convex for the following bound, in the norm |x|^2 = x^T M^-1 x of forces:

    |M (a - a*)| <= |g|,    |J^T (f - f*)| <= 2 |g|,    a*, f*: the solution

so the residual |g|, relative to the larger of |J^T f| and all other forces, bounds the relative error of the
accelerations, and twice it bounds that of the forces.
"""

# MuJoCo's compiled bindings carry no types.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import mujoco
import numpy as np

from . import compiled
from .callbacks import install_callbacks
from .settings import WRONG

STATE = (
    "qvel",
    "geom_xpos",
    "geom_xmat",
    "qacc",
    "qacc_smooth",
    "qacc_warmstart",
    "qfrc_bias",
    "qfrc_passive",
    "qfrc_applied",
    "qfrc_smooth",
    "qfrc_constraint",
    "M",
)


def share(residual: float) -> str:
    """Return in words what a relative residual means for the forces."""
    return f"its forces are off by up to {2 * residual:.2g} times themselves"


class SolverConvergence:
    """Convergence of MuJoCo's solver since a block began, as the callbacks have recorded it."""

    def begin(self, steps: int) -> None:
        """Count the evaluations from here on as those of the step after ``steps`` steps and of the following steps."""
        self.look()
        compiled.board["since_step"], compiled.board["evaluations"] = steps, 0

    def look(self) -> None:
        """Assess the last evaluation too, which otherwise happens only in the next one."""
        compiled.judge(compiled.board)

    @property
    def unconverged(self) -> int:
        """Number of steps in which the solver's residual exceeded the limit."""
        return int(compiled.board["unconverged"][0])

    @property
    def largest(self) -> float | None:
        """Largest relative residual; None where no solver was assessed."""
        residual = float(compiled.board["largest_residual"][0])
        return residual if residual >= 0 else None

    @property
    def wrong(self) -> tuple[int, float] | None:
        """First step with a residual above `WRONG`, and that residual; None if there is none."""
        step = int(compiled.board["wrong_step"][0])
        return None if step < 0 else (step, float(compiled.board["wrong_residual"][0]))


@contextmanager
def judge_solver(model: mujoco.MjModel, data: mujoco.MjData, converged_below: float) -> Iterator[SolverConvergence]:
    """Write on the blackboard which model's solver is assessed, and clear it at the end.

    Parameters
    ----------
    model, data
        The model and state on which the callbacks act inside the block.
    converged_below : float
        Relative residual up to which an evaluation counts as converged.
    """
    board, kept = compiled.board[0], np.zeros(len(data.M))
    for name in STATE:
        board[name] = getattr(data, name).ctypes.data
    for name in ("M_rownnz", "M_rowadr", "M_colind"):
        board[name] = getattr(model, name).ctypes.data
    board["kept_M"], board["M_entries"], board["speeds"] = kept.ctypes.data, len(kept), model.nv
    board["evaluations_per_step"] = 4 if model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4 else 1
    board["converged_below"], board["wrong_above"] = converged_below, WRONG
    for name in ("pending", "evaluations", "since_step", "unconverged", "wrong_residual"):
        board[name] = 0
    board["last_unconverged"] = board["wrong_step"] = board["largest_residual"] = -1
    board["model"], board["data"] = model._address, data._address
    try:
        yield SolverConvergence()
    finally:
        board["model"] = board["data"] = board["pending"] = 0


@contextmanager
def watch_solver(model: mujoco.MjModel, data: mujoco.MjData, converged_below: float) -> Iterator[SolverConvergence]:
    """Record the convergence of the solver for a model with MuJoCo's own contacts; parameters as in `judge_solver`.

    Raises
    ------
    EngineError
        If callbacks are in use already.
    """
    with install_callbacks(compiled.watch_iterations), judge_solver(model, data, converged_below) as convergence:
        yield convergence
