"""Supervision of a command that runs in a child process.

An engine can end its process without Python noticing: by ``os._exit``, a crash or ``abort``. After ``os._exit(0)`` a
check would look as if it had passed. The command therefore runs in a fork of the process, made before anything is
loaded (a millisecond), and reports its exit status to the parent through a pipe. Without this report, the parent treats
the command as failed.
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
    """Run a command in a child process and exit with its status.

    If the child ends before the command has finished, one line on stderr gives the reason, and the status is not 0: it
    is 1 if the child ended with status 0. If a signal ended the child, the status is 128 plus its number. Signals sent
    to this process are passed on.

    Parameters
    ----------
    main : callable
        Ends by raising SystemExit with an integer.
    """
    ours, theirs = os.pipe()
    os.set_blocking(ours, False)  # a process that the child has left running may hold the other end open
    # SIGCHLD must not be ignored or arrive before it is waited for.
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    before = signal.pthread_sigmask(signal.SIG_BLOCK, (*_SIGNALS, signal.SIGCHLD))
    parent = os.getpid()
    child = os.fork()
    if child == 0:
        os.close(ours)
        _die_with_parent(parent)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        _reserve_stdout()
        _run_and_report(main, theirs)
    os.close(theirs)
    ended, report = _wait(child), b""
    with suppress(BlockingIOError):
        report = os.read(ours, 16)
    sys.exit(_choose_status(ended, report))


def _die_with_parent(parent: int) -> None:
    """Let this process be killed when its parent ends, if the system supports that."""
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_DIE_WITH_PARENT, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)


def _run_and_report(main: Callable[[], NoReturn], report: int) -> NoReturn:
    """Run a command and write its exit status to the file descriptor ``report``."""
    own = os.getpid()
    status: str | int = 1  # for an exception, whose traceback Python prints
    try:
        main()
    except SystemExit as end:
        status = end.code or 0
        raise
    finally:
        # A process that an engine has forked runs this too, and must not report.
        if os.getpid() == own:
            os.write(report, f"{status}\n".encode())


def _wait(child: int) -> int:
    """Pass signals on until the child ends, and return its exit status, negative for a signal."""
    while True:
        received = signal.sigwaitinfo((*_SIGNALS, signal.SIGCHLD))
        if received.si_signo != signal.SIGCHLD:
            # The child has already received signals from the terminal.
            if received.si_code <= 0:
                with suppress(ProcessLookupError):
                    os.kill(child, received.si_signo)
            continue
        found, status = os.waitpid(child, os.WNOHANG)
        if found == child:
            return os.waitstatus_to_exitcode(status)


def _choose_status(ended: int, report: bytes) -> int:
    """Return the exit status from the child's own status and its report; without a report it is not 0."""
    if ended < 0:
        name = signal.Signals(-ended).name
        if -ended not in _SIGNALS:
            print(f"velodrome: its process was ended by {name} before it was done", file=sys.stderr)
        return 128 - ended
    text = report.decode(errors="replace").removesuffix("\n")
    if not text.isdecimal():
        print(f"velodrome: its process ended itself with status {ended} before it was done", file=sys.stderr)
        return ended or 1
    return ended or int(text)


def _reserve_stdout() -> None:
    """Let only Python's ``sys.stdout`` write to stdout, and redirect the output of compiled code to stderr.

    Another program may read the command's document from stdout.
    """
    if sys.stdout is None or sys.stderr is None:
        return
    sys.stdout.flush()
    duplicate = os.dup(1)
    os.dup2(2, 1)
    sys.stdout = os.fdopen(duplicate, "w", encoding=sys.stdout.encoding, errors=sys.stdout.errors)
