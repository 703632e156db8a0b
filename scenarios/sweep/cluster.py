"""Workers on a Dask cluster: the same tasks in the same kind of process, hence rows equal to the bit.

Each thread of a Dask worker keeps one worker process of `pool`, so limits, crashes and their rows are the same as
on one machine, and no engine ends a Dask worker. If a Dask worker is lost for another reason, its batches are done
elsewhere. Dask's protocol carries pickles: connect only to a scheduler that you trust.
"""

from __future__ import annotations

import asyncio
import threading
from collections import deque
from collections.abc import Generator, Sequence
from concurrent.futures import CancelledError
from functools import cache
from itertools import islice
from typing import Any

from ..error import ScenarioError
from ..run import library_versions
from ..scenario import show_value
from .plan import Task
from .pool import Done, Pool, WorkersBroken
from .run import Work
from .worker import Setup

_FIRST, _LARGEST, _SPAN = 4, 250, 1.0  # tasks in the first batches and at most; seconds that a batch should take
_IN_FLIGHT = 3  # batches per thread: one being done, the next ones waiting
_PATIENCE = 30  # seconds to wait for a scheduler to answer and for a first worker to connect

_thread_state = threading.local()


def on_cluster(address: str) -> Work:
    """Return work on the cluster of a Dask scheduler, e.g. ``tcp://127.0.0.1:8786``.

    Raises
    ------
    ScenarioError
        If Dask is not installed, or there is no scheduler.
    """
    try:
        from distributed import Client

        # A client that could not connect prints a traceback when it is collected, so none is made before this answers.
        answer = asyncio.run(_ask_identity(address))
    except ImportError as error:
        raise ScenarioError("--scheduler needs Dask: pip install 'velodrome[cluster]'") from error
    except (OSError, ValueError, TypeError) as error:  # a TypeError where there are no certificates for TLS
        raise ScenarioError(_describe_silence(address)) from error
    if answer.get("type") != "Scheduler":
        raise ScenarioError(_describe_silence(address))
    try:
        client = Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ScenarioError(_describe_silence(address)) from error

    def work(setup: Setup, tasks: Sequence[Task]) -> Generator[Done]:
        try:
            if tasks:
                yield from _run_batches(client, setup, tasks)
        except (CancelledError, OSError) as error:
            raise WorkersBroken(f"the scheduler at {address} is lost") from error
        finally:
            client.close()

    return work


async def _ask_identity(address: str) -> Any:
    """Ask a Dask server what it is; raise an error if none answers."""
    from distributed import rpc
    from distributed.security import Security

    async with rpc(address, connection_args=Security().get_connection_args("client")) as server:
        return await asyncio.wait_for(server.identity(), _PATIENCE)


def _describe_silence(address: str) -> str:
    return (
        f"--scheduler {show_value(address)}: no Dask scheduler answers there; "
        "give the address that it printed when it started, e.g. tcp://127.0.0.1:8786"
    )


def _run_batches(client: Any, setup: Setup, tasks: Sequence[Task]) -> Generator[Done]:
    from distributed import KilledWorker, as_completed

    try:
        client.wait_for_workers(1, timeout=_PATIENCE)
    except TimeoutError as error:
        raise WorkersBroken(f"no worker connected to the scheduler within {_PATIENCE} s") from error
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
            raise WorkersBroken(f"a Dask worker, or the connection to it, failed: {error}") from error
        except KilledWorker:
            found = batches.lost(batch)
        else:
            batches.learn(found)
        future.release()
        submit()
        yield from found


class _Batches:
    """Tasks in batches that take about a second each: a batch costs the scheduler about ten milliseconds.

    Parameters
    ----------
    tasks : sequence of Task
    time_limit : float
        Time that an unfinished task counts for [s].
    """

    def __init__(self, tasks: Sequence[Task], time_limit: float) -> None:
        self._waiting, self._left = iter(tasks), len(tasks)
        self._singles: deque[Task] = deque()
        self._time_limit = time_limit
        self._rows, self._seconds = 0, 0.0

    def next(self, threads: int) -> list[Task]:
        """Return the next batch of neighbouring tasks, which share a start; empty when all are out."""
        if self._singles:
            return [self._singles.popleft()]
        size = _FIRST if not self._rows else int(min(_LARGEST, _SPAN * self._rows / max(self._seconds, 1e-6)))
        # The last batches are smaller, so that no worker waits long for another one.
        size = min(self._left, max(1, min(size, self._left // (2 * threads))))
        self._left -= size
        return list(islice(self._waiting, size))

    def learn(self, found: Sequence[Done]) -> None:
        """Update the estimate of how long tasks take."""
        self._rows += len(found)
        self._seconds += sum(done.timing.get("task_time", self._time_limit) for done in found)

    def lost(self, batch: list[Task]) -> list[Done]:
        """Queue the tasks of a batch whose workers died repeatedly one by one; give up a batch of one task."""
        if len(batch) > 1:
            self._singles.extend(batch)
            return []
        reason = "the Dask workers that ran it were lost again and again"
        return [Done(batch[0].index, {"status": "killed", "reason": reason}, {})]


def do_batch(setup: Setup, tasks: Sequence[Task], libraries: dict[str, str]) -> list[Done]:
    """Do tasks on a Dask worker.

    Parameters
    ----------
    setup : Setup
    tasks : sequence of Task
    libraries : dict
        Versions that the rows must come from.

    Raises
    ------
    WorkersBroken
        If other versions are installed here, or no worker process starts.
    """
    here = _cached_versions()
    for name in sorted({*libraries, *here}):
        if libraries.get(name) != here.get(name):
            raise WorkersBroken(f"a Dask worker has {name} {here.get(name)}, this sweep is of {libraries.get(name)}")
    line = setup.line()
    if getattr(_thread_state, "line", None) != line:
        if hasattr(_thread_state, "pool"):
            _thread_state.pool.close()
        _thread_state.pool, _thread_state.line = Pool(setup, 1), line
    return list(_thread_state.pool.run(tasks))


@cache
def _cached_versions() -> dict[str, str]:
    """Return the versions of a Dask worker's libraries; looking them up takes as long as some rides."""
    return library_versions()
