"""Whether MuJoCo's contact solver found, in every evaluation of the dynamics, what it looks for.

It looks for the acceleration a at which the gradient of its cost vanishes,

    g = M (a - a_smooth) - J^T f(a),    a_smooth: the acceleration without contacts

and stops without a word where its line search finds no better point: a contact force may then be anything. Its
cost is convex enough for a bound on what that does, in the norm |x|^2 = x^T M^-1 x of forces:

    |M (a - a*)| <= |g|,    |J^T (f - f*)| <= 2 |g|,    a*, f*: the solution

so the residual |g|, relative to the larger of |J^T f| and all other forces, bounds the relative error of the
accelerations, and twice it that of the forces.
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
    """What a relative residual means, in words."""
    return f"its forces are off by up to {2 * residual:.2g} times themselves"


class SolverConvergence:
    """What the judge of the solver has seen since a block began."""

    def begin(self, steps: int) -> None:
        """Count the evaluations from here on as those of the step after ``steps`` steps and of its successors."""
        self.look()
        compiled.board["since_step"], compiled.board["evaluations"] = steps, 0

    def look(self) -> None:
        """Judge the last evaluation as well, which otherwise the next one does."""
        compiled.judge(compiled.board)

    @property
    def unconverged(self) -> int:
        """Steps in which the solver left more than the limit."""
        return int(compiled.board["unconverged"][0])

    @property
    def largest(self) -> float | None:
        """Largest relative residual; None where no solver was judged."""
        residual = float(compiled.board["largest_residual"][0])
        return residual if residual >= 0 else None

    @property
    def wrong(self) -> tuple[int, float] | None:
        """The first step with a residual above `WRONG`, and that residual."""
        step = int(compiled.board["wrong_step"][0])
        return None if step < 0 else (step, float(compiled.board["wrong_residual"][0]))


@contextmanager
def judge_solver(model: mujoco.MjModel, data: mujoco.MjData, converged_below: float) -> Iterator[SolverConvergence]:
    """Write on the blackboard whose solver is judged, and wipe it at the end.

    Parameters
    ----------
    model, data
        What the callbacks are for inside the block.
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
    """Watch the solver of a model of MuJoCo's own contacts; parameters as in `judge_solver`.

    Raises
    ------
    EngineError
        If callbacks are in use already.
    """
    with install_callbacks(compiled.watch_iterations), judge_solver(model, data, converged_below) as convergence:
        yield convergence
