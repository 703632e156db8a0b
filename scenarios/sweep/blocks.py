"""Tables of a sweep's data set: Parquet blocks that are added while it runs, and one sorted file in the end.

A file appears in its place whole, and a row is never in two of them, so that other programs may read a table at any
time. A process may be killed at any moment: what it left in the staging folder is either continued or ignored.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ...engines.files import move_file, write_whole
from ..error import ScenarioError

_ROW_GROUP = 20_000  # rows of a row group of the sorted file
_CACHED_ROWS = 400_000  # rows of blocks kept in memory while they are merged: about 200 MB


@dataclass(frozen=True)
class BlockTable:
    """One table: the rows of an engine, or the timings.

    Attributes
    ----------
    folder : Path
        Folder of the blocks.
    whole : Path
        The sorted file.
    staging : Path
        Folder on the same file system in which files are prepared.
    columns : pyarrow.Schema
        With a column ``index``, the row's task.
    """

    folder: Path
    whole: Path
    staging: Path
    columns: pa.Schema

    @property
    def _sorted(self) -> Path:
        """Path of a sorted file that is complete and not yet in its place."""
        return self.staging / f"{self.folder.name}.parquet"

    def list_files(self) -> list[Path]:
        """Return the files that hold the rows: the sorted one, then the blocks in the order of their making."""
        whole = [self.whole] if self.whole.exists() else []
        return whole + sorted(self.folder.glob("block-*.parquet"))

    def recover(self) -> None:
        """Put a sorted file in its place if the process was killed before it did.

        Raises
        ------
        ScenarioError
            If it is damaged or not of this table; the blocks then stay.
        """
        if self._sorted.exists():
            self.read(self._sorted, ["index"])
            self._replace_files()

    def read(self, path: Path, columns: Sequence[str]) -> pa.Table:
        """Read columns of one of the files, after it is known to be of this table and fit to be merged with others.

        Raises
        ------
        ScenarioError
            If it is damaged or of another sweep.
        """
        with _open_table(path) as file:
            if file.schema_arrow.metadata != self.columns.metadata:
                raise ScenarioError(f"{path}: is not of this sweep; name another folder by --out")
            if not file.schema_arrow.equals(self.columns):  # its footer is damaged
                raise ScenarioError(
                    f"{path}: is damaged: it has other columns, or is not of this sweep; "
                    "remove it, and --resume runs its runs again"
                )
            return file.read(columns=list(columns))

    def add(self, records: Sequence[Mapping[str, Any]]) -> None:
        """Add rows as a block.

        Parameters
        ----------
        records : sequence of mapping
            Values by column, one row or more, of tasks that have no row in the table.
        """
        blocks = [path for path in self.list_files() if path != self.whole]
        number = int(blocks[-1].stem.partition("-")[2]) + 1 if blocks else 0
        table = pa.Table.from_pylist(sorted(records, key=lambda record: record["index"]), schema=self.columns)
        self.folder.mkdir(parents=True, exist_ok=True)
        self._write(self.folder / f"block-{number:08d}.parquet", [table])

    def remove(self, indices: np.ndarray) -> None:
        """Remove the rows of tasks, by writing the files that have some without them.

        Parameters
        ----------
        indices : ndarray of int, shape (n,)
        """
        for path in self.list_files():
            if np.isin(self.read(path, ["index"]).column("index").to_numpy(), indices).any():
                self._write(path, _iterate_without(path, indices))

    def sort(self) -> None:
        """Replace all blocks by one file, sorted by task."""
        files = self.list_files()
        if files and files != [self.whole]:
            self._write(self._sorted, self._iterate_sorted(files))
            self._replace_files()
        with suppress(OSError):  # the folder of blocks is empty where the sorted file is not in it
            self.folder.rmdir()

    def _write(self, path: Path, tables: Sequence[pa.Table] | Iterator[pa.Table]) -> None:
        """Write a file from its row groups; it appears whole and on the disk, or not at all."""
        self.staging.mkdir(exist_ok=True)
        prepared = self.staging / "next.parquet"
        with (
            write_whole(prepared, durable=True) as partial,
            # With checksums, a damaged value is found when the table is read, rather than taken for a result.
            pq.ParquetWriter(partial, self.columns, compression="zstd", write_page_checksum=True) as writer,
        ):
            for table in tables:
                writer.write_table(table)
        move_file(prepared, path)

    def _replace_files(self) -> None:
        """Put the sorted file in the place of all others; a reader may miss rows for a moment, and sees none twice."""
        for path in self.list_files():
            path.unlink()
        move_file(self._sorted, self.whole)

    def _iterate_sorted(self, files: Sequence[Path]) -> Iterator[pa.Table]:
        """Yield the rows of files sorted by task, in row groups; of two rows of one task that of the later file."""
        groups = _RowGroups(files)
        order = np.argsort(groups.index, kind="stable")
        ordered = groups.index[order]
        order = order[np.append(ordered[1:] != ordered[:-1], True)]
        for begin in range(0, len(order), _ROW_GROUP):
            yield groups.take(order[begin : begin + _ROW_GROUP])


class _RowGroups:
    """The row groups of files as one table, of which only those last used are in memory.

    Parameters
    ----------
    files : sequence of Path
    """

    def __init__(self, files: Sequence[Path]) -> None:
        self._places: list[tuple[Path, int]] = []
        parts: list[np.ndarray] = []
        for path in files:
            with _open_table(path) as file:
                for number in range(file.num_row_groups):
                    self._places.append((path, number))
                    parts.append(file.read_row_group(number, columns=["index"]).column("index").to_numpy())
        self.index = np.concatenate(parts) if parts else np.zeros(0, np.int64)
        self._ends = np.cumsum([len(part) for part in parts])
        self._read: OrderedDict[int, pa.Table] = OrderedDict()

    def take(self, rows: np.ndarray) -> pa.Table:
        """Return rows in the given order."""
        owners = np.searchsorted(self._ends, rows, side="right")
        by_owner = np.argsort(owners, kind="stable")
        found = []
        for owner in np.unique(owners).tolist():
            begin = int(self._ends[owner - 1]) if owner else 0
            found.append(self._read_group(owner).take(rows[owners == owner] - begin))
        # Back to the given order: the i-th row found is the one that was asked for at by_owner[i].
        return pa.concat_tables(found).combine_chunks().take(np.argsort(by_owner, kind="stable"))

    def _read_group(self, owner: int) -> pa.Table:
        if owner in self._read:
            self._read.move_to_end(owner)
        else:
            path, number = self._places[owner]
            with _open_table(path) as file:
                self._read[owner] = file.read_row_group(number)
            while len(self._read) > 1 and sum(table.num_rows for table in self._read.values()) > _CACHED_ROWS:
                self._read.popitem(last=False)
        return self._read[owner]


@contextmanager
def _open_table(path: Path) -> Iterator[pq.ParquetFile]:
    """Open a file of a table; an error of reading it becomes one line that says what to do."""
    try:
        with pq.ParquetFile(path, page_checksum_verification=True) as file:
            yield file
    except (OSError, pa.ArrowException, UnicodeDecodeError) as error:  # the last for the name of a column
        text = " ".join(str(error).split())
        raise ScenarioError(f"{path}: cannot be read ({text}); remove it, and --resume runs its runs again") from error


def _iterate_without(path: Path, indices: np.ndarray) -> Iterator[pa.Table]:
    """Yield the row groups of a file without the rows of some tasks."""
    with _open_table(path) as file:
        number_of_groups = file.num_row_groups
    for number in range(number_of_groups):
        with _open_table(path) as file:  # not while the caller writes, whose errors are not of this file
            table = file.read_row_group(number)
        yield table.filter(pa.array(~np.isin(table.column("index").to_numpy(), indices)))
