"""A sweep from its file to its data set."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from scenarios.error import ScenarioError

from .journal import Journal, finished
from .plan import Plan, Task
from .pool import Done, Pool, WorkersBroken
from .store import JOURNAL, open_folder, write_results
from .worker import Setup

Work = Callable[[Setup, Sequence[Task]], Generator[Done]]
Watch = Callable[[Task, Done, bool], None]


@dataclass(frozen=True)
class Outcome:
    """What a sweep came to.

    Attributes
    ----------
    folder : Path
    counts : dict
        Rows by engine and status.
    missing : int
        Tasks without a row.
    stopped : str or None
        Why it ended before its end; None if it did not.
    interrupted : bool
        Whether Ctrl-C did it.
    """

    folder: Path
    counts: dict[str, dict[str, int]]
    missing: int
    stopped: str | None
    interrupted: bool


def locally(workers: int) -> Work:
    """Work on processes of this machine."""

    def work(setup: Setup, tasks: Sequence[Task]) -> Generator[Done]:
        if not tasks:
            return
        with Pool(setup, min(workers, len(tasks))) as pool:
            yield from pool.run(tasks)

    return work


def run_sweep(plan: Plan, out: Path, work: Work, resume: bool, watch: Watch) -> Outcome:
    """Do what is missing of a sweep, and make its data set once nothing is.

    Parameters
    ----------
    plan : Plan
    out : Path
        The sweep's own folder.
    work : callable
        Does tasks, in any order, here or elsewhere.
    resume : bool
        Whether the folder holds a part of this sweep.
    watch : callable
        Called with every task, its row and whether it is of this session; those of earlier ones come first.

    Raises
    ------
    ScenarioError
        If the folder is not this sweep's, or another process writes to it.
    """
    open_folder(out, plan, resume)
    path = out / JOURNAL
    stopped, interrupted = None, False
    counts: dict[str, Counter[str]] = {engine: Counter() for engine in plan.file.engines}
    have: set[int] = set()

    def count(done: Done, fresh: bool) -> None:
        task = plan.tasks[done.index]
        have.add(done.index)
        counts[task.engine][done.row["status"]] += 1
        watch(task, done, fresh)

    with Journal(path) as journal:
        for _, index, row, timing in finished(path):
            if index >= len(plan.tasks):
                raise ScenarioError(f"{path}: has a row that is not of this sweep")
            count(Done(index, row, timing), fresh=False)
        missing = [task for task in plan.tasks if task.index not in have]
        try:
            with closing(work(_setup(plan), missing)) as arriving:
                for done in arriving:
                    journal.append(done.index, done.row, done.timing)
                    count(done, fresh=True)
            journal.sync()
            write_results(out, plan)
        except KeyboardInterrupt:
            stopped, interrupted = "interrupted", True
        except WorkersBroken as error:
            stopped = str(error)
        except OSError as error:
            stopped = f"cannot write: {error.strerror or error}"
    rows = {name: dict(found) for name, found in counts.items()}
    return Outcome(out, rows, len(plan.tasks) - len(have), stopped, interrupted)


def _setup(plan: Plan) -> Setup:
    return Setup(plan.base, plan.file.time_limit, plan.file.memory_limit)
