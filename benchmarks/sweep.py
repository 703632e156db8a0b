"""The cost of a sweep besides its engines, and its speed-up with workers.

python benchmarks/sweep.py    # overhead, bytes and speed-up from 1 to 2 processes; clusters: benchmarks/cluster.py
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
from rich.console import Console
from rich.table import Table

from velodrome.scenarios.sweep.plan import SweepPlan, plan_sweep
from velodrome.scenarios.sweep.run import Work, locally, run_sweep
from velodrome.scenarios.sweep.store import JOURNAL, RESULTS, TIMINGS, open_folder, write_results

# A straight ride's start is computed in a millisecond: the cost besides the engine is the sweep's own.
SWEEP = """
scenario = "iftomm-1"
engines = [{engines}]
[grid]
simulation.duration = [{duration}]
simulation.output_rate = [10.0]
[latin_hypercube]
count = {count}
seed = 1
ranges.perturbation.lean_rate = [-0.1, 0.5]
ranges.motion.speed = [4.4, 5.8]
"""


@dataclass(frozen=True)
class Measured:
    """Costs of one sweep.

    Attributes
    ----------
    rate : float
        Rows per second from the first row to the last, without the start of the workers.
    elapsed : float
        Total time [s].
    others : float
        Cores kept busy by other processes of this machine: above about 0.1, rates are not meaningful.
    engine, task, parent : float
        CPU time per row: in the engine, in the worker, in the process that distributes tasks and keeps rows [s].
    journal, results, timing : float
        Size per row [bytes].
    finish : float
        CPU time per row of making the data set from the journal [s].
    """

    rate: float
    elapsed: float
    others: float
    engine: float
    task: float
    parent: float
    journal: float
    results: float
    timing: float
    finish: float


def planned(folder: Path, engines: list[str], count: int, duration: float = 20.0) -> SweepPlan:
    """Plan a sweep of rides on the plane."""
    path = folder / "sweep.toml"
    path.write_text(SWEEP.format(engines=", ".join(f'"{name}"' for name in engines), count=count, duration=duration))
    return plan_sweep(path)


def measured(plan: SweepPlan, work: Work) -> Measured:
    """Run a sweep in a new folder and measure its costs."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out"
        begin, own, before = time.perf_counter(), time.process_time(), busy() - with_children()
        outcome = run_sweep(plan, out, work, False, lambda *_: None)
        elapsed, own = time.perf_counter() - begin, time.process_time() - own
        others = (busy() - with_children() - before) / elapsed
        assert outcome.stopped is None, outcome.stopped
        opened = open_folder(out, plan, resume=True)
        begin = time.process_time()
        write_results(out, plan, opened)
        finish = time.process_time() - begin
        timing = pq.read_table(out / TIMINGS)
        columns = {name: timing.column(name).to_numpy() for name in ("engine_time", "task_time", "finished")}
        results = sum(path.stat().st_size for path in (out / RESULTS).rglob("*.parquet"))
        journal, clock = (out / JOURNAL).stat().st_size, (out / TIMINGS).stat().st_size
    rows = len(plan.tasks)
    return Measured(
        rate=(rows - 1) / float(np.ptp(columns["finished"])),
        elapsed=elapsed,
        others=others,
        engine=float(columns["engine_time"].mean()),
        task=float(columns["task_time"].mean()),
        parent=(own - finish) / rows,
        journal=journal / rows,
        results=results / rows,
        timing=clock / rows,
        finish=finish / rows,
    )


def busy() -> float:
    """Return the CPU time of this machine so far, of all processes [s]."""
    user, nice, system, _, _, irq, soft, *_ = map(int, Path("/proc/stat").read_text().split()[1:9])
    return (user + nice + system + irq + soft) / os.sysconf("SC_CLK_TCK")


def with_children() -> float:
    """Return the CPU time of this process and of its children that have ended [s]."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def costs_table(folder: Path, engines: list[str], count: int) -> Table:
    """Measure the cost of a row, one engine at a time."""
    table = Table("engine", "rows", "rows/s", box=None, pad_edge=False)
    for title in ("engine", "worker's own", "parent's own", "data set's"):
        table.add_column(f"{title}\nms a row", justify="right")
    table.add_column("journal, data set,\ntiming: bytes a row", justify="right")
    for name in engines:
        rows = count if name == "reference" else max(20, count // 20)
        found = measured(planned(folder, [name], rows), locally(1))
        times = (found.engine, found.task - found.engine, found.parent, found.finish)
        sizes = f"{found.journal:.0f}, {found.results:.0f}, {found.timing:.0f}"
        table.add_row(name, str(rows), f"{found.rate:.3g}", *(f"{1e3 * seconds:.2f}" for seconds in times), sizes)
    return table


def speed_table(folder: Path, count: int, rounds: int) -> Table:
    """Measure the rows per second of one process and of two, in turn.

    On a shared machine the speed varies. The losses of the sweep itself show in how busy its workers are; the ratio
    of that is the speed-up at equal CPU time per row.
    """
    table = Table("processes", "rows/s", "seconds in all", "CPU ms a row", box=None, pad_edge=False)
    table.add_column("workers busy", justify="right")
    table.add_column("others' cores", justify="right")
    plan = planned(folder, ["reference"], count, 100.0)
    for _ in range(rounds):
        single, double = (measured(plan, locally(workers)) for workers in (1, 2))
        for workers, found in ((1, single), (2, double)):
            share = f"{found.rate * found.task / workers:.3f}"
            numbers = (f"{found.rate:.4g}", f"{found.elapsed:.3g}", f"{1e3 * found.task:.3g}", share)
            table.add_row(str(workers), *numbers, f"{found.others:.2f}")
        speed, equal = double.rate / single.rate, double.rate * double.task / (single.rate * single.task)
        table.add_row("2 / 1", f"{speed:.3f}", "", "", f"{equal:.3f}")
    return table


def main() -> None:
    """Measure and print the tables."""
    parser = argparse.ArgumentParser(description="The cost of a sweep besides its engines.")
    parser.add_argument("--rows", type=int, default=500, help="rows of the reference; slower engines get fewer")
    parser.add_argument("--rounds", type=int, default=2, help="repetitions of the speed-up")
    parser.add_argument("--engines", nargs="*", default=["reference", "mujoco-native", "exudyn"])
    options, console = parser.parse_args(), Console()
    console.print("load of this machine before: {:.1f} {:.1f} {:.1f}".format(*os.getloadavg()))
    with tempfile.TemporaryDirectory() as folder:
        begin = time.process_time()
        planned(Path(folder), ["reference"], 2000)
        console.print(f"planning: {(time.process_time() - begin) / 2:.3f} ms a run")
        if options.engines:
            console.print(costs_table(Path(folder), options.engines, options.rows))
        if options.rounds:
            console.print(speed_table(Path(folder), options.rows, options.rounds))


if __name__ == "__main__":
    main()
