"""What a Dask worker does: it gets the sweep once from the scheduler, and then does batches of its tasks.

A batch is a text with ranges of indices. The sweep is metadata of the scheduler, from which a process gets it when it
first needs it, so workers may join at any time. Each thread keeps one worker process of `pool`.
"""

from __future__ import annotations

import json
import threading
import zlib
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from ..run import library_versions
from .batches import Ranges, list_undone
from .packing import pack_rows
from .plan import TaskSequence
from .pool import Done, Pool, WorkersBroken
from .worker import Setup

_KEPT = 4  # sweeps that a process keeps, those of clients that share a cluster

_thread_state = threading.local()
_lock = threading.Lock()
_sweeps: OrderedDict[str, tuple[Setup, TaskSequence]] = OrderedDict()


@dataclass(frozen=True)
class BatchResult:
    """Result of a batch.

    Attributes
    ----------
    rows : bytes
        Of `packing.pack_rows`.
    count : int
        Number of rows.
    seconds : float
        Time that they took, without the start of the worker process [s].
    undone : list of range
        Tasks of the batch that were not begun in its time.
    """

    rows: bytes
    count: int
    seconds: float
    undone: Ranges


def pack_sweep(setup: Setup, tasks: TaskSequence) -> dict[str, Any]:
    """Return what workers need to make and do tasks by their index; the versions can be read by any version."""
    return {
        "versions": library_versions(),
        "sweep": zlib.compress(json.dumps({"setup": asdict(setup), "tasks": tasks.as_json()}).encode()),
    }


def write_ranges(ranges: Sequence[range]) -> str:
    """Return ranges as text: Dask looks into lists, which takes longer."""
    return " ".join(f"{part.start}-{part.stop}" for part in ranges)


def read_ranges(text: str) -> Ranges:
    """Return the ranges of `write_ranges`."""
    return [range(*map(int, part.split("-"))) for part in text.split()]


def do_batch(batch: str, sweep: str, longest: float) -> BatchResult:
    """Do tasks on a Dask worker.

    Parameters
    ----------
    batch : str
        Indices of the tasks; see `write_ranges`.
    sweep : str
        Key of the sweep in the scheduler's metadata.
    longest : float
        Time after which no more tasks are begun [s].

    Raises
    ------
    WorkersBroken
        If other versions are installed here, or no worker process starts.
    """
    setup, tasks = _find_sweep(sweep)
    ranges = read_ranges(batch)
    chosen = [tasks[index] for part in ranges for index in part]
    pool = _find_pool(setup)
    rows: list[Done] = []
    try:
        rows.extend(pool.run(chosen, longest))
    except BaseException:
        _close_pool()
        raise
    undone = list_undone(ranges, {done.index for done in rows}) if len(rows) < len(chosen) else []
    return BatchResult(pack_rows(rows), len(rows), pool.elapsed(), undone)


def _find_sweep(name: str) -> tuple[Setup, TaskSequence]:
    """Return a sweep from the scheduler's metadata, or from this process if it has it."""
    from distributed import get_worker
    from distributed.utils import sync

    with _lock:
        if name not in _sweeps:
            worker = get_worker()
            found = sync(worker.loop, worker.scheduler.get_metadata, keys=[name], default=None)
            if found is None:
                raise WorkersBroken("the sweep's client has left")
            _refuse_other_versions(found["versions"])
            data = json.loads(zlib.decompress(found["sweep"]))
            _sweeps[name] = Setup(**data["setup"]), TaskSequence.from_json(data["tasks"])
        _sweeps.move_to_end(name)
        while len(_sweeps) > _KEPT:
            _sweeps.popitem(last=False)
        return _sweeps[name]


def _refuse_other_versions(libraries: dict[str, str]) -> None:
    """Raise an error unless the rows would come from these versions."""
    here = library_versions()
    for name in sorted({*libraries, *here}):
        if libraries.get(name) != here.get(name):
            raise WorkersBroken(f"a Dask worker has {name} {here.get(name)}, this sweep is of {libraries.get(name)}")


def _find_pool(setup: Setup) -> Pool:
    """Return this thread's worker process, which stays for the next batch."""
    line = setup.line()
    if getattr(_thread_state, "line", None) != line:
        _close_pool()
        _thread_state.pool, _thread_state.line = Pool(setup, 1), line
    return _thread_state.pool


def _close_pool() -> None:
    pool = getattr(_thread_state, "pool", None)
    _thread_state.pool = _thread_state.line = None
    if pool is not None:
        pool.close()
