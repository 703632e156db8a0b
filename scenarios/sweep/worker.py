"""A worker of a sweep: ``python -m velodrome.scenarios.sweep.worker``, spoken to in lines of JSON.

The process that is started loads and compiles everything once and then only keeps a child, a fork of itself
that does the tasks. Whatever kills the child costs one task: the next child is there in milliseconds.

In, on standard input: first the sweep (`Setup`), then tasks; ``again`` after the news of a child's death asks
for the next child. Out, on standard output: ``{"pid": ...}`` when a child is ready, a line per row, and
``{"died": wait status}`` from the keeper. The end of the input ends both, in the middle of a task too.
"""

from __future__ import annotations

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

RETIRED = 75  # exit status of a child that has run out of memory once and may be in pieces
_INPUT_ENDED = 76  # of a child that has nothing more to do; an engine may end it with any other, 0 included
_GRACE = 60.0  # seconds beyond its time limit after which a child that nobody watches ends itself


@dataclass(frozen=True)
class Setup:
    """What every worker of a sweep must know.

    Attributes
    ----------
    base : dict
        The base scenario as resolved, JSON values.
    time_limit : float
        Of a task [s].
    memory_limit : float or None
        Address space that a task may take beyond what a worker has at rest [MB].
    """

    base: dict[str, Any]
    time_limit: float
    memory_limit: float | None

    def line(self) -> str:
        """As one line of JSON."""
        return json.dumps(asdict(self))


def main() -> None:
    """Keep a child at work until the input ends."""
    tasks, results = os.dup(0), os.dup(1)
    # Engines print, and read, what they like: not into the protocol.
    with open(os.devnull, "r+b") as nothing:
        for standard in (0, 1, 2):
            os.dup2(nothing.fileno(), standard)
    try:
        setup = Setup(**json.loads(next(_lines(tasks, at_a_time=1))))
        _warm()
    except Exception as error:  # said to whoever started it: there is nowhere else
        _say(results, {"broken": f"{type(error).__name__}: {error}"})
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
            _serve(setup, tasks, results)
        status = _watch(child, tasks, death)
        if status is None or (os.WIFEXITED(status) and os.WEXITSTATUS(status) == _INPUT_ENDED):
            return
        _say(results, {"died": status})
        # What the child left unread is sent again.
        if all(line != "again" for line in _lines(tasks, at_a_time=1)):
            return


def _watch(child: int, tasks: int, death: int) -> int | None:
    """Wait for a child's end; kill it and return None when the other end of the input has gone."""
    poll = select.poll()
    poll.register(tasks, 0)  # only its hang-up counts: what is in it is the child's
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


def _serve(setup: Setup, tasks: int, results: int) -> None:
    """Do tasks until the input ends; never returns."""
    from .task import Tasks

    status = 1
    try:
        work = Tasks(setup.base)
        _say(results, {"pid": os.getpid()})
        _limit_memory(setup.memory_limit)
        who = {"host": platform.node(), "process": os.getpid()}
        for line in _lines(tasks):
            task = json.loads(line)
            # A hung run is killed from outside; where nobody is left to do so, the kernel does.
            signal.setitimer(signal.ITIMER_REAL, setup.time_limit + _GRACE)
            row, timing = work.do(task["engine"], task["changes"])
            signal.setitimer(signal.ITIMER_REAL, 0)
            _say(results, {"index": task["index"], "row": row, "timing": timing | who})
            if row["status"] == "memory":
                os._exit(RETIRED)  # what it has left may be too little for the next task
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


def _warm() -> None:
    """Load what every task needs and compile the reference, or load what is compiled."""
    from ..scenario import load_scenario
    from .task import Tasks

    _, scenario = load_scenario("q2", {"simulation.duration": 0.01})
    Tasks(scenario.model_dump(mode="json", exclude_none=True)).do("reference", {})


def _lines(source: int, at_a_time: int = 1 << 16) -> Iterator[str]:
    """Whole lines from a pipe; ``at_a_time`` of 1 leaves in it all that follows the last one asked for."""
    rest = b""
    while data := os.read(source, at_a_time):
        *whole, rest = (rest + data).split(b"\n")
        for line in whole:
            yield line.decode(errors="replace")


def _say(results: int, message: dict[str, Any]) -> None:
    # The line feed in front ends what a dead child may have left unfinished.
    data = b"\n" + json.dumps(message).encode() + b"\n"
    while data:
        data = data[os.write(results, data) :]


if __name__ == "__main__":
    main()
