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

from . import layout
from .inertia import find_inertia
from .settings import WRONG

_TIMER = mujoco.mjtTimer
STATE = (
    "qvel",
    "geom_xpos",
    "geom_xmat",
    "qacc",
    "qacc_smooth",
    "qacc_warmstart",
    "qfrc_bias",
    "qfrc_passive",
    "qfrc_smooth",
    "qfrc_constraint",
)


def share(residual: float) -> str:
    """Return in words what a relative residual means for the forces."""
    return f"its forces are off by up to {2 * residual:.2g} times themselves"


class SolverConvergence:
    """Convergence of MuJoCo's solver since a block began, as the callbacks have recorded it.

    Parameters
    ----------
    board : ndarray, shape (1,)
        The blackboard of the state.
    """

    def __init__(self, board: np.ndarray) -> None:
        self._board = board

    def begin(self, steps: int) -> None:
        """Count the evaluations from here on as those of the step after ``steps`` steps and of the following steps."""
        self.look()
        self._board["since_step"], self._board["evaluations"] = steps, 0

    def look(self) -> None:
        """Assess the last evaluation too, which otherwise happens only in the next one."""
        from . import compiled  # needs functions that not all releases have whose contacts are MuJoCo's own

        compiled.judge(self._board)

    def detach(self) -> None:
        """Keep the record as it is when the block ends: its blackboard will be used again."""
        self._board = self._board.copy()
        self._board["data"] = 0

    @property
    def unconverged(self) -> int:
        """Number of steps in which the solver's residual exceeded the limit."""
        return int(self._board["unconverged"][0])

    @property
    def largest(self) -> float | None:
        """Largest relative residual; None where no solver was assessed."""
        residual = float(self._board["largest_residual"][0])
        return residual if residual >= 0 else None

    @property
    def wrong(self) -> tuple[int, float] | None:
        """First step with a residual above `WRONG`, and that residual; None if there is none."""
        step = int(self._board["wrong_step"][0])
        return None if step < 0 else (step, float(self._board["wrong_residual"][0]))


@contextmanager
def watch_state(
    board: np.ndarray, model: mujoco.MjModel, data: mujoco.MjData, converged_below: float
) -> Iterator[None]:
    """Write a state on a blackboard: from here to the end of the block the callbacks act on it.

    Parameters
    ----------
    board : ndarray, shape (1,)
    model, data
        The model and state on which the callbacks act inside the block.
    converged_below : float
        Relative residual up to which an evaluation counts as converged.
    """
    from . import compiled

    matrix = find_inertia(model, data)
    entry, inertia, smooth, forces = board[0], np.zeros(len(matrix.M)), np.zeros(model.nv), np.zeros((3, model.nv))
    for name in STATE:
        entry[name] = getattr(data, name).ctypes.data
    for name, array in matrix._asdict().items():
        entry[name] = array.ctypes.data
    entry["kept_M"], entry["M_entries"], entry["speeds"] = inertia.ctypes.data, len(inertia), model.nv
    entry["kept_smooth"] = smooth.ctypes.data
    for name, array in zip(("passive_before", "passive_after", "smooth_after"), forces, strict=True):
        entry[name] = array.ctypes.data
    # Nobody counts the solutions where MuJoCo's own contacts are watched only.
    if entry["kind"] != compiled.WATCHING:
        offsets = layout.find_layout()
        entry["solutions_at"], entry["inverses_at"] = offsets.solutions, offsets.inverses
    timers = [data.timer[int(timer)].number for timer in (_TIMER.mjTIMER_CONSTRAINT, _TIMER.mjTIMER_INVERSE)]
    # As if the callback had been called before the last solution.
    entry["solved"] = timers[0] - timers[1] - 1
    entry["evaluations_per_step"] = 4 if model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4 else 1
    entry["converged_below"], entry["wrong_above"] = converged_below, WRONG
    entry["last_unconverged"] = entry["wrong_step"] = entry["largest_residual"] = -1
    entry["model"], entry["data"] = model._address, data._address
    try:
        yield
    finally:
        entry["model"] = entry["data"] = 0


class UnknownConvergence:
    """Convergence of a solver that nobody watches, with the members of `SolverConvergence`."""

    unconverged = 0
    largest = None
    wrong = None

    def begin(self, steps: int) -> None:
        """Do nothing."""

    def look(self) -> None:
        """Do nothing."""


@contextmanager
def leave_unwatched() -> Iterator[UnknownConvergence]:
    """Yield the convergence of a solver that nobody watches."""
    yield UnknownConvergence()


@contextmanager
def watch_solver(model: mujoco.MjModel, data: mujoco.MjData, converged_below: float) -> Iterator[SolverConvergence]:
    """Record the convergence of the solver for a model with MuJoCo's own contacts; parameters as in `watch_state`.

    Raises
    ------
    EngineError
        If the state has a block already.
    """
    from . import compiled
    from .callbacks import claim_board

    with claim_board(data, compiled.WATCHING) as board, watch_state(board, model, data, converged_below):
        convergence = SolverConvergence(board)
        try:
            yield convergence
        finally:
            convergence.look()
            convergence.detach()
