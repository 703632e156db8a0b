"""Locks of the folder of environments, which end with the process that holds them."""

from __future__ import annotations

import fcntl
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .children import Children, StoppedError

_LOOK = 0.2  # [s] between two attempts to get a lock


@contextmanager
def hold_lock(path: Path, children: Children, *, shared: bool = False) -> Iterator[None]:
    """Hold a lock that only one process, and one thread of it, has at a time; or several if all of them share it.

    In a folder that cannot be written, an existing file is locked; where there is none, nothing is: nobody can change
    the folder either, except whoever may write it.

    Raises
    ------
    StoppedError
        If the children are stopped while another process has the lock.
    """
    file = _open_lock(path)
    if file is None:
        yield
        return
    try:
        while True:
            try:
                fcntl.flock(file, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                # Waiting in the system would not notice a stop.
                if children.stopped:
                    raise StoppedError("stopped while another process made or used the environment") from None
                time.sleep(_LOOK)
        yield
    finally:
        os.close(file)


def _open_lock(path: Path) -> int | None:
    # Writable for whom the umask lets: the folder may be shared by several users.
    for flags in (os.O_RDWR | os.O_CREAT, os.O_RDONLY):
        try:
            return os.open(path, flags | os.O_CLOEXEC, 0o666)
        except OSError:
            continue
    return None
