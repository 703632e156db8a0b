"""A sweep from its file to its data set."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..error import ScenarioError
from .journal import ForeignLine, Journal, JournalLine, finished_rows
from .plan import SweepPlan, Task
from .pool import Done, Pool, WorkersBroken
from .rows import BROKEN, STATUSES
from .selection import SelectedTasks
from .store import JOURNAL, Opened, open_folder, refuse_other_limits, write_results, write_sweep_manifest
from .worker import Setup

_STATUSES = ("", *STATUSES)
_CODES = {status: code for code, status in enumerate(_STATUSES)}

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
        statuses, reasons = _read_stored(out / JOURNAL, plan, opened)
        again = np.isin(statuses, [_CODES[status] for status in retry])
        refuse_other_limits(out, plan, opened, _list_statuses(statuses) - set(retry))
        missing = SelectedTasks(plan.tasks, (statuses == 0) | again)
        left = len(missing)
        for index in np.flatnonzero((statuses > 0) & ~again).tolist():
            row = {"status": _STATUSES[statuses[index]], "reason": reasons.get(index)}
            watch(plan.tasks[index], Done(index, row, {}), False)
        try:
            if left:
                write_sweep_manifest(out, plan, opened, complete=False)
            setup = Setup(plan.base, plan.file.time_limit, plan.file.memory_limit)
            with closing(work(setup, missing)) as arriving:
                for done in arriving:
                    task = plan.tasks[done.index]
                    journal.append(JournalLine(opened.key, task.key, done.index, done.row, done.timing))
                    statuses[done.index] = _CODES[done.row["status"]]
                    left -= 1
                    watch(task, done, True)
            journal.sync()
            write_results(out, plan, opened)
        except KeyboardInterrupt:
            stopped, interrupted = "interrupted", True
        except WorkersBroken as error:
            stopped = str(error)
        except OSError as error:
            stopped = f"cannot write: {error.strerror or error}"
    return SweepOutcome(out, _count_rows(plan, statuses), left, stopped, interrupted)


def _list_statuses(codes: np.ndarray) -> set[str]:
    return {_STATUSES[code] for code in np.unique(codes[codes > 0])}


def _count_rows(plan: SweepPlan, codes: np.ndarray) -> dict[str, dict[str, int]]:
    """Return the numbers of rows by engine and status."""
    counts: dict[str, Counter[str]] = {engine: Counter() for engine in plan.file.engines}
    for index in np.flatnonzero(codes).tolist():
        counts[plan.tasks.find_engine_of(index)][_STATUSES[codes[index]]] += 1
    return {name: dict(found) for name, found in counts.items()}


def _read_stored(path: Path, plan: SweepPlan, opened: Opened) -> tuple[np.ndarray, dict[int, str | None]]:
    """Return a code for the status of every task, 0 where there is no row, and why broken rows broke, by index.

    Raises
    ------
    ScenarioError
        If a row does not belong to this sweep.
    """
    codes = np.zeros(len(plan.tasks), np.uint8)
    reasons: dict[int, str | None] = {}
    try:
        for _, line in finished_rows(path):
            # The sweep's key is a digest of all its tasks: with it, the index says which task it is.
            if line.sweep != opened.key or not 0 <= line.index < len(codes):
                raise ForeignLine(f"the row {line.key}")
            codes[line.index] = _CODES[line.row["status"]]
            if line.row["status"] in BROKEN:
                reasons[line.index] = line.row.get("reason")
    except ForeignLine as error:
        raise ScenarioError(f"{path}: has {error}, which is not of this sweep; name another folder by --out") from error
    return codes, reasons
