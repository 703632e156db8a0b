"""A sweep from its file to its data set."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Collection, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from ..error import ScenarioError
from .journal import ForeignLine, Journal, JournalLine, finished_rows
from .plan import SweepPlan, Task
from .pool import Done, Pool, WorkersBroken
from .rows import REFUSED, reason_line
from .store import JOURNAL, Opened, open_folder, refuse_other_limits, write_results, write_sweep_manifest
from .worker import Setup

Work = Callable[[Setup, Sequence[Task]], Generator[Done]]
SweepWatch = Callable[[Task, Done, bool], None]


@dataclass(frozen=True)
class SweepOutcome:
    """Result of a sweep.

    Attributes
    ----------
    folder : Path
    counts : dict
        Rows by engine and status.
    missing : int
        Number of tasks without a row, and of those that were not tried again as requested.
    stopped : str or None
        Why the sweep stopped early; None if it did not.
    interrupted : bool
        Whether it was stopped by Ctrl-C.
    """

    folder: Path
    counts: dict[str, dict[str, int]]
    missing: int
    stopped: str | None
    interrupted: bool


def locally(workers: int) -> Work:
    """Return work on processes of this machine."""

    def work(setup: Setup, tasks: Sequence[Task]) -> Generator[Done]:
        if not tasks:
            return
        with Pool(setup, min(workers, len(tasks))) as pool:
            yield from pool.run(tasks)

    return work


def run_sweep(
    plan: SweepPlan, out: Path, work: Work, resume: bool, watch: SweepWatch, retry: Collection[str] = ()
) -> SweepOutcome:
    """Do the missing tasks of a sweep, and write its data set once none is missing.

    Parameters
    ----------
    plan : SweepPlan
    out : Path
        The sweep's own folder.
    work : callable
        Does tasks in any order, here or elsewhere.
    resume : bool
        Whether the folder already has a part of this sweep.
    watch : callable
        Called with every task, its row and whether the row is of this session; rows of earlier sessions come first.
    retry : collection of str
        Statuses of rows that are done again; the old row stays until there is a new one.

    Raises
    ------
    ScenarioError
        If the folder belongs to another sweep, or another process writes to it.
    """
    opened = open_folder(out, plan, resume)
    stopped, interrupted = None, False
    with Journal(out / JOURNAL) as journal:
        have = _read_stored(out / JOURNAL, plan, opened)
        refuse_other_limits(out, plan, opened, {status for status, _ in have.values()} - set(retry))
        missing = {task.index for task in plan.tasks if task.index not in have or have[task.index][0] in retry}
        for index, (status, reason) in have.items():
            if index not in missing:
                watch(plan.tasks[index], Done(index, {"status": status, "reason": reason}, {}), False)
        try:
            if missing:
                write_sweep_manifest(out, plan, opened, complete=False)
            with closing(_yield_results(plan, work, missing)) as arriving:
                for done in arriving:
                    task = plan.tasks[done.index]
                    journal.append(JournalLine(opened.key, task.key, done.index, done.row, done.timing))
                    have[done.index] = (done.row["status"], done.row["reason"])
                    missing.discard(done.index)
                    watch(task, done, True)
            journal.sync()
            write_results(out, plan, opened)
        except KeyboardInterrupt:
            stopped, interrupted = "interrupted", True
        except WorkersBroken as error:
            stopped = str(error)
        except OSError as error:
            stopped = f"cannot write: {error.strerror or error}"
    counts: dict[str, Counter[str]] = {engine: Counter() for engine in plan.file.engines}
    for index, (status, _) in have.items():
        counts[plan.tasks[index].engine][status] += 1
    rows = {name: dict(found) for name, found in counts.items()}
    return SweepOutcome(out, rows, len(missing), stopped, interrupted)


def _read_stored(path: Path, plan: SweepPlan, opened: Opened) -> dict[int, tuple[str, str | None]]:
    """Return status and reason of the rows of a journal, by the task's index.

    Raises
    ------
    ScenarioError
        If a row does not belong to this sweep.
    """
    found: dict[int, tuple[str, str | None]] = {}
    try:
        for _, line in finished_rows(path):
            task = plan.tasks[line.index] if 0 <= line.index < len(plan.tasks) else None
            if line.sweep != opened.key or task is None or line.key != task.key:
                raise ForeignLine(f"the row {line.key}")
            found[line.index] = (sys.intern(line.row["status"]), line.row.get("reason"))
    except ForeignLine as error:
        raise ScenarioError(f"{path}: has {error}, which is not of this sweep; name another folder by --out") from error
    return found


def _yield_results(plan: SweepPlan, work: Work, missing: Collection[int]) -> Generator[Done]:
    """Yield rows of all missing tasks, beginning with those that are refused, which need no work."""
    tasks = [task for task in plan.tasks if task.index in missing]
    for task in tasks:
        if task.refused is not None:
            yield Done(task.index, {"status": REFUSED, "reason": reason_line(task.refused)}, {})
    with closing(work(_make_setup(plan), [task for task in tasks if task.refused is None])) as arriving:
        yield from arriving


def _make_setup(plan: SweepPlan) -> Setup:
    return Setup(plan.base, plan.file.time_limit, plan.file.memory_limit)
