"""Atomic writing of files."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def write_whole(path: Path, durable: bool = False) -> Iterator[Path]:
    """Yield a temporary path to write to, which replaces ``path`` at the end; after an exception it is removed.

    The temporary path is in the same folder and has the same suffix, from which writers infer the format.

    Parameters
    ----------
    path : Path
    durable : bool
        Whether the file must be on the disk, safe from a power failure, when the context ends.
    """
    partial = path.with_name(f".partial-{path.name}")
    try:
        yield partial
        if durable:
            _sync(partial)
        os.replace(partial, path)
        if durable:
            _sync(path.parent)
    finally:
        partial.unlink(missing_ok=True)


def move_file(source: Path, target: Path) -> None:
    """Move a file within one file system, in one step that a power failure does not undo."""
    os.replace(source, target)
    _sync(target.parent)


def _sync(path: Path) -> None:
    """Write a file, or the entries of a folder, to the disk."""
    file = os.open(path, os.O_RDONLY)
    try:
        os.fsync(file)
    finally:
        os.close(file)
