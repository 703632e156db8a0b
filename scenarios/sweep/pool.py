"""Workers on this machine: they receive tasks and return rows, and are replaced when they die."""

from __future__ import annotations

import json
import math
import os
import selectors
import signal
import subprocess
import sys
import time
from collections import Counter, deque
from collections.abc import Collection, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any

from ...engines.engine import REFERENCE
from .plan import Task
from .worker import RETIRED, Setup

ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"), "1"
)
ATTEMPTS = 3  # a worker may be killed for other reasons; the third time its task is taken to be the cause
_AHEAD = 2  # groups sent to a worker, so that the next one is there before the last one's rows are read
GROUP = 64  # largest number of the reference's tasks in a group, which ride in one call of compiled code
_CHUNK = 64  # largest number of neighbouring tasks, which share a start, that go to one worker
_LONGEST_QUEUE = 10_000  # with fewer tasks waiting, as many more are made
_STARTING = 600.0  # [s] for a worker to load and compile everything; half a minute on an idle machine
_PATIENCE = 30.0  # [s] for a keeper to report that its child is dead, or to fork another, which takes milliseconds
_LOOK = 0.2  # [s] between checks of the time limits and of silent workers


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
    """One worker process and its tasks, which are sent in groups of one engine.

    The keeper must report when it has started, when it has forked the next child, and when its child is dead. A keeper
    that is silent until ``overdue``, because it was stopped or hangs, is replaced.
    """

    process: subprocess.Popen[bytes]
    overdue: float | None
    child: int | None = None
    rest: bytes = b""
    sent: deque[deque[Task]] = field(default_factory=deque)
    mine: deque[Task] = field(default_factory=deque)
    due: float = 0.0
    hung: int | None = None  # index of the task, the first of its group, that it was killed for

    def say(self, line: str) -> None:
        """Send a line; a lost worker is noticed elsewhere."""
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
        self._alone: set[int] = set()  # tasks of groups that ended their process: one of them may do so again
        self._failed_starts = 0
        self._queue: deque[Task] = deque()
        self._source: Iterator[Task] = iter(())  # of tasks that are not yet in the queue
        self._left = 0  # tasks without a result
        self._longest = math.inf
        self._begun: float | None = None  # when the first task was sent
        self._looked = -math.inf  # when the workers were last looked at
        self._workers = [self._start_worker() for _ in range(workers)]

    def __enter__(self) -> Pool:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End all workers, even in the middle of a task."""
        for worker in self._workers:
            self._end_worker(worker)
        self._workers = []
        self._selector.close()

    def run(self, tasks: Collection[Task], longest: float = math.inf) -> Iterator[Done]:
        """Do tasks in any order and yield the result of each once.

        Parameters
        ----------
        tasks : collection of Task
        longest : float
            Time from the first task after which no more are begun [s]. Those that remain have no result; at least one
            task has.

        Raises
        ------
        WorkersBroken
            If workers cannot even start.
        """
        self._source = iter(tasks)
        self._deaths.clear()
        self._alone.clear()
        self._left, self._longest, self._begun = len(tasks), longest, None
        for worker in self._workers:
            self._feed(worker)
        while self._left:
            for done in self._receive():
                self._left -= 1
                yield done
            for done in self._check_deadlines():
                self._left -= 1
                yield done
            if self.elapsed() > self._longest:
                self._drop_waiting()

    def elapsed(self) -> float:
        """Return the time since the first task of the last `run` was sent [s]; 0 if none was."""
        return 0.0 if self._begun is None else time.monotonic() - self._begun

    def _drop_waiting(self) -> None:
        """Drop tasks that are not begun, but for those that may have ended a process: that is found out here."""
        self._source = iter(())
        self._queue.clear()
        suspects = self._alone.union(self._deaths)
        for worker in self._workers:
            worker.mine = deque(task for task in worker.mine if task.index in suspects)
        self._left = sum(len(worker.mine) + sum(map(len, worker.sent)) for worker in self._workers)

    def _receive(self) -> Iterator[Done]:
        for chosen, _ in self._selector.select(_LOOK):
            worker: _Worker = chosen.data
            data = os.read(chosen.fd, 1 << 16)
            if not data:
                yield from self._replace_worker(worker)
                continue
            *lines, worker.rest = (worker.rest + data).split(b"\n")
            for line in filter(None, lines):
                try:
                    message = json.loads(line)
                except ValueError:
                    continue  # a child was killed while it wrote this
                yield from self._handle_message(worker, message)

    def _handle_message(self, worker: _Worker, message: dict[str, Any]) -> Iterator[Done]:
        if "row" in message:
            if worker.sent and worker.sent[0][0].index == message["index"]:
                worker.sent[0].popleft()
                if not worker.sent[0]:
                    worker.sent.popleft()
                    self._set_deadline(worker)
                self._failed_starts = 0
                yield Done(message["index"], message["row"], message["timing"])
            self._feed(worker)
        elif "pid" in message:
            worker.child, worker.overdue = message["pid"], None
            self._feed(worker)
        elif "died" in message:
            yield from self._handle_death(worker, message["died"])
            worker.overdue = time.monotonic() + _PATIENCE
            worker.say("\nagain")
        elif "broken" in message:
            raise WorkersBroken(f"no worker starts: {message['broken']}")

    def _feed(self, worker: _Worker) -> None:
        """Send a worker its next tasks."""
        if worker.child is None:
            return
        while len(worker.sent) < _AHEAD and (worker.mine or self._give_share(worker)):
            group = self._take_group(worker.mine)
            worker.sent.append(group)
            self._begun = time.monotonic() if self._begun is None else self._begun
            if len(worker.sent) == 1:
                self._set_deadline(worker)
            points = [{"index": task.index, "changes": task.changes} for task in group]
            worker.say(json.dumps({"engine": group[0].engine, "points": points}))

    def _take_group(self, tasks: deque[Task]) -> deque[Task]:
        """Take the next task, and those after it that ride with it in one call."""
        group = deque([tasks.popleft()])
        while tasks and len(group) < GROUP and all(self._may_share(task) for task in (group[0], tasks[0])):
            group.append(tasks.popleft())
        return group

    def _may_share(self, task: Task) -> bool:
        return task.engine == REFERENCE and task.index not in self._alone

    def _set_deadline(self, worker: _Worker) -> None:
        """Give a worker the time of its next group, which has to do with all of its tasks."""
        if worker.sent:
            worker.due = time.monotonic() + self._setup.time_limit * len(worker.sent[0])

    def _give_share(self, worker: _Worker) -> bool:
        """Give a worker a chunk of the queue, or half of another worker's tasks where the queue is empty."""
        if len(self._queue) < _LONGEST_QUEUE:
            self._queue.extend(islice(self._source, _LONGEST_QUEUE))
        if self._queue:
            # One worker alone need not leave anything to others, so that its groups are full.
            others = len(self._workers) > 1
            share = len(self._queue) // (4 * len(self._workers)) if others else len(self._queue)
            size = max(1, min(_CHUNK, share))
            worker.mine.extend(self._queue.popleft() for _ in range(size))
            return True
        richest = max(self._workers, key=lambda other: len(other.mine))
        for _ in range((len(richest.mine) + 1) // 2):
            worker.mine.appendleft(richest.mine.pop())
        return bool(worker.mine)

    def _handle_death(self, worker: _Worker, status: int) -> Iterator[Done]:
        """Handle a child's death: yield a row for the task at fault, queue the others again."""
        worker.child = None
        head = worker.sent[0] if worker.sent else None
        self._failed_starts += head is None
        if self._failed_starts > ATTEMPTS + 2 * len(self._workers):
            raise WorkersBroken("no worker starts: each ends before its first task")
        retired = os.WIFEXITED(status) and os.WEXITSTATUS(status) == RETIRED
        given_up: Done | None = None
        if head is not None and len(head) > 1 and not retired:
            self._alone.update(task.index for task in head)
        elif head is not None and not retired:
            given_up = self._blame_task(head[0], worker.hung == head[0].index, status)
            if given_up is not None:
                head.popleft()
        worker.hung = None
        while worker.sent:
            worker.mine.extendleft(reversed(worker.sent.pop()))
        if given_up is not None:
            yield given_up

    def _blame_task(self, task: Task, hung: bool, status: int) -> Done | None:
        """Return the row of a task that ended its process; None if it may have been another cause."""
        if hung:
            return _failed_task(task, "timeout", f"no result within {self._setup.time_limit!r} s")
        self._deaths[task.index] += 1
        if self._deaths[task.index] < ATTEMPTS:
            return None
        return _failed_task(task, "killed", f"its process ended {ATTEMPTS} times, last by {_describe_status(status)}")

    def _check_deadlines(self) -> Iterator[Done]:
        """Kill children that hang; replace workers that died unnoticed or are silent."""
        now = time.monotonic()
        if now < self._looked + _LOOK:
            return
        self._looked = now
        for worker in list(self._workers):
            if worker.overdue is None and worker.child is not None and _is_dead(worker.child):
                worker.overdue = now + _PATIENCE
            if worker.process.poll() is not None or (worker.overdue is not None and now > worker.overdue):
                yield from self._replace_worker(worker)
            elif worker.sent and worker.child is not None and worker.hung is None and now > worker.due:
                worker.hung = worker.sent[0][0].index
                _kill(worker.child)
            elif not worker.sent:
                self._feed(worker)

    def _replace_worker(self, worker: _Worker) -> Iterator[Done]:
        """Replace a lost worker by a new one."""
        if worker not in self._workers:
            return
        self._end_worker(worker)
        yield from self._handle_death(worker, signal.SIGKILL)
        fresh = self._start_worker()
        fresh.mine = worker.mine
        self._workers[self._workers.index(worker)] = fresh

    def _start_worker(self) -> _Worker:
        process = subprocess.Popen(
            # -P: no modules from the working directory
            [sys.executable, "-P", "-m", "velodrome.scenarios.sweep.worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=os.environ | ONE_THREAD,
            # Ctrl-C is handled by the parent.
            start_new_session=True,
        )
        worker = _Worker(process, time.monotonic() + _STARTING)
        worker.say(self._setup.line())
        assert process.stdout is not None
        self._selector.register(process.stdout, selectors.EVENT_READ, worker)
        return worker

    def _end_worker(self, worker: _Worker) -> None:
        """End a worker with its child: by closing its input, or by force if it does not react."""
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
            _kill(worker.child)  # a keeper that ends by itself ends its child as well
        process.stdout.close()


def _failed_task(task: Task, status: str, reason: str) -> Done:
    return Done(task.index, {"status": status, "reason": reason}, {})


def _describe_status(status: int) -> str:
    if os.WIFSIGNALED(status):
        return signal.Signals(os.WTERMSIG(status)).name
    return f"exit status {os.WEXITSTATUS(status)}"


def _is_dead(pid: int) -> bool:
    """Return whether a process is dead and not yet reaped by its parent; False where the system does not say."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state == "Z"


def _kill(pid: int) -> None:
    with suppress(ProcessLookupError):
        os.kill(pid, signal.SIGKILL)
