"""Child processes of several threads, which end together."""

from __future__ import annotations

import os
import signal
import subprocess
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress


class StoppedError(RuntimeError):
    """Raised where a child is to be started after all have been stopped."""


class Children:
    """Child processes, each the leader of a process group of its own, so that Ctrl-C reaches this process alone."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._alive: set[subprocess.Popen[bytes]] = set()
        self._stopped = False

    @property
    def stopped(self) -> bool:
        """Whether all have been stopped."""
        return self._stopped

    def start(
        self, command: Sequence[str], environment: Mapping[str, str], with_input: bool, with_errors: bool
    ) -> subprocess.Popen[bytes]:
        """Start a process whose output is read.

        Parameters
        ----------
        command : sequence of str
        environment : mapping
        with_input : bool
            Whether it is sent anything.
        with_errors : bool
            Whether its standard error is read; it is discarded otherwise.

        Raises
        ------
        StoppedError
            After `stop`.
        """
        with self._lock:
            if self._stopped:
                raise StoppedError("no process is started any more")
            process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE if with_input else subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE if with_errors else subprocess.DEVNULL,
                env=environment,
                start_new_session=True,
            )
            self._alive.add(process)
            return process

    def end(self, process: subprocess.Popen[bytes]) -> int:
        """End a process with all that it has started, by force, and return its status as `subprocess.Popen` does."""
        with self._lock:
            self._alive.discard(process)
        _kill_group(process)
        return process.wait()

    def stop(self) -> None:
        """Kill all processes, and let none be started any more."""
        with self._lock:
            self._stopped = True
            for process in self._alive:
                _kill_group(process)


def _kill_group(process: subprocess.Popen[bytes]) -> None:
    # The number of a process that has been waited for may be another's by now.
    if process.returncode is not None:
        return
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
