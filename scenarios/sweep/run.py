"""A sweep from its file to its data set."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Generator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from .plan import SweepPlan, Task
from .pool import Done, Pool, WorkersBroken
from .results import ResultStore
from .selection import SelectedTasks
from .store import mark_complete, note_limits, open_folder, refuse_other_limits, write_sweep_manifest
from .worker import Setup

Work = Callable[[Setup, Sequence[Task]], Generator[Done]]
SweepWatch = Callable[[Done], None]


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
    plan: SweepPlan,
    out: Path,
    work: Work,
    resume: bool,
    watch: SweepWatch,
    retry: Collection[str] = (),
    recall: Callable[[Mapping[str, int]], None] = lambda counts: None,
) -> SweepOutcome:
    """Do the missing tasks of a sweep, and sort its data set once none is missing.

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
        Called with every row of this session.
    retry : collection of str
        Statuses of rows that are done again; the old row stays until there is a new one.
    recall : callable
        Called once, with the numbers of rows of earlier sessions by status, without those that are done again.

    Raises
    ------
    ScenarioError
        If the folder belongs to another sweep, another process writes to it, or a file in it is damaged.
    """
    opened = open_folder(out, plan, resume)
    stopped, interrupted = None, False
    with ResultStore(out, plan, opened) as store:
        refuse_other_limits(out, plan, opened, store.list_statuses() - set(retry))
        opened = note_limits(plan, opened, store.list_statuses())
        missing = SelectedTasks(plan.tasks, store.select_missing(retry))
        left = len(missing)
        recall(_sum_counts(store.counts, set(retry)))
        try:
            if left:
                write_sweep_manifest(out, plan, opened, complete=False)
            setup = Setup(plan.base, plan.file.time_limit, plan.file.memory_limit)
            with closing(work(setup, missing)) as arriving:
                for done in arriving:
                    store.add(done)
                    left -= 1
                    watch(done)
            if left:
                raise WorkersBroken("the work ended before all runs were done")
            store.finish()
            mark_complete(out, plan, opened)
        except KeyboardInterrupt:
            stopped, interrupted = "interrupted", True
        except WorkersBroken as error:
            stopped = str(error)
        except OSError as error:
            stopped = f"cannot write: {error.strerror or error}"
        counts = store.counts
    return SweepOutcome(out, counts, left, stopped, interrupted)


def _sum_counts(counts: Mapping[str, Mapping[str, int]], left_out: Collection[str]) -> dict[str, int]:
    """Return numbers of rows by status, of all engines together."""
    total: Counter[str] = Counter()
    for found in counts.values():
        total.update({status: n for status, n in found.items() if status not in left_out})
    return dict(total)
