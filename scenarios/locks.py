"""Files that one process at a time may have open for writing."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path


def open_locked(path: Path) -> int:
    """Open a file for reading and writing, which is made if it is not there, and lock it until it is closed.

    Returns
    -------
    int
        File descriptor.

    Raises
    ------
    BlockingIOError
        If the file is locked already.
    OSError
        If it cannot be opened.
    """
    file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(file)
        raise
    return file
