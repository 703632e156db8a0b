"""Entry points of the installed packages, read anew when a folder on Python's path has changed."""

from __future__ import annotations

import os
import sys
from functools import lru_cache
from importlib.metadata import EntryPoint, entry_points


def list_entry_points(group: str) -> tuple[EntryPoint, ...]:
    """Return the entry points of a group.

    Reading those of all packages takes some milliseconds, and every look at an engine needs them. Packages that are
    installed or removed change the time of their folder, by which importlib itself sees them.
    """
    return _read_entry_points(group, tuple((entry, _identify_folder(entry)) for entry in sys.path))


def _identify_folder(path: str) -> tuple[int, int, int] | None:
    """Return what another folder, or a change of its list of files, changes; None where there is no such folder."""
    try:
        found = os.stat(path or os.curdir)
    except (OSError, ValueError):
        return None
    return found.st_dev, found.st_ino, found.st_mtime_ns


@lru_cache(maxsize=8)
def _read_entry_points(group: str, _path: tuple[object, ...]) -> tuple[EntryPoint, ...]:
    return tuple(entry_points(group=group))
