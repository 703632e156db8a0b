"""Workers on a Dask cluster: the same tasks, in the same kind of process, so the same rows to the bit.

Each thread of a Dask worker keeps one worker process of `pool`: limits, crashes and their rows are what they
are on one machine, and a Dask worker dies of no engine. One that is lost for another reason has its batches done
elsewhere. Dask's protocol carries pickles: a scheduler that is not to be trusted must not be connected to.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Generator, Sequence
from concurrent.futures import CancelledError
from functools import cache
from typing import Any

from ..error import ScenarioError
from ..run import library_versions
from .plan import Task
from .pool import Done, Pool, WorkersBroken
from .run import Work
from .worker import Setup

_FIRST, _LARGEST, _SPAN = 4, 250, 1.0  # tasks in a batch: the first ones, at most; seconds that it should take
_IN_FLIGHT = 3  # batches a thread: one at work, the next at hand
_PATIENCE = 30  # seconds for a scheduler to answer and for a first worker to come

_here = threading.local()


def on_cluster(address: str) -> Work:
    """Work on the cluster of a Dask scheduler, e.g. ``tcp://127.0.0.1:8786``.

    Raises
    ------
    ScenarioError
        If Dask is not installed, or there is no scheduler.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise ScenarioError("--scheduler needs Dask: pip install 'velodrome[cluster]'") from error
    try:
        client = Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ScenarioError(f"--scheduler {address}: no Dask scheduler answers there") from error

    def work(setup: Setup, tasks: Sequence[Task]) -> Generator[Done]:
        try:
            if tasks:
                yield from _distributed(client, setup, tasks)
        except (CancelledError, OSError) as error:
            raise WorkersBroken(f"the scheduler at {address} has gone") from error
        finally:
            client.close()

    return work


def _distributed(client: Any, setup: Setup, tasks: Sequence[Task]) -> Generator[Done]:
    from distributed import KilledWorker, as_completed

    try:
        client.wait_for_workers(1, timeout=_PATIENCE)
    except TimeoutError as error:
        raise WorkersBroken(f"no worker has come to the scheduler within {_PATIENCE} s") from error
    batches, versions = _Batches(tasks, setup.time_limit), library_versions()
    at_work: dict[Any, list[Task]] = {}
    arriving = as_completed(loop=client.loop)

    def submit() -> None:
        threads = max(1, sum(client.nthreads().values()))
        while len(at_work) < _IN_FLIGHT * threads and (batch := batches.next(threads)):
            future = client.submit(do_batch, setup, batch, versions, pure=False)
            at_work[future] = batch
            arriving.add(future)

    submit()
    while at_work:
        future = next(arriving)
        batch = at_work.pop(future)
        try:
            found = future.result()
        except OSError as error:
            raise WorkersBroken(f"a Dask worker, or the way to it, has failed: {error}") from error
        except KilledWorker:
            found = batches.lost(batch)
        else:
            batches.learn(found)
        future.release()
        submit()
        yield from found


class _Batches:
    """Tasks in batches that take about a second: one costs the scheduler some ten milliseconds.

    Parameters
    ----------
    tasks : sequence of Task
    time_limit : float
        What a task counts for that did not come to its end [s].
    """

    def __init__(self, tasks: Sequence[Task], time_limit: float) -> None:
        self._waiting = deque(tasks)
        self._alone: deque[Task] = deque()
        self._time_limit = time_limit
        self._rows, self._seconds = 0, 0.0

    def next(self, threads: int) -> list[Task]:
        """The next batch; neighbours, who share a start. Empty when all are out."""
        if self._alone:
            return [self._alone.popleft()]
        size = _FIRST if not self._rows else int(min(_LARGEST, _SPAN * self._rows / max(self._seconds, 1e-6)))
        # The last batches are smaller: no worker is to wait long for another's.
        size = min(len(self._waiting), max(1, min(size, len(self._waiting) // (2 * threads))))
        return [self._waiting.popleft() for _ in range(size)]

    def learn(self, found: Sequence[Done]) -> None:
        """See how long tasks take."""
        self._rows += len(found)
        self._seconds += sum(done.timing.get("task_time", self._time_limit) for done in found)

    def lost(self, batch: list[Task]) -> list[Done]:
        """Tasks whose workers died time and again: one by one, and a row for the one that it was."""
        if len(batch) > 1:
            self._alone.extend(batch)
            return []
        words = "the Dask workers that had it were lost, again and again"
        return [Done(batch[0].index, {"status": "killed", "reason": words}, {})]


def do_batch(setup: Setup, tasks: Sequence[Task], libraries: dict[str, str]) -> list[Done]:
    """Do tasks on a Dask worker.

    Parameters
    ----------
    setup : Setup
    tasks : sequence of Task
    libraries : dict
        Versions that the rows are to be of.

    Raises
    ------
    WorkersBroken
        If other versions are installed here, or no worker process starts.
    """
    here = _versions()
    for name in sorted({*libraries, *here}):
        if libraries.get(name) != here.get(name):
            raise WorkersBroken(f"a Dask worker has {name} {here.get(name)}, this sweep is of {libraries.get(name)}")
    line = setup.line()
    if getattr(_here, "line", None) != line:
        if hasattr(_here, "pool"):
            _here.pool.close()
        _here.pool, _here.line = Pool(setup, 1), line
    return list(_here.pool.run(tasks))


@cache
def _versions() -> dict[str, str]:
    """Versions of the libraries of a Dask worker; to look them up takes as long as some rides do."""
    return library_versions()
