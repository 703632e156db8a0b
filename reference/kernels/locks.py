"""Locks between processes that compile the same kernels.

All locks of a folder are single bytes of one file, held by the process: they end with it, however it ends. Where a
file system or an operating system has no such locks, two processes may compile the same kernel, and both are right.
"""

from __future__ import annotations

import hashlib
import os
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

try:
    import fcntl
except ImportError:  # Windows
    fcntl: Any = None  # type: ignore[no-redef]


def wait_for_lock(folder: Path, name: str) -> None:
    """Lock a name, as soon as no other process has locked it."""
    # A deadlock, which the operating system notices, is an OSError as well.
    with suppress(OSError):
        if fcntl is not None:
            fcntl.lockf(_open_locks(folder, os.getpid()), fcntl.LOCK_EX, 1, _place(name))


def unlock(folder: Path, name: str) -> None:
    """Unlock a name."""
    with suppress(OSError):
        if fcntl is not None:
            fcntl.lockf(_open_locks(folder, os.getpid()), fcntl.LOCK_UN, 1, _place(name))


@cache
def _open_locks(folder: Path, process: int) -> int:
    """Open the file of locks, once in a process: closing it anywhere would end all of the process's locks."""
    return os.open(folder / "locks", os.O_RDWR | os.O_CREAT, 0o666)


def _place(name: str) -> int:
    """Return the byte of a name; two with the same one wait for each other without need."""
    return int.from_bytes(hashlib.sha256(name.encode()).digest()[:4], "big") >> 1
