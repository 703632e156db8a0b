"""The cost of rolling in Exudyn and its parts: `python benchmarks/exudyn_joint.py`.

All times are process CPU times at a step of 1 ms, measured in alternating rounds. On a busy machine only the
ratios (median of the ratios within a round) to the library's own rolling disc on the level plane are meaningful.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import Any

import exudyn as exu
import numpy as np
from rich.console import Console
from rich.table import Table

from velodrome.engines.engine import Problem
from velodrome.engines.exudyn.engine import BUILTIN, ENGINE, PLANE_NORMAL, ExudynEngine
from velodrome.engines.exudyn.model import Model, build_model
from velodrome.engines.exudyn.solve import Integration, no_progress, simulation_settings
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.dae import consistent_state
from velodrome.reference.surface import Paraboloid, Plane, Surface

STEP, DURATION = 1e-3, 1.0
LEVEL, BOWL = Plane(), Paraboloid(0.005)
RUNS = {
    "exudyn-builtin, plane": (BUILTIN, LEVEL),
    "exudyn, plane": (ENGINE, LEVEL),
    "exudyn, bowl": (ENGINE, BOWL),
    "exudyn-plane-normal, bowl": (PLANE_NORMAL, BOWL),
}
TIMERS = {
    "factorization": ("factorization",),
    "back substitution": ("newtonIncrement",),
    "mass matrix and forces": ("massMatrix", "ODE2RHS"),
    "constraint forces": ("reactionForces",),
    "constraints": ("AERHS",),
    "Jacobian": ("totalJacobian",),
    "before-residual function": ("python",),
    "the rest": ("integrationFormula", "writeSolution", "overhead", "visualization", "ODE1RHS"),
}


def problem(surface: Surface) -> Problem:
    """Build a disturbed ride at strong lean."""
    q, qd = consistent_state(Bicycle(), surface, (0.986, 2.148), 0.737, 2.837, (0.1, 0.0, 18.0))
    return Problem(Bicycle(), surface, q, qd, np.arange(round(100 * DURATION) + 1) / 100)


def assembled(engine: ExudynEngine, surface: Surface) -> Model:
    """Assemble a model."""
    return build_model(problem(surface), engine.settings(), engine.put_on_ground())


def solve(model: Model, timers: bool = False) -> tuple[float, Any]:
    """Return the CPU time per simulated second, and the solver."""
    integration = Integration(DURATION, round(DURATION / STEP), round(100 * DURATION), BUILTIN.settings())
    settings: Any = simulation_settings(integration)
    settings.show.computationTime = timers
    solver: Any = exu.MainSolverImplicitSecondOrder()
    begin = time.process_time()
    solver.SolveSystem(model.system, settings)
    return (time.process_time() - begin) / DURATION, solver


def speed_table(rounds: int) -> Table:
    """Time all runs."""
    seconds = np.array([[solve(assembled(*run))[0] for run in RUNS.values()] for _ in range(rounds)])
    table = Table("CPU s per simulated second", "min", "median", "max", "ratio", box=None, pad_edge=False)
    for name, values in zip(RUNS, seconds.T, strict=True):
        cells = [f"{value:.3f}" for value in (values.min(), np.median(values), values.max())]
        table.add_row(name, *cells, f"{np.median(values / seconds[:, 0]):.2f}")
    return table


def profile_table(rounds: int) -> Table:
    """Split the time of a step by the engine's own timers."""
    table = Table("us a step, median", *RUNS, box=None, pad_edge=False)
    parts: dict[str, list[str]] = {name: [] for name in (*TIMERS, "iterations a step")}
    for run in RUNS.values():
        solvers = [solve(assembled(*run), timers=True)[1] for _ in range(rounds)]
        for name, timers in TIMERS.items():
            spent = np.median([sum(getattr(solver.timer, timer) for timer in timers) for solver in solvers])
            parts[name].append(f"{spent / DURATION * STEP * 1e6:.1f}")
        parts["iterations a step"].append(f"{solvers[0].it.newtonStepsCount * STEP / DURATION:.2f}")
    for name, cells in parts.items():
        table.add_row(name, *cells)
    return table


def call_table(rounds: int) -> Table:
    """Time the joint's user functions, called as the engine calls them, without its conversions."""
    model = assembled(ENGINE, BOWL)
    item = model.system.GetObject(model.rolling.joint.objectNumber)  # pyright: ignore[reportAttributeAccessIssue]
    constraint, jacobian = (item[name]["function"] for name in ("constraintUserFunction", "jacobianUserFunction"))
    here = list(model.system.systemData.GetODE2CoordinatesTotal())[14:]  # those of the wheels come after the frames'
    there, rates = [here[0] + 1e-3, *here[1:]], [0.1] * 14

    def call(function: Callable[..., Any], *states: list[float]) -> float:
        begin, count = time.process_time(), 2000
        for _ in range(count):
            for state in states:
                function(model.system, 0.0, 0, state, rates, False)
        return (time.process_time() - begin) / count / len(states) * 1e6

    table = Table("us a call, median", "", box=None, pad_edge=False)
    for name, work in {
        "Jacobian at new coordinates": lambda: call(jacobian, here, there),
        "Jacobian or constraints at known coordinates": lambda: call(constraint, here),
    }.items():
        table.add_row(name, f"{np.median([work() for _ in range(rounds)]):.2f}")
    return table


def main() -> None:
    """Measure and print the tables."""
    parser = argparse.ArgumentParser(description="The cost of rolling in Exudyn.")
    parser.add_argument("--rounds", type=int, default=9, help="repetitions of each measurement")
    rounds, console = parser.parse_args().rounds, Console(width=140)
    with no_progress():
        for table in (speed_table(rounds), profile_table(rounds), call_table(rounds)):
            console.print(table)
            console.print()


if __name__ == "__main__":
    main()
