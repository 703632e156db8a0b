"""A worker of a sweep: ``python -m velodrome.scenarios.sweep.worker``, which communicates in lines of JSON.

The keeper, the process that is started, loads and compiles everything once and then only keeps a child, a fork of
itself that does the tasks. If the child is killed, only one task is lost, and the next child is ready in
milliseconds.

Standard input: first the sweep (`Setup`), then groups of tasks of one engine; ``again`` after the report of a child's
death asks for the next child. Standard output: ``{"pid": ...}`` when a child is ready, one line per row, and
``{"died": wait status}`` from the keeper. The end of the input ends both processes, even in the middle of a task.
"""

from __future__ import annotations

import gc
import json
import os
import platform
import resource
import select
import signal
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

RETIRED = 75  # exit status of a child that ran out of memory and may be in an inconsistent state
_INPUT_ENDED = 76  # exit status of a child without further tasks; an engine may end it with any other, even 0
_GRACE = 60.0  # seconds beyond its time limit after which a child without a parent ends itself


@dataclass(frozen=True)
class Setup:
    """Settings that all workers of a sweep share.

    Attributes
    ----------
    base : dict
        The base scenario as resolved, JSON values.
    time_limit : float
        Wall-clock time of a task [s].
    memory_limit : float or None
        Address space that a task may use in addition to that of an idle worker [MB].
    """

    base: dict[str, Any]
    time_limit: float
    memory_limit: float | None

    def line(self) -> str:
        """Return the setup as one line of JSON."""
        return json.dumps(asdict(self))


def main() -> None:
    """Keep a child at work until the input ends."""
    tasks, results = os.dup(0), os.dup(1)
    # Engines may print and read: this must not interfere with the protocol.
    with open(os.devnull, "r+b") as nothing:
        for standard in (0, 1, 2):
            os.dup2(nothing.fileno(), standard)
    try:
        setup = Setup(**json.loads(next(_read_lines(tasks, at_a_time=1))))
        # What is loaded lives on, so that there are no cycles to find among it, neither now nor in a child.
        gc.disable()
        _warm_up()
        gc.freeze()
        gc.enable()
    except Exception as error:  # reported to the parent, since there is no other output
        _send(results, {"broken": f"{type(error).__name__}: {error}"})
        sys.exit(1)
    death, bell = os.pipe()
    os.set_blocking(bell, False)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.set_wakeup_fd(bell)
    while True:
        child = os.fork()
        if child == 0:
            signal.set_wakeup_fd(-1)
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            _do_tasks(setup, tasks, results)
        status = _wait_for_child(child, tasks, death)
        if status is None or (os.WIFEXITED(status) and os.WEXITSTATUS(status) == _INPUT_ENDED):
            return
        _send(results, {"died": status})
        # Tasks that the child has left unread are sent again.
        if all(line != "again" for line in _read_lines(tasks, at_a_time=1)):
            return


def _wait_for_child(child: int, tasks: int, death: int) -> int | None:
    """Wait for a child's end; kill it and return None if the input is closed."""
    poll = select.poll()
    poll.register(tasks, 0)  # only for its hang-up: the data in it are for the child
    poll.register(death, select.POLLIN)
    while True:
        events = dict(poll.poll())
        if death in events:
            os.read(death, 4096)
            pid, status = os.waitpid(child, os.WNOHANG)
            if pid == child:
                return status
        if tasks in events:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            return None


def _do_tasks(setup: Setup, tasks: int, results: int) -> None:
    """Do tasks until the input ends; never return."""
    from .task import Tasks

    status = 1
    try:
        work = Tasks(setup.base)
        _send(results, {"pid": os.getpid()})
        _limit_memory(setup.memory_limit)
        who = {"host": platform.node(), "process": os.getpid()}
        for line in _read_lines(tasks):
            group = json.loads(line)
            points = group["points"]
            # The parent kills a hung run; without a parent, the kernel does.
            signal.setitimer(signal.ITIMER_REAL, setup.time_limit * len(points) + _GRACE)
            found = work.do_many(group["engine"], [point["changes"] for point in points])
            signal.setitimer(signal.ITIMER_REAL, 0)
            pairs = zip(points, found, strict=True)
            _send(results, *({"index": p["index"], "row": row, "timing": timing | who} for p, (row, timing) in pairs))
            if any(row["status"] == "memory" for row, _ in found):
                os._exit(RETIRED)  # the remaining memory may be too little for the next tasks
        status = _INPUT_ENDED
    finally:
        os._exit(status)


def _limit_memory(megabytes: float | None) -> None:
    if megabytes is None:
        return
    pages = Path("/proc/self/statm")
    at_rest = int(pages.read_text().split()[0]) * resource.getpagesize() if pages.exists() else 0
    limit = at_rest + int(megabytes * 1e6)
    resource.setrlimit(resource.RLIMIT_AS, (limit, resource.getrlimit(resource.RLIMIT_AS)[1]))


def _warm_up() -> None:
    """Load what every task needs and compile the reference, or load the compiled code."""
    from ..scenario import load_scenario
    from .task import Tasks

    _, scenario = load_scenario("q2", {"simulation.duration": 0.01})
    Tasks(scenario.model_dump(mode="json", exclude_none=True)).do("reference", {})


def _read_lines(source: int, at_a_time: int = 1 << 16) -> Iterator[str]:
    """Yield complete lines from a pipe; with ``at_a_time`` 1, all that follows the last line asked for stays in it."""
    rest = b""
    while data := os.read(source, at_a_time):
        *whole, rest = (rest + data).split(b"\n")
        for line in whole:
            yield line.decode(errors="replace")


def _send(results: int, *messages: dict[str, Any]) -> None:
    # The leading line feed ends a line that a dead child may have left incomplete.
    data = b"\n" + "".join(f"{json.dumps(message)}\n" for message in messages).encode()
    while data:
        data = data[os.write(results, data) :]


if __name__ == "__main__":
    main()
