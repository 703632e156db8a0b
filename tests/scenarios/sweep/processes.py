"""A sweep in a process of its own, and who works for it."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pyarrow as pa
from sweeping import stored

_COMMAND = """
import sys
from pathlib import Path
from velodrome.scenarios.commands.run_sweep import run_sweep_command
from velodrome.scenarios.sweep import results
results._BLOCK_ROWS = 100
path, out, resume, scheduler = sys.argv[1:]
workers = None if scheduler else 2
sys.exit(run_sweep_command(Path(path), scheduler or None, workers, Path(out), resume == "resume", False))
"""


def started(
    path: Path, out: Path, resume: bool, largest: int | None = None, scheduler: str = ""
) -> subprocess.Popen[str]:
    """Run a sweep file, in blocks of 100 rows, on two workers or a cluster; no file may exceed so many bytes."""
    limit = None if largest is None else lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (largest, largest))
    return subprocess.Popen(
        [sys.executable, "-c", _COMMAND, str(path), str(out), "resume" if resume else "", scheduler],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        preexec_fn=limit,
    )


def children(pid: int) -> list[int]:
    with suppress(OSError):
        return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    return []


def workers_of(pid: int) -> list[int]:
    """The keepers of a sweep's workers, and their children."""
    keepers = children(pid)
    return keepers + [child for keeper in keepers for child in children(keeper)]


def alive(pid: int) -> bool:
    """Whether a process runs; a zombie does not."""
    with suppress(OSError):
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    return False


def gone(pids: list[int]) -> bool:
    """Whether all processes end soon; one that is still loading notices afterwards that it is not needed."""
    give_up = time.monotonic() + 30
    while any(alive(pid) for pid in pids) and time.monotonic() < give_up:
        time.sleep(0.05)
    return not any(alive(pid) for pid in pids)


def killed(pid: int) -> None:
    with suppress(ProcessLookupError):
        os.kill(pid, signal.SIGKILL)


def lines(out: Path) -> int:
    """Return the number of rows so far."""
    with suppress(OSError, pa.ArrowException):  # a block may vanish between its listing and its reading
        return len(stored(out))
    return 0
