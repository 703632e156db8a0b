"""Workers on this machine: tasks out, rows in, whatever becomes of a worker."""

from __future__ import annotations

import json
import os
import selectors
import signal
import subprocess
import sys
import time
from collections import Counter, deque
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .plan import Task
from .worker import RETIRED, Setup

ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"), "1"
)
ATTEMPTS = 3  # a worker may be killed for no fault of its task's; a third time the task is taken to be why
_AHEAD = 2  # tasks that a worker has: the next is there before the last one's row is read
_CHUNK = 16  # neighbours share a start, so they go to one worker, up to so many
_STARTING = 600.0  # s for a worker to load and compile everything; half a minute on an idle machine
_PATIENCE = 30.0  # s for a keeper to say that its child is dead, or to make another: a fork, milliseconds of work
_LOOK = 0.2  # s between looks at the clock and at workers that are silent


@dataclass(frozen=True)
class Done:
    """A finished task.

    Attributes
    ----------
    index : int
    row : dict
    timing : dict
    """

    index: int
    row: dict[str, Any]
    timing: dict[str, Any]


class WorkersBroken(RuntimeError):
    """No worker can be started."""


@dataclass(eq=False)
class _Worker:
    """One worker process and what it has to do.

    Its keeper owes a word while it starts, when it is asked for the next child, and when its child is dead; one that
    is silent until ``overdue``, because somebody has stopped it or it is stuck, is replaced.
    """

    process: subprocess.Popen[bytes]
    overdue: float | None
    child: int | None = None
    rest: bytes = b""
    sent: deque[Task] = field(default_factory=deque)
    mine: deque[Task] = field(default_factory=deque)
    due: float = 0.0
    hung: int | None = None  # index of the task that it was killed for

    def say(self, line: str) -> None:
        """Send a line; a worker that has gone is noticed elsewhere."""
        assert self.process.stdin is not None
        with suppress(BrokenPipeError):
            self.process.stdin.write(line.encode() + b"\n")
            self.process.stdin.flush()


class Pool:
    """Worker processes for one sweep; a context that ends them.

    Parameters
    ----------
    setup : Setup
    workers : int
    """

    def __init__(self, setup: Setup, workers: int) -> None:
        self._setup = setup
        self._selector = selectors.DefaultSelector()
        self._deaths: Counter[int] = Counter()
        self._failed_starts = 0
        self._queue: deque[Task] = deque()
        self._workers = [self._started() for _ in range(workers)]

    def __enter__(self) -> Pool:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End all workers, in the middle of a task too."""
        for worker in self._workers:
            self._end(worker)
        self._workers = []
        self._selector.close()

    def run(self, tasks: Iterable[Task]) -> Iterator[Done]:
        """Do tasks, in any order; each comes back once.

        Raises
        ------
        WorkersBroken
            If workers do not even start.
        """
        self._queue.extend(tasks)
        self._deaths.clear()
        left = len(self._queue)
        for worker in self._workers:
            self._feed(worker)
        while left:
            for done in self._heard():
                left -= 1
                yield done
            for done in self._overdue():
                left -= 1
                yield done

    def _heard(self) -> Iterator[Done]:
        for chosen, _ in self._selector.select(_LOOK):
            worker: _Worker = chosen.data
            data = os.read(chosen.fd, 1 << 16)
            if not data:
                yield from self._replaced(worker)
                continue
            *lines, worker.rest = (worker.rest + data).split(b"\n")
            for line in filter(None, lines):
                try:
                    message = json.loads(line)
                except ValueError:
                    continue  # what a child wrote as it was killed
                yield from self._answered(worker, message)

    def _answered(self, worker: _Worker, message: dict[str, Any]) -> Iterator[Done]:
        if "row" in message:
            if worker.sent and worker.sent[0].index == message["index"]:
                worker.sent.popleft()
                worker.due = time.monotonic() + self._setup.time_limit
                self._failed_starts = 0
                yield Done(message["index"], message["row"], message["timing"])
            self._feed(worker)
        elif "pid" in message:
            worker.child, worker.overdue = message["pid"], None
            self._feed(worker)
        elif "died" in message:
            yield from self._buried(worker, message["died"])
            worker.overdue = time.monotonic() + _PATIENCE
            worker.say("\nagain")
        elif "broken" in message:
            raise WorkersBroken(f"no worker starts: {message['broken']}")

    def _feed(self, worker: _Worker) -> None:
        """Let a worker have its next tasks."""
        if worker.child is None:
            return
        while len(worker.sent) < _AHEAD and (worker.mine or self._share(worker)):
            task = worker.mine.popleft()
            if not worker.sent:
                worker.due = time.monotonic() + self._setup.time_limit
            worker.sent.append(task)
            worker.say(json.dumps({"index": task.index, "engine": task.engine, "changes": task.changes}))

    def _share(self, worker: _Worker) -> bool:
        """Give a worker a chunk of the queue, or where that is empty half of what another has."""
        if self._queue:
            size = max(1, min(_CHUNK, len(self._queue) // (4 * len(self._workers))))
            worker.mine.extend(self._queue.popleft() for _ in range(size))
            return True
        richest = max(self._workers, key=lambda other: len(other.mine))
        for _ in range((len(richest.mine) + 1) // 2):
            worker.mine.appendleft(richest.mine.pop())
        return bool(worker.mine)

    def _buried(self, worker: _Worker, status: int) -> Iterator[Done]:
        """What comes of a child's death: a row for the task at fault, the others again."""
        worker.child = None
        head = worker.sent[0] if worker.sent else None
        self._failed_starts += head is None
        if self._failed_starts > ATTEMPTS + 2 * len(self._workers):
            raise WorkersBroken("no worker starts: each ends before its first task")
        retired = os.WIFEXITED(status) and os.WEXITSTATUS(status) == RETIRED
        given_up: Done | None = None
        if head is not None and worker.hung == head.index:
            given_up = _lost(head, "timeout", f"no result within {self._setup.time_limit!r} s")
        elif head is not None and worker.hung is None and not retired:
            self._deaths[head.index] += 1
            if self._deaths[head.index] >= ATTEMPTS:
                given_up = _lost(head, "killed", f"its process ended {ATTEMPTS} times, last by {_cause(status)}")
        worker.hung = None
        if given_up is not None:
            worker.sent.popleft()
        while worker.sent:
            worker.mine.appendleft(worker.sent.pop())
        if given_up is not None:
            yield given_up

    def _overdue(self) -> Iterator[Done]:
        """Kill children that hang, replace workers that have gone without a word or keep silent."""
        now = time.monotonic()
        for worker in list(self._workers):
            if worker.overdue is None and worker.child is not None and _is_dead(worker.child):
                worker.overdue = now + _PATIENCE
            if worker.process.poll() is not None or (worker.overdue is not None and now > worker.overdue):
                yield from self._replaced(worker)
            elif worker.sent and worker.child is not None and worker.hung is None and now > worker.due:
                worker.hung = worker.sent[0].index
                _kill(worker.child)
            elif not worker.sent:
                self._feed(worker)

    def _replaced(self, worker: _Worker) -> Iterator[Done]:
        """Put a new worker in the place of one that has gone."""
        if worker not in self._workers:
            return
        self._end(worker)
        yield from self._buried(worker, signal.SIGKILL)
        fresh = self._started()
        fresh.mine = worker.mine
        self._workers[self._workers.index(worker)] = fresh

    def _started(self) -> _Worker:
        process = subprocess.Popen(
            [
                sys.executable,
                "-P",
                "-m",
                "velodrome.scenarios.sweep.worker",
            ],  # -P: no module of the folder it is run in
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=os.environ | ONE_THREAD,
            # Ctrl-C is the parent's to answer.
            start_new_session=True,
        )
        worker = _Worker(process, time.monotonic() + _STARTING)
        worker.say(self._setup.line())
        assert process.stdout is not None
        self._selector.register(process.stdout, selectors.EVENT_READ, worker)
        return worker

    def _end(self, worker: _Worker) -> None:
        """End a worker with its child: by the end of its input, or by force if it does not listen."""
        process = worker.process
        assert process.stdin is not None
        assert process.stdout is not None
        with suppress(KeyError, ValueError):
            self._selector.unregister(process.stdout)
        with suppress(BrokenPipeError):
            process.stdin.close()
        try:
            process.wait(_LOOK)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        if worker.child is not None and process.returncode != 0:
            _kill(worker.child)  # a keeper that ends by itself takes its child along
        process.stdout.close()


def _lost(task: Task, status: str, reason: str) -> Done:
    return Done(task.index, {"status": status, "reason": reason}, {})


def _cause(status: int) -> str:
    if os.WIFSIGNALED(status):
        return signal.Signals(os.WTERMSIG(status)).name
    return f"exit status {os.WEXITSTATUS(status)}"


def _is_dead(pid: int) -> bool:
    """Whether a process is dead and its parent has not taken notice; False where the system does not tell."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state == "Z"


def _kill(pid: int) -> None:
    with suppress(ProcessLookupError):
        os.kill(pid, signal.SIGKILL)
