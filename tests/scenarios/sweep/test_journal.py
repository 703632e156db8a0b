"""The journal: what is not whole is not taken for a row."""

from __future__ import annotations

import errno
import os
import zlib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from velodrome.scenarios.error import ScenarioError
from velodrome.scenarios.sweep.journal import ForeignLine, Journal, JournalLine, finished_rows, parse_lines

ROWS = [
    JournalLine("0123abcd", 3, {"status": "done", "x": 0.1 + 0.2}, {}),
    JournalLine("0123abcd", 1, {"status": "fell", "reason": "é\n"}, {"cpu_time": 1e-300}),
]


def kept(path: Path) -> list[JournalLine]:
    return list(finished_rows(path))


def test_rows_come_back_to_the_bit(tmp_path: Path) -> None:
    path = tmp_path / "journal"
    with Journal(path) as journal:
        for row in ROWS:
            journal.append(row)
    assert kept(path) == ROWS


@pytest.mark.parametrize("cut", [1, 2, 9, 30])
def test_a_torn_last_line_is_cut_off_and_what_follows_is_whole(tmp_path: Path, cut: int) -> None:
    path = tmp_path / "journal"
    path.write_bytes(ROWS[0].encode() + ROWS[1].encode()[:-cut])
    assert kept(path) == [ROWS[0]]
    with Journal(path) as journal:
        journal.append(ROWS[1])
    assert kept(path) == ROWS


def test_a_line_without_any_end_is_no_row(tmp_path: Path) -> None:
    path = tmp_path / "journal"
    path.write_bytes(ROWS[0].encode()[:40])
    assert kept(path) == []
    with Journal(path) as journal:
        journal.append(ROWS[1])
    assert path.read_bytes() == ROWS[1].encode()


def test_nothing_is_cut_off_before_there_is_something_to_write(tmp_path: Path) -> None:
    path = tmp_path / "journal"
    path.write_bytes(ROWS[0].encode()[:40])
    with Journal(path):
        pass
    assert path.read_bytes() == ROWS[0].encode()[:40]


@pytest.mark.parametrize("text", ['{"row":{},"timing":{}}', "3", "[]", "x", '{"sweep":1,"row":3,"timing":4}'])
def test_a_whole_line_of_another_kind_is_told_from_a_damaged_one(text: str) -> None:
    body = f"3 {text}".encode()
    with pytest.raises(ForeignLine):
        parse_lines(b"%08x %b\n" % (zlib.crc32(body), body))


@given(st.data())
def test_no_altered_line_is_taken_for_a_row(data: st.DataObject) -> None:
    line = ROWS[1].encode()
    place = data.draw(st.integers(0, len(line) - 1))
    bit = 1 << data.draw(st.integers(0, 7))
    assert parse_lines(line[:place] + bytes([line[place] ^ bit]) + line[place + 1 :]) is None


def test_a_damaged_line_costs_that_row_only(tmp_path: Path) -> None:
    path = tmp_path / "journal"
    path.write_bytes(ROWS[0].encode().replace(b"done", b"gone") + ROWS[1].encode())
    assert kept(path) == [ROWS[1]]


def test_a_cleared_journal_takes_further_rows(tmp_path: Path) -> None:
    path = tmp_path / "journal"
    with Journal(path) as journal:
        journal.append(ROWS[0])
        journal.clear()
        assert path.read_bytes() == b""
        journal.append(ROWS[1])
    assert kept(path) == [ROWS[1]]


def test_one_process_writes_at_a_time(tmp_path: Path) -> None:
    with Journal(tmp_path / "journal"), pytest.raises(ScenarioError, match="another sweep is writing"):
        Journal(tmp_path / "journal")
    with Journal(tmp_path / "journal"):
        pass


def test_a_full_disk_leaves_whole_lines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, write = tmp_path / "journal", os.write

    def filling(file: int, data: bytes) -> int:
        if len(data) < 50:
            raise OSError(errno.ENOSPC, "No space left on device")
        return write(file, data[: len(data) // 2])

    with Journal(path) as journal:
        journal.append(ROWS[0])
        monkeypatch.setattr(os, "write", filling)
        with pytest.raises(OSError, match="No space"):
            journal.append(ROWS[1])
        assert path.read_bytes() == ROWS[0].encode()
        monkeypatch.undo()
        journal.append(ROWS[1])
    assert kept(path) == ROWS
