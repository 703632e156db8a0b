"""The ride processes of one release, as their parent sees them."""

from __future__ import annotations

import json
import os
import selectors
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .children import Children
from .environments import ReleaseEnvironment
from .releases import Release
from .ride import FAILED, RideSetup

_ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"), "1"
)


@dataclass(frozen=True)
class RideFile:
    """The file of the rides of a session, and its SHA-256."""

    path: Path
    digest: str


def ride_tasks(
    release: Release,
    environment: ReleaseEnvironment,
    tasks: Sequence[tuple[str, str]],
    rides: RideFile,
    time_limit: float,
    children: Children,
) -> Iterator[dict[str, Any]]:
    """Ride a release's tasks, one after the other, and yield the row of each.

    The process is replaced after a ride that failed, whose traces in it could change the next one.

    Parameters
    ----------
    release : Release
    environment : ReleaseEnvironment
    tasks : sequence of (scenario, engine)
    rides : RideFile
    time_limit : float
        Wall-clock time after which a ride counts as hung [s].
    children : Children
    """
    setup = RideSetup(
        os.getpid(), str(environment.folder), release.package, release.version, str(rides.path), rides.digest
    )
    left = list(tasks)
    while left:
        process = _start_process(setup, children)
        try:
            for scenario, engine in list(left):
                row = _ask_for_row(process, {"scenario": scenario, "engine": engine}, time_limit, children)
                left.pop(0)
                yield row
                if row["status"] == FAILED:
                    break
        finally:
            children.end(process)


def _start_process(setup: RideSetup, children: Children) -> subprocess.Popen[bytes]:
    path = os.pathsep.join(filter(None, [setup.folder, os.environ.get("PYTHONPATH")]))
    # -P: no modules from the working directory. Engines that start processes give them the path as well.
    command = [sys.executable, "-P", "-m", "velodrome.scenarios.history.ride"]
    environment = os.environ | _ONE_THREAD | {"PYTHONPATH": path}
    process = children.start(command, environment, with_input=True, with_errors=False)
    _say(process, setup.line())
    return process


def _ask_for_row(
    process: subprocess.Popen[bytes], task: Mapping[str, str], time_limit: float, children: Children
) -> dict[str, Any]:
    _say(process, json.dumps(task))
    line = _read_line(process, time.monotonic() + time_limit)
    if line is None:
        return {"status": FAILED, "reason": f"no result within {time_limit:g} s"}
    try:
        row = json.loads(line)
    except ValueError:
        return {"status": FAILED, "reason": f"its process ended by {_describe_end(children.end(process))}"}
    return {"status": FAILED, "reason": row["broken"]} if "broken" in row else row


def _say(process: subprocess.Popen[bytes], line: str) -> None:
    """Send a line; that a process has ended is noticed where its answer is read."""
    assert process.stdin is not None
    with suppress(BrokenPipeError):
        process.stdin.write(line.encode() + b"\n")
        process.stdin.flush()


def _read_line(process: subprocess.Popen[bytes], due: float) -> bytes | None:
    """Read a line, incomplete where the process has ended; return None if none comes until then."""
    assert process.stdout is not None
    data = b""
    with selectors.DefaultSelector() as selector:
        selector.register(process.stdout, selectors.EVENT_READ)
        while not data.endswith(b"\n"):
            if not selector.select(max(0.0, due - time.monotonic())):
                return None
            part = os.read(process.stdout.fileno(), 1 << 16)
            if not part:
                break
            data += part
    return data


def _describe_end(status: int) -> str:
    return signal.Signals(-status).name if status < 0 else f"exit status {status}"
