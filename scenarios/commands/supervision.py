"""A command in a child process, whose parent knows whether it came to its end.

An engine can end its process where Python has no say: by ``os._exit``, by a crash, by ``abort``. With ``os._exit(0)``
a check would end as one that holds. So the command runs in a fork of the process, made before anything is loaded (a
millisecond), and tells its parent with what status it ended; the parent takes nothing else for an end.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import NoReturn

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_DIE_WITH_PARENT = 1  # PR_SET_PDEATHSIG of Linux's prctl


def run_supervised(main: Callable[[], NoReturn]) -> NoReturn:
    """Run a command in a child process and end with its exit status.

    The status is 1, and one line on stderr says why, if the child ends before the command has; it is 128 and the
    number of the signal that ended it, if one did. Signals sent to this process are passed on.

    Parameters
    ----------
    main : callable
        Ends by SystemExit with a whole number.
    """
    ours, theirs = os.pipe()
    os.set_blocking(ours, False)  # a process that the child has left behind may hold the other end
    # The child's end must not slip by before it is waited for.
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    before = signal.pthread_sigmask(signal.SIG_BLOCK, (*_SIGNALS, signal.SIGCHLD))
    parent = os.getpid()
    child = os.fork()
    if child == 0:
        os.close(ours)
        _end_with(parent)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        _keep_stdout()
        _run(main, theirs)
    os.close(theirs)
    ended, told = _wait(child), b""
    with suppress(BlockingIOError):
        told = os.read(ours, 16)
    sys.exit(_status(ended, told))


def _end_with(parent: int) -> None:
    """Let this process be killed when its parent is, where the system knows how."""
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_DIE_WITH_PARENT, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)


def _run(main: Callable[[], NoReturn], report: int) -> NoReturn:
    own = os.getpid()
    status: str | int = 1  # of a fault of the suite, which Python shows
    try:
        main()
    except SystemExit as end:
        status = end.code or 0
        raise
    finally:
        # A copy of this process that an engine has forked passes here too; it has no say.
        if os.getpid() == own:
            os.write(report, f"{status}\n".encode())


def _wait(child: int) -> int:
    """Wait for the end of the child and return its exit status, negative for a signal; pass signals on meanwhile."""
    while True:
        came = signal.sigwaitinfo((*_SIGNALS, signal.SIGCHLD))
        if came.si_signo != signal.SIGCHLD:
            # What the terminal sends, the child has had as well.
            if came.si_code <= 0:
                with suppress(ProcessLookupError):
                    os.kill(child, came.si_signo)
            continue
        found, status = os.waitpid(child, os.WNOHANG)
        if found == child:
            return os.waitstatus_to_exitcode(status)


def _status(ended: int, told: bytes) -> int:
    """Exit status for how the child ended and what it told before; none but the command itself can make it 0."""
    if ended < 0:
        name = signal.Signals(-ended).name
        if -ended not in _SIGNALS:
            print(f"velodrome: its process was ended by {name} before it was done", file=sys.stderr)
        return 128 - ended
    said = told.decode(errors="replace").removesuffix("\n")
    if not said.isdecimal():
        print(f"velodrome: its process ended itself with status {ended} before it was done", file=sys.stderr)
        return ended or 1
    return ended or int(said)


def _keep_stdout() -> None:
    """Let only Python's ``sys.stdout`` write to stdout; what compiled code prints there goes to stderr.

    stdout belongs to the command's own document, which another program may read.
    """
    if sys.stdout is None or sys.stderr is None:
        return
    sys.stdout.flush()
    kept = os.dup(1)
    os.dup2(2, 1)
    sys.stdout = os.fdopen(kept, "w", encoding=sys.stdout.encoding, errors=sys.stdout.errors)
