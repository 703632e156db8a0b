"""Workers on a Dask cluster: the same tasks in the same kind of process, hence rows equal to the bit.

Each thread of a Dask worker keeps one worker process of `pool`, so limits, crashes and their rows are the same as
on one machine, and no engine ends a Dask worker. If a Dask worker is lost for another reason, its batches are done
elsewhere. The sweep is sent once, to the scheduler; a batch is ranges of indices, and its rows come back as one block
of bytes. What the client and the scheduler hold grows with the workers, not with the runs. Dask's protocol carries
pickles: connect only to a scheduler that you trust.
"""

from __future__ import annotations

import asyncio
import math
import time
import uuid
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import CancelledError
from importlib.metadata import PackageNotFoundError, version
from itertools import count
from typing import Any

from ..error import ScenarioError
from ..scenario import show_value
from .batches import Batches, Ranges, longest_batch
from .cluster_worker import BatchResult, do_batch, pack_sweep, write_ranges
from .packing import unpack_rows
from .plan import Task
from .pool import Done, WorkersBroken
from .run import Work
from .selection import SelectedTasks
from .worker import Setup

_PACKAGE = "velodrome"
_IN_FLIGHT = 3  # batches per thread: one being done, one at its worker, one at the scheduler
# [s] between messages to the scheduler: batches that are sent and received together cost a third of single ones. Less
# than two of the shortest batches, which wait meanwhile.
_PAUSE = 0.1
_GATHERED = 32  # batches whose rows the client holds at most: 10 MB, or 30 MB if all have as many as they may
_LOOK = 1.0  # [s] between questions to the scheduler how many threads there are
_PATIENCE = 30  # seconds to wait for a scheduler to answer and for a first worker to connect


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
            if not isinstance(tasks, SelectedTasks):
                raise TypeError("a cluster does tasks of a sweep that are chosen by their indices")
            if tasks:
                yield from _Sending(client, setup, tasks).run()
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


class _Sending:
    """Send the batches of a sweep and receive their rows.

    Parameters
    ----------
    client : distributed.Client
    setup : Setup
    tasks : SelectedTasks
    """

    def __init__(self, client: Any, setup: Setup, tasks: SelectedTasks) -> None:
        from distributed import as_completed

        self._client, self._setup, self._tasks = client, setup, tasks
        self._batches = Batches(tasks)
        self._at_work: dict[Any, Ranges] = {}
        self._arriving = as_completed(loop=client.loop)
        self._names = (f"batch-{uuid.uuid4().hex}", count())
        self._known: set[str] = set()
        self._threads, self._looked, self._submitted = 1, -math.inf, -math.inf

    def run(self) -> Generator[Done]:
        """Do the tasks and yield the result of each once.

        Raises
        ------
        WorkersBroken
            If no worker is there, or one cannot do any tasks.
        """
        try:
            self._client.wait_for_workers(1, timeout=_PATIENCE)
        except TimeoutError as error:
            raise WorkersBroken(f"no worker connected to the scheduler within {_PATIENCE} s") from error
        sweep = f"sweep-{uuid.uuid4().hex}"
        # The scheduler keeps metadata as long as a task of the same name, hence until this client leaves or is lost.
        held = self._client.submit(str, sweep, key=sweep)
        self._client.set_metadata(sweep, pack_sweep(self._setup, self._tasks.sweep))
        self._submit(sweep)
        while self._at_work:
            ready = self._await_some()
            for first in range(0, len(ready), _GATHERED):
                # A list: new batches are sent before the rows of these are read.
                found = list(self._receive(ready[first : first + _GATHERED]))
                self._submit(sweep)
                for rows in found:
                    yield from rows
        held.release()

    def _await_some(self) -> list[Any]:
        """Return the futures of batches that have ended, at least one."""
        ready = self._arriving.next_batch()
        pause = self._submitted + _PAUSE - time.monotonic()
        if pause > 0:
            time.sleep(pause)
            ready += self._arriving.next_batch(block=False)
        return ready

    def _submit(self, sweep: str) -> None:
        """Send as many batches as the workers need to be busy until the next ones."""
        if time.monotonic() - self._looked > _LOOK:
            self._look_at_workers()
        batches: list[Ranges] = []
        while len(self._at_work) + len(batches) < _IN_FLIGHT * self._threads:
            batch = self._batches.next(self._threads, idle=not (self._at_work or batches))
            if not batch:
                break
            batches.append(batch)
        if not batches:
            return
        # Keys with a common first part are a group of Dask's: of a large one, the scheduler gives each worker what it
        # can begin, and keeps the rest.
        name, numbers = self._names
        futures = self._client.map(
            do_batch,
            [write_ranges(batch) for batch in batches],
            sweep=sweep,
            longest=longest_batch(self._threads),
            key=[(name, next(numbers)) for _ in batches],
            pure=False,
        )
        self._submitted = time.monotonic()
        self._at_work.update(zip(futures, batches, strict=True))
        self._arriving.update(futures)

    def _look_at_workers(self) -> None:
        """Count the threads of all workers, and refuse new workers with another velodrome.

        A worker without the module of a batch's function cannot even read the message that it is in: it loses its
        connection, as if the batch had ended it.
        """
        threads = self._client.nthreads()
        fresh = [address for address in threads if address not in self._known]
        if fresh:
            own = version(_PACKAGE)
            for found in self._client.run(version, _PACKAGE, workers=fresh, on_error="return").values():
                if isinstance(found, PackageNotFoundError):
                    raise WorkersBroken(f"a Dask worker has no {_PACKAGE}, this sweep is of {own}")
                # Another error: the worker is lost again.
                if isinstance(found, str) and found != own:
                    raise WorkersBroken(f"a Dask worker has {_PACKAGE} {found}, this sweep is of {own}")
        self._known = set(threads)
        self._threads = max(1, sum(threads.values()))
        self._looked = time.monotonic()

    def _receive(self, futures: Sequence[Any]) -> Iterator[Iterator[Done]]:
        """Yield the rows of batches that have ended."""
        for future, result in zip(futures, self._gather(futures), strict=True):
            batch = self._at_work.pop(future)
            future.release()
            if result is not None:
                self._batches.learn(result.count, result.seconds, self._threads)
                self._batches.return_undone(result.undone)
                yield unpack_rows(result.rows)
            elif (given_up := self._batches.lose(batch)) is not None:
                reason = "the Dask workers that ran it were lost again and again"
                yield iter([Done(given_up, {"status": "killed", "reason": reason}, {})])

    def _gather(self, futures: Sequence[Any]) -> list[BatchResult | None]:
        """Return results of batches that have ended; None for those whose workers were lost again and again."""
        from distributed import KilledWorker

        try:
            if all(future.status == "finished" for future in futures):
                return self._client.gather(list(futures))  # in one message
        except KilledWorker:  # lost with its worker after it was finished, and again later
            pass
        results: list[BatchResult | None] = []
        for future in futures:
            try:
                results.append(future.result())
            except KilledWorker:
                results.append(None)
            except WorkersBroken:
                raise
            except (ImportError, OSError, RuntimeError) as error:  # RuntimeError: the scheduler cannot read a batch
                raise WorkersBroken(f"a Dask worker, the scheduler or a connection failed: {error}") from error
        return results
