"""The processes that ride one release, as their parent sees them."""

from __future__ import annotations

import json
import math
import os
import re
import selectors
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from .adapters import digest_adapter
from .children import Children
from .environments import ReleaseEnvironment
from .problems import RideFile, digest_suite
from .protocol import ASKING, describe_exit
from .releases import Release
from .ride import FAILED, REPEATED, RideSetup

_RIDE_PROGRAM = "velodrome.scenarios.history.ride"
_LONGEST_WAIT = 3600.0  # [s]
_ANSWER = 2.0  # [s] for a process to say where it is
_FRAME = re.compile(r'^  File "(.*)", line (\d+) in (.*)$', re.MULTILINE)  # by faulthandler, the innermost first
_ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"), "1"
)


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
    process: LaidOverProcess | None = None
    try:
        for scenario, engine in tasks:
            if process is None:
                process = LaidOverProcess(_RIDE_PROGRAM, environment.folder, children)
                process.send(setup.line())
            process.send(json.dumps({"scenario": scenario, "engine": engine}))
            row, goes_on = _read_row(process, time_limit)
            if not goes_on:
                process.end()
                process = None
            yield row
    finally:
        if process is not None:
            process.end()


def _read_row(process: LaidOverProcess, time_limit: float) -> tuple[dict[str, Any], bool]:
    """Return the answer to a task, and whether the process can go on."""
    line = process.read_line(time.monotonic() + time_limit)
    if line is None:
        place = process.ask_place()
        return _fail(f"no result within {time_limit:g} s" + (f", {place}" if place else "")), False
    try:
        row = json.loads(line)
    except ValueError:
        return _fail(f"its process ended by {describe_exit(process.end())}"), False
    return (_fail(row["broken"]), False) if "broken" in row else (row, True)


def _fail(reason: str) -> dict[str, Any]:
    """Return the row of a ride that the process did not come back from."""
    return {"status": FAILED, "reason": reason, REPEATED: True}


class LaidOverProcess:
    """A process that runs a module of the suite with a release's environment first on its path.

    Parameters
    ----------
    module : str
        It lays the environment over its own by `velodrome.scenarios.history.overlay.lay_over`, and speaks as
        `velodrome.scenarios.history.protocol` says.
    folder : Path
        The environment.
    children : Children
    """

    def __init__(self, module: str, folder: Path, children: Children) -> None:
        path = os.pathsep.join(filter(None, [str(folder), os.environ.get("PYTHONPATH")]))
        # -P: no modules from the working directory. Engines that start processes give them the path as well.
        command = [sys.executable, "-P", "-m", module]
        environment = os.environ | _ONE_THREAD | {"PYTHONPATH": path}
        self._folder, self._children = folder, children
        self._process = children.start(command, environment, with_input=True, with_errors=False)
        self._read = b""

    def send(self, line: str) -> None:
        """Send a line; that the process has ended is noticed where its answer is read."""
        assert self._process.stdin is not None
        with suppress(BrokenPipeError):
            self._process.stdin.write(line.encode() + b"\n")
            self._process.stdin.flush()

    def read_line(self, due: float = math.inf) -> bytes | None:
        """Read a line, incomplete where the process has ended; return None if none comes until then.

        Parameters
        ----------
        due : float
            By `time.monotonic` [s].
        """
        while b"\n" not in self._read:
            part = self._read_part(due)
            if part is None:
                return None
            if not part:
                break
            self._read += part
        line, end, self._read = self._read.partition(b"\n")
        return line + end

    def ask_place(self) -> str | None:
        """Return in words what the process is at in Python code; None if it does not say so soon."""
        self.interrupt(ASKING)
        due, said = time.monotonic() + _ANSWER, self._read
        while part := self._read_part(due):
            said += part
            due = min(due, time.monotonic() + _ANSWER / 10)  # the frames come at once
        return describe_place(said.decode(errors="replace"), self._folder)

    def interrupt(self, what: signal.Signals) -> None:
        """Send a signal to the process and to all that it has started."""
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, what)

    def end(self) -> int:
        """End the process with all that it has started, and return its status as `subprocess.Popen` does."""
        return self._children.end(self._process)

    def _read_part(self, due: float) -> bytes | None:
        """Read what there is, nothing where the process has ended; return None if nothing comes until then."""
        assert self._process.stdout is not None
        with selectors.DefaultSelector() as selector:
            selector.register(self._process.stdout, selectors.EVENT_READ)
            # In parts, since the system takes no time of any length.
            while not selector.select(min(_LONGEST_WAIT, max(0.0, due - time.monotonic()))):
                if time.monotonic() >= due:
                    return None
        return os.read(self._process.stdout.fileno(), 1 << 16)


def describe_place(frames: str, folder: Path) -> str | None:
    """Return in words where a process is by its frames: in a module that it imports, or in a function.

    Parameters
    ----------
    frames : str
        As `faulthandler` writes them.
    folder : Path
        The release's environment: of the modules that are being imported, its own count.

    Returns
    -------
    str or None
        None without frames.
    """
    found = [(Path(file), int(line), name) for file, line, name in _FRAME.findall(frames)]
    found = [(file, line, name) for file, line, name in found if not str(file).startswith("<")]
    if not found:
        return None
    importing = [frame for frame in found if frame[2] == "<module>" and frame[0].is_relative_to(folder)]
    file, line, name = (importing or found)[0]
    shown = file.relative_to(folder) if file.is_relative_to(folder) else file.name
    return f"while it imported {shown} (line {line})" if importing else f"while in {name} ({shown}, line {line})"
