"""What the processes that ride releases have in common: lines of JSON on their own streams, and their end.

A process is told what to do by lines on standard input, the first of which describes it, and answers by lines on
standard output. Engines print and read as well, so that both streams are set aside for the protocol first.
"""

from __future__ import annotations

import ctypes
import faulthandler
import json
import os
import signal
from collections.abc import Mapping
from contextlib import suppress
from typing import Any, TextIO

ASKING = signal.SIGUSR1  # asks a process where it is in its code
_DIE_WITH_PARENT = 1  # PR_SET_PDEATHSIG of Linux's prctl


def reserve_streams() -> tuple[TextIO, int]:
    """Return standard input, and the file descriptor of standard output, and put nothing in the place of both.

    Standard error is discarded too.
    """
    lines, results = os.fdopen(os.dup(0), encoding="utf-8"), os.dup(1)
    with open(os.devnull, "r+b") as nothing:
        for standard in (0, 1, 2):
            os.dup2(nothing.fileno(), standard)
    return lines, results


def send_message(results: int, message: Mapping[str, Any]) -> None:
    """Write a message as one line."""
    data = json.dumps(message, allow_nan=False).encode() + b"\n"
    while data:
        data = data[os.write(results, data) :]


def answer_where(results: int) -> None:
    """Write the frames of this process, and of its forks, to a file descriptor whenever the signal `ASKING` comes.

    Compiled code that does not return to Python is no hindrance.
    """
    faulthandler.register(ASKING, file=results, all_threads=False)


def die_with(parent: int) -> None:
    """Let this process be killed when its parent ends, if the system supports that."""
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_DIE_WITH_PARENT, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)


def describe_exit(status: int) -> str:
    """Return words for the exit status of a process, negative for a signal."""
    return signal.Signals(-status).name if status < 0 else f"exit status {status}"
