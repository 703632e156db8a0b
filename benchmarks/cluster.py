"""What a Dask cluster costs beside its rides, and where a large one stops growing.

python benchmarks/cluster.py                # clusters of 2, 4 and 8 workers on this machine, and what follows for 1000
python benchmarks/cluster.py --workers 2    # one of 2 workers only

Two cores cannot ride for eight workers. So the workers sleep for a ride's time and return rows of real rides: what is
left is the cost of the scheduler and the client, which are real. Their CPU times are what the model needs; the rates
are of the clock and mean something on an idle machine only.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from velodrome.scenarios.sweep import batches
from velodrome.scenarios.sweep.cluster import on_cluster
from velodrome.scenarios.sweep.plan import SweepPlan, Task, plan_sweep
from velodrome.scenarios.sweep.pool import ONE_THREAD, Done, Pool
from velodrome.scenarios.sweep.run import run_sweep
from velodrome.scenarios.sweep.selection import SelectedTasks
from velodrome.scenarios.sweep.worker import Setup

EXAMPLE = Path(__file__).parents[1] / "examples" / "sweeps" / "disturbed.toml"
SAMPLE = 320  # real rides, whose rows the sleeping workers return
DURATION = 15.0  # [s] of a sweep whose rate is measured
SETTLING = 5.0  # [s] until a new cluster's processes are at rest, and over which their CPU time at rest is measured
SIZES = (8, 64, 1000)  # workers of the model


@dataclass(frozen=True)
class Costs:
    """What a sweep of sleeping tasks took.

    Attributes
    ----------
    rows, batches : int
    elapsed : float
        From the first row to the last [s].
    client, scheduler : float
        CPU time beyond that of the same time at rest [s].
    resting : float
        CPU time of the scheduler per second at rest.
    """

    rows: int
    batches: int
    elapsed: float
    client: float
    scheduler: float
    resting: float


def plan_rides(folder: Path, count: int) -> SweepPlan:
    """Plan the example with so many rides."""
    path = folder / f"rides-{count}.toml"
    path.write_text(EXAMPLE.read_text().replace("count = 2000", f"count = {count}"))
    return plan_sweep(path)


def select_all(plan: SweepPlan) -> SelectedTasks:
    """Select all tasks of a sweep."""
    return SelectedTasks(plan.tasks, np.ones(len(plan.tasks), bool))


def ride_sample(plan: SweepPlan) -> tuple[list[Done], float]:
    """Ride a few tasks; return their rows and the time of one [s]."""
    with Pool(Setup(plan.base, plan.file.time_limit, None), 1) as pool:
        rows = list(pool.run(plan.tasks[:SAMPLE]))
        return rows, pool.elapsed() / len(rows)


def plant_sleep(rows: list[Done], seconds: float) -> None:
    """Let a Dask worker sleep where it would ride; called on the worker."""
    import time

    from velodrome.scenarios.sweep import cluster_worker
    from velodrome.scenarios.sweep.pool import Done

    class SleepingPool:
        def __init__(self, setup: Any, workers: int) -> None:
            self._slept = 0.0

        def run(self, tasks: Sequence[Any], longest: float) -> Iterator[Done]:
            self._slept = seconds * len(tasks)
            time.sleep(self._slept)
            for task in tasks:
                row = rows[task.index % len(rows)]
                yield Done(task.index, row.row, row.timing)

        def elapsed(self) -> float:
            return self._slept

        def close(self) -> None: ...

    cluster_worker.Pool = SleepingPool  # type: ignore[assignment, misc]


def measure_costs(
    plan: SweepPlan, rows: list[Done], workers: int, threads: int, seconds: float, span: float | None = None
) -> Costs:
    """Run a sweep of sleeping tasks on a new cluster.

    Parameters
    ----------
    plan : SweepPlan
    rows : list of Done
        Rows to return.
    workers, threads : int
        Processes, and threads of each.
    seconds : float
        Time of a task [s].
    span : float or None
        Time of a batch [s]; by default what a sweep chooses.
    """
    from distributed import Client

    usual, counted = (batches._SPAN, batches.Batches.learn), list[int]()

    def count_batch(self: Any, count: int, *rest: Any) -> None:
        counted.append(count)
        usual[1](self, count, *rest)

    with open_cluster(workers, threads) as (address, scheduler):
        with Client(address, set_as_default=False) as client:
            client.wait_for_workers(workers)
            client.run(plant_sleep, rows, seconds)
        work = on_cluster(address)
        time.sleep(SETTLING)
        resting = measure_rest(scheduler)
        batches._SPAN = usual[0] if span is None else span
        batches.Batches.learn = count_batch  # type: ignore[method-assign]
        try:
            before, own, found = read_cpu_time(scheduler), time.process_time(), 0
            begin = first = time.perf_counter()
            for _ in work(Setup(plan.base, plan.file.time_limit, None), select_all(plan)):
                found += 1
                first = time.perf_counter() if found == 1 else first
            end = time.perf_counter()
            client_time = time.process_time() - own
            spent = read_cpu_time(scheduler) - before - resting * (end - begin)
        finally:
            batches._SPAN, batches.Batches.learn = usual  # type: ignore[method-assign]
    assert found == len(plan.tasks)
    return Costs(found, len(counted), end - first, client_time, spent, resting)


def measure_keeping(plan: SweepPlan, rows: list[Done]) -> float:
    """Return the CPU time per row of `run_sweep` itself, which keeps the journal [s]; without the data set."""
    spent = 0.0

    def work(setup: Setup, tasks: Sequence[Task]) -> Generator[Done]:
        nonlocal spent
        begin = time.process_time()
        for index in range(len(plan.tasks)):
            row = rows[index % len(rows)]
            yield Done(index, row.row, row.timing)
        spent = (time.process_time() - begin) / len(plan.tasks)

    with tempfile.TemporaryDirectory() as folder:
        outcome = run_sweep(plan, Path(folder) / "out", work, False, lambda *_: None)
        assert outcome.stopped is None, outcome.stopped
    return spent


def split_costs(many_batches: Costs, many_rows: Costs, take: Callable[[Costs], float]) -> tuple[float, float]:
    """Return the CPU time of a batch and of a row [s] from two sweeps with different numbers of rows a batch."""
    runs = (many_batches, many_rows)
    per_batch, per_row = np.linalg.solve([[run.batches, run.rows] for run in runs], [take(run) for run in runs])
    return float(per_batch), float(per_row)


@contextmanager
def open_cluster(workers: int, threads: int = 1) -> Iterator[tuple[str, int]]:
    """Run a scheduler and its workers; yield its address and process id."""
    address = "tcp://127.0.0.1:18786"
    # The module is called since its console script need not be on the path.
    dask = [sys.executable, "-m", "dask"]
    with tempfile.TemporaryDirectory() as folder:
        quiet: dict[str, Any] = {
            "cwd": folder,
            "stdout": subprocess.DEVNULL,
            "stderr": subprocess.DEVNULL,
            "env": os.environ | ONE_THREAD,
        }
        scheduler = subprocess.Popen(
            [*dask, "scheduler", "--host", "127.0.0.1", "--port", "18786", "--no-dashboard"], **quiet
        )
        own = ["--nworkers", str(workers), "--nthreads", str(threads), "--host", "127.0.0.1", "--no-dashboard"]
        members = subprocess.Popen([*dask, "worker", address, *own], **quiet)
        try:
            yield address, scheduler.pid
        finally:
            for process in (members, scheduler):
                process.terminate()
                process.wait()


def measure_rest(pid: int) -> float:
    """Return the CPU time per second of a process at rest."""
    before = read_cpu_time(pid)
    time.sleep(SETTLING)
    return (read_cpu_time(pid) - before) / SETTLING


def read_cpu_time(pid: int) -> float:
    """Return the CPU time of a process [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def rates_table(folder: Path, rows: list[Done], ride_time: float, sizes: Sequence[int]) -> Table:
    """Measure clusters whose tasks sleep for a ride's time: the share of their time that workers sleep."""
    table = Table("Dask workers", "rows/s", "of the ideal", "batches", "rows a batch", box=None, pad_edge=False)
    for workers in sizes:
        found = measure_costs(plan_rides(folder, int(workers * DURATION / ride_time)), rows, workers, 1, ride_time)
        rate = found.rows / found.elapsed
        share = f"{rate * ride_time / workers:.3f}"
        table.add_row(str(workers), f"{rate:.4g}", share, str(found.batches), f"{found.rows / found.batches:.0f}")
    return table


def model_table(ride_times: dict[str, float], client: tuple[float, float], scheduler: tuple[float, float]) -> Table:
    """Reckon how busy the client and the scheduler are with workers that always ride.

    A worker finishes a batch each time that the batches last, and a row each ride's time. The client and the scheduler
    are a process each: what they have to do in a second must take less than one.
    """
    table = Table(
        "rides of", "workers", "batches/s", "rows/s", "client busy", "scheduler busy", box=None, pad_edge=False
    )
    table.add_column("full with\nworkers", justify="right")
    for name, ride_time in ride_times.items():
        for workers in SIZES:
            span = max(batches._SPAN, workers / batches._RATE, ride_time)
            span = min(span, max(ride_time, batches._LARGEST * ride_time))
            rates = np.array([workers / span, workers / ride_time])
            busy = {"client": float(rates @ client), "scheduler": float(rates @ scheduler)}
            first = max(busy, key=lambda who: busy[who])
            # Proportional to the workers, but for the batches of large clusters, which are longer.
            limit = f"{workers / busy[first]:.0f}, {first}"
            numbers = (f"{rates[0]:.0f}", f"{rates[1]:.4g}", f"{busy['client']:.2f}", f"{busy['scheduler']:.2f}")
            table.add_row(name, str(workers), *numbers, limit)
    return table


def main() -> None:
    """Measure and print the tables."""
    parser = argparse.ArgumentParser(description="What a Dask cluster costs beside its rides.")
    parser.add_argument("--workers", type=int, nargs="*", default=[2, 4, 8], help="sizes of clusters on this machine")
    parser.add_argument("--rows", type=int, default=20_000, help="rows of a sweep")
    options, console = parser.parse_args(), Console()
    console.print("load of this machine before: {:.1f} {:.1f} {:.1f}".format(*os.getloadavg()))
    with tempfile.TemporaryDirectory() as folder:
        many = plan_rides(Path(folder), options.rows)
        rows, ride_time = ride_sample(many)
        console.print(f"a ride of the reference with its row: {1e3 * ride_time:.2f} ms")
        if options.workers:
            console.print(rates_table(Path(folder), rows, ride_time, options.workers))
        # Rows of no time in the largest batches; and batches of two rows, as many at once as sixty-four threads do.
        large = measure_costs(plan_rides(Path(folder), 10 * options.rows), rows, 8, 1, 0.0)
        small = measure_costs(plan_rides(Path(folder), options.rows // 2), rows, 8, 8, 0.05, span=0.1)
        client = split_costs(small, large, lambda run: run.client)
        scheduler = split_costs(small, large, lambda run: run.scheduler)
        keeping = measure_keeping(many, rows)
    table = Table("CPU time", "a batch, ms", "a row, µs", box=None, pad_edge=False)
    table.add_row("client, Dask and rows", f"{1e3 * client[0]:.2f}", f"{1e6 * client[1]:.1f}")
    table.add_row("client, journal", "", f"{1e6 * keeping:.1f}")
    table.add_row("scheduler", f"{1e3 * scheduler[0]:.2f}", f"{1e6 * scheduler[1]:.1f}")
    console.print(table)
    console.print(f"scheduler of 8 workers at rest: {small.resting:.3f} of a core")
    rides = {f"{1e3 * ride_time:.1f} ms": ride_time, "100 ms": 0.1, "1.8 s": 1.8}
    console.print(model_table(rides, (client[0], client[1] + keeping), scheduler))


if __name__ == "__main__":
    main()
