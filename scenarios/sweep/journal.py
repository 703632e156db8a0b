"""The journal of a sweep: the rows that are not yet in a block of the data set, one per line.

Each row is written before it is reported. A line is a checksum, the task's index and JSON, which names the sweep that
the row belongs to; the index says which task it is. A line cut short by a crash or a full disk is ignored, and for a
damaged line it is as if its task had not run. Of two lines of one task the later one holds: the task was tried again.
Only one process writes at a time.
"""

from __future__ import annotations

import json
import os
import time
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..error import ScenarioError
from ..locks import open_locked

_BATCH, _WAIT = 200, 0.5  # rows, seconds that a power failure may lose; a killed process loses none


@dataclass(frozen=True)
class JournalLine:
    """A finished task.

    Attributes
    ----------
    sweep : str
        Key of the sweep that it belongs to; see `store.open_folder`.
    index : int
        The task's index in the sweep.
    row, timing : dict
    """

    sweep: str
    index: int
    row: dict[str, Any]
    timing: dict[str, Any]

    def encode(self) -> bytes:
        """Return the line as it is written to the journal."""
        found = {"sweep": self.sweep, "row": self.row, "timing": self.timing}
        body = f"{self.index} {json.dumps(found, separators=(',', ':'), allow_nan=False)}".encode()
        return b"%08x %b\n" % (zlib.crc32(body), body)


def parse_lines(line: bytes) -> JournalLine | None:
    """Parse one line; return None if it is incomplete or damaged.

    Raises
    ------
    ForeignLine
        If it is complete but not in the format of this version's journals.
    """
    checksum, _, body = line.rstrip(b"\n").partition(b" ")
    if not line.endswith(b"\n") or checksum != b"%08x" % zlib.crc32(body):
        return None
    index, _, text = body.partition(b" ")
    try:
        found = json.loads(text)
        return JournalLine(str(found["sweep"]), int(index), dict(found["row"]), dict(found["timing"]))
    except (KeyError, TypeError, ValueError) as error:
        raise ForeignLine("a line of another journal format") from error


class ForeignLine(ValueError):
    """A complete line that does not belong to this journal."""


class Journal:
    """Append rows to a file that one process at a time may have open; a context.

    Parameters
    ----------
    path : Path
        Created if it does not exist. An incomplete line at its end is removed before the first line is added.

    Raises
    ------
    ScenarioError
        If another process is writing to it.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            self._file = open_locked(path)
        except BlockingIOError as error:
            raise ScenarioError(f"{path.parent}: another sweep is writing there") from error
        self._end = _length_of_whole_lines(path)
        self._partial_line_removed = False
        self._unsynced, self._synced_at = 0, time.monotonic()

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file, which another process may then open."""
        os.close(self._file)  # this also releases the lock

    def append(self, line: JournalLine) -> None:
        """Write a finished task.

        Raises
        ------
        OSError
            If the disk is full or another error occurs; the journal is then as before.
        """
        if not self._partial_line_removed:
            self._remove_partial_line()
        data = line.encode()
        written = 0
        try:
            while written < len(data):
                written += os.write(self._file, data[written:])
        except OSError:
            self._remove_partial_line()
            raise
        self._end += len(data)
        self._unsynced += 1
        if self._unsynced >= _BATCH or time.monotonic() - self._synced_at > _WAIT:
            self.sync()

    def _remove_partial_line(self) -> None:
        """Remove what follows the last complete line."""
        os.ftruncate(self._file, self._end)
        os.lseek(self._file, self._end, os.SEEK_SET)
        self._partial_line_removed = True

    def clear(self) -> None:
        """Remove all lines; their rows are in blocks that are on the disk.

        Raises
        ------
        OSError
            If the file cannot be changed; the lines then stay.
        """
        self._end = 0
        self._remove_partial_line()
        self.sync()

    def sync(self) -> None:
        """Write everything to the disk, so that a power failure loses nothing."""
        os.fsync(self._file)
        self._unsynced, self._synced_at = 0, time.monotonic()


def finished_rows(path: Path) -> Iterator[JournalLine]:
    """Read the complete lines of a journal in order.

    Raises
    ------
    ForeignLine
        If a line has another journal format.
    """
    if not path.exists():
        return
    with path.open("rb") as file:
        for line in file:
            found = parse_lines(line)
            if found is not None:
                yield found


def _length_of_whole_lines(path: Path) -> int:
    """Return the length of a file up to its last line feed."""
    with path.open("rb") as file:
        end = file.seek(0, os.SEEK_END)
        while end > 0:
            start = max(0, end - 65536)
            file.seek(start)
            last = file.read(end - start).rfind(b"\n")
            if last >= 0:
                return start + last + 1
            end = start
    return 0
