"""The ride processes of one release, as their parent sees them."""

from __future__ import annotations

import json
import os
import selectors
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .adapters import digest_adapter
from .children import Children
from .environments import ReleaseEnvironment
from .problems import digest_suite
from .releases import Release
from .ride import FAILED, REPEATED, RideSetup, describe_exit

_LONGEST_WAIT = 3600.0  # [s]
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

    A process that hangs or ends is replaced.

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
        parent=os.getpid(),
        folder=str(environment.folder),
        package=release.package,
        version=release.version,
        rides=str(rides.path),
        rides_sha256=rides.digest,
        suite_sha256=digest_suite(),
        adapters={engine: digest_adapter(engine, release.package) for _, engine in tasks},
    )
    process: subprocess.Popen[bytes] | None = None
    try:
        for scenario, engine in tasks:
            if process is None:
                process = _start_process(setup, children)
            row = _ask_for_row(process, {"scenario": scenario, "engine": engine}, time_limit)
            if row is None or "broken" in row:
                status = children.end(process)
                process = None
                row = _describe_lost_process(row, status, time_limit)
            yield row
    finally:
        if process is not None:
            children.end(process)


def _start_process(setup: RideSetup, children: Children) -> subprocess.Popen[bytes]:
    path = os.pathsep.join(filter(None, [setup.folder, os.environ.get("PYTHONPATH")]))
    # -P: no modules from the working directory. Engines that start processes give them the path as well.
    command = [sys.executable, "-P", "-m", "velodrome.scenarios.history.ride"]
    environment = os.environ | _ONE_THREAD | {"PYTHONPATH": path}
    process = children.start(command, environment, with_input=True, with_errors=False)
    _say(process, setup.line())
    return process


def _ask_for_row(process: subprocess.Popen[bytes], task: Mapping[str, str], time_limit: float) -> dict[str, Any] | None:
    """Return the answer to a task; None if it does not come in time, ``broken`` if the process has ended or cannot."""
    _say(process, json.dumps(task))
    line = _read_line(process, time.monotonic() + time_limit)
    if line is None:
        return None
    try:
        return json.loads(line)
    except ValueError:
        return {"broken": None}


def _describe_lost_process(answer: Mapping[str, Any] | None, status: int, time_limit: float) -> dict[str, Any]:
    if answer is None:
        return {"status": FAILED, "reason": f"no result within {time_limit:g} s", REPEATED: True}
    return {
        "status": FAILED,
        "reason": answer["broken"] or f"its process ended by {describe_exit(status)}",
        REPEATED: True,
    }


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
            # In parts, since the system takes no time of any length.
            if not selector.select(min(_LONGEST_WAIT, max(0.0, due - time.monotonic()))):
                if time.monotonic() >= due:
                    return None
                continue
            part = os.read(process.stdout.fileno(), 1 << 16)
            if not part:
                break
            data += part
    return data
