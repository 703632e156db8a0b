"""Small sweeps and what comes of them."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq

from velodrome.scenarios.sweep.journal import finished_rows
from velodrome.scenarios.sweep.plan import SweepPlan, Task, plan_sweep
from velodrome.scenarios.sweep.pool import Done
from velodrome.scenarios.sweep.run import SweepOutcome, Work, locally, run_sweep
from velodrome.scenarios.sweep.store import JOURNAL, RESULTS, STAGING
from velodrome.scenarios.sweep.task import Tasks
from velodrome.scenarios.sweep.worker import Setup

# Upright starts are computed in a millisecond.
UPRIGHT = """
scenario = "iftomm-1"
time_limit = 60.0
[grid]
simulation.duration = [0.5]
simulation.output_rate = [20.0]
"""


def written(folder: Path, text: str, name: str = "small") -> Path:
    path = folder / f"{name}.toml"
    path.write_text(text)
    return path


def planned(folder: Path, text: str) -> SweepPlan:
    return plan_sweep(written(folder, text))


def here(setup: Setup, tasks: Sequence[Task]) -> Generator[Done]:
    """Work in this process, last task first."""
    work = Tasks(setup.base)
    for task in reversed(tasks):
        yield Done(task.index, *work.do(task.engine, task.changes))


def swept(plan: SweepPlan, out: Path, work: Work | int = here, resume: bool = False) -> SweepOutcome:
    return run_sweep(plan, out, locally(work) if isinstance(work, int) else work, resume, lambda _: None)


def rows(out: Path, engine: str = "reference") -> list[dict[str, Any]]:
    return pq.ParquetFile(out / RESULTS / f"engine={engine}" / "part-0.parquet").read().to_pylist()


def stored(out: Path) -> list[int]:
    """Return the tasks that have a row, in the journal or the tables; a task of which both have one stands once."""
    journal = {line.index for line in finished_rows(out / JOURNAL)}
    tables: list[int] = []
    for folder in (out / RESULTS).glob("*"):
        # A sorted file that is complete stands for all others, even before it is in its place.
        staged = out / STAGING / f"{folder.name}.parquet"
        for path in [staged] if staged.exists() else sorted(folder.glob("*.parquet")):
            tables += pq.ParquetFile(path).read(columns=["index"]).column("index").to_pylist()
    return [*tables, *(journal - set(tables))]


def data_set(out: Path) -> dict[str, bytes]:
    """Every file of the data set, to the byte."""
    folder = out / RESULTS
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
