"""The rows of a sweep while it runs: each in the journal at once, then with others in a block of the data set."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np

from ..error import ScenarioError
from .journal import ForeignLine, Journal, JournalLine, finished_rows
from .plan import SweepPlan
from .pool import Done
from .rows import STATUSES, make_record
from .store import JOURNAL, Opened, make_tables, make_timing_table, remove_staging

_BLOCK_ROWS = 4096  # rows of a block: it takes about a third of a second to write
# A block is written after a minute even if it is smaller, or after a fiftieth of the time so far if that is longer:
# then their number grows with the logarithm of that time.
_BLOCK_TIME, _BLOCK_SHARE = 60.0, 0.02

_CODES = {status: code for code, status in enumerate(STATUSES, 1)}


class ResultStore:
    """The rows of a sweep on the disk, and how many there are; a context, in which no other process writes there.

    A row is written to the journal when it arrives, so that a killed process loses none. When the journal has enough
    rows they are written as a block into each table, and the journal is emptied. If the process is killed between the
    two, the journal's rows are also in blocks; the next process finds that and removes them there.

    Parameters
    ----------
    out : Path
        The sweep's folder.
    plan : SweepPlan
    opened : Opened

    Raises
    ------
    ScenarioError
        If another process writes there, a file is damaged, or there are rows of another sweep.
    """

    def __init__(self, out: Path, plan: SweepPlan, opened: Opened) -> None:
        self._out, self._plan, self._opened = out, plan, opened
        self._codes = np.zeros(len(plan.tasks), np.uint8)  # of the rows' statuses, 0 where there is no row
        self._stored = np.zeros(len(plan.tasks), bool)  # tasks that a table has, with or without the timing
        self._counts: dict[str, Counter[str]] = {engine: Counter() for engine in plan.file.engines}
        self._pending: dict[int, Done] = {}  # rows that are not yet in a block, by task
        self._begun = self._written_at = time.monotonic()
        self._tables = make_tables(out, plan, opened)
        self._timings = make_timing_table(out, opened)
        self._journal = Journal(out / JOURNAL)
        try:
            self._read_stored()
        except BaseException:
            self._journal.close()
            raise

    def __enter__(self) -> ResultStore:
        return self

    def __exit__(self, *_: object) -> None:
        self._journal.close()

    @property
    def counts(self) -> dict[str, dict[str, int]]:
        """Numbers of rows by engine and status."""
        return {engine: {name: n for name, n in found.items() if n} for engine, found in self._counts.items()}

    def list_statuses(self) -> set[str]:
        """Return the statuses that rows have."""
        return {status for found in self.counts.values() for status in found}

    def select_missing(self, retry: Collection[str]) -> np.ndarray:
        """Return which tasks have no row, or one of a status that is to be tried again; shape (n,) of bool."""
        return (self._codes == 0) | np.isin(self._codes, [_CODES[status] for status in retry])

    def add(self, done: Done) -> None:
        """Write a finished task; its earlier row, if it has one, is replaced.

        Raises
        ------
        OSError
            If the disk is full or another error occurs; all earlier rows are kept.
        """
        self._journal.append(JournalLine(self._opened.key, done.index, done.row, done.timing))
        self._count(done)
        waited = time.monotonic() - self._written_at
        longest = max(_BLOCK_TIME, _BLOCK_SHARE * (self._written_at - self._begun))
        if len(self._pending) >= _BLOCK_ROWS or waited > longest:
            self.write_block()

    def write_block(self) -> None:
        """Move the journal's rows into a block of each table.

        Raises
        ------
        OSError
            If the disk is full or another error occurs; the rows stay in the journal.
        """
        if self._pending:
            records: dict[str, list[dict[str, Any]]] = {engine: [] for engine in self._tables}
            clocks = []
            for index, done in self._pending.items():
                task = self._plan.tasks[index]
                # A run that was killed could not report its version.
                version = {"version": self._opened.facts["engines"][task.engine]}
                columns = self._tables[task.engine].columns
                records[task.engine].append(version | make_record(task, done.row, columns))
                clocks.append({"key": task.key, "index": index, "engine": task.engine, **done.timing})
            # The timings last: then a row that has one is found in its engine's table, too.
            blocks = [(self._tables[engine], found) for engine, found in records.items()]
            arrived = np.array(list(self._pending))
            replaced = arrived[self._stored[arrived]]
            for table, found in [*blocks, (self._timings, clocks)]:
                if len(replaced):
                    table.remove(replaced)
                if found:
                    table.add(found)
            self._journal.clear()
            self._stored[arrived] = True
            self._pending = {}
        self._written_at = time.monotonic()

    def finish(self) -> None:
        """Write what is pending, and merge the blocks of each table into one sorted file.

        Raises
        ------
        OSError
            If the disk is full or another error occurs; no row is lost.
        """
        self.write_block()
        for table in (*self._tables.values(), self._timings):
            table.sort()
        remove_staging(self._out)

    def _count(self, done: Done) -> None:
        counts = self._counts[self._plan.tasks.find_engine_of(done.index)]
        if self._codes[done.index]:
            counts[STATUSES[self._codes[done.index] - 1]] -= 1
        self._codes[done.index] = _CODES[done.row["status"]]
        counts[done.row["status"]] += 1
        self._pending[done.index] = done

    def _read_stored(self) -> None:
        """Read which rows there are, after what a killed process left has been put in order.

        Raises
        ------
        ScenarioError
            If a file is damaged, or a row does not belong to this sweep.
        """
        for table in (*self._tables.values(), self._timings):
            table.recover()
        timed = np.zeros(len(self._codes), bool)
        for path in self._timings.list_files():
            timed[self._timings.read(path, ["index"]).column("index").to_numpy()] = True
        self._stored |= timed
        for engine, table in self._tables.items():
            for path in table.list_files():
                self._read_file(engine, path, timed)
        path = self._out / JOURNAL
        try:
            for line in finished_rows(path):
                # The sweep's key is a digest of all its tasks: with it, the index says which task it is.
                if line.sweep != self._opened.key or not 0 <= line.index < len(self._codes):
                    raise ForeignLine(f"the row {line.index}")
                self._count(Done(line.index, line.row, line.timing))
        except ForeignLine as error:
            raise ScenarioError(
                f"{path}: has {error}, which is not of this sweep; name another folder by --out"
            ) from error

    def _read_file(self, engine: str, path: Path, timed: np.ndarray) -> None:
        """Read which rows of an engine a file has; one without its timing is done again, as if it were not there."""
        found = self._tables[engine].read(path, ["index", "status"])
        index = found.column("index").to_numpy()
        statuses = found.column("status").combine_chunks().dictionary_encode()
        names = statuses.dictionary.to_pylist()
        kinds = statuses.indices.to_numpy()
        whole = timed[index]
        if self._codes[index].any():
            raise ScenarioError(f"{path}: has rows that another file has as well; remove one of them")
        self._stored[index] = True
        self._codes[index] = np.where(whole, np.array([_CODES[name] for name in names], np.uint8)[kinds], 0)
        counts = np.bincount(kinds[whole], minlength=len(names)).tolist()
        self._counts[engine].update(dict(zip(names, counts, strict=True)))
