"""Blocks of a data set: however rows came and were replaced, the sorted file is the same to the byte."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from velodrome.scenarios.error import ScenarioError
from velodrome.scenarios.sweep import blocks
from velodrome.scenarios.sweep.blocks import BlockTable

COLUMNS = pa.schema([("index", pa.int64()), ("text", pa.string()), ("value", pa.float64())])


def make_table(folder: Path) -> BlockTable:
    return BlockTable(folder / "results", folder / "results" / "part-0.parquet", folder / "staging", COLUMNS)


def make_records(indices: list[int], turn: int = 0) -> list[dict[str, Any]]:
    """Rows of tasks; some have no values."""
    return [{"index": i, "text": f"{turn}" if i % 3 else None, "value": i / 7 if i % 2 else None} for i in indices]


def read_rows(table: BlockTable) -> list[dict[str, Any]]:
    """All rows of a table's files, in the order of the tasks."""
    found = [row for path in table.list_files() for row in pq.ParquetFile(path).read().to_pylist()]
    return sorted(found, key=lambda row: row["index"])


@given(st.data())
def test_the_sorted_file_does_not_depend_on_how_its_rows_came(data: st.DataObject) -> None:
    indices = data.draw(st.lists(st.integers(0, 60), min_size=1, max_size=40, unique=True))
    ends = sorted(data.draw(st.lists(st.integers(0, len(indices)), max_size=6)))
    again = sorted(data.draw(st.lists(st.sampled_from(indices), max_size=5, unique=True)))
    sorted_between = data.draw(st.booleans())
    with pytest.MonkeyPatch.context() as patch, tempfile.TemporaryDirectory() as folder:
        patch.setattr(blocks, "_ROW_GROUP", 7)
        patch.setattr(blocks, "_CACHED_ROWS", 10)
        one, other = make_table(Path(folder) / "a"), make_table(Path(folder) / "b")
        for begin, end in zip([0, *ends], [*ends, len(indices)], strict=True):
            if begin < end:
                one.add(make_records(indices[begin:end]))
        if sorted_between:
            one.sort()
        if again:
            one.remove(np.array(again))
            one.add(make_records(again, turn=1))
        expected = make_records(sorted(set(indices) - set(again))) + make_records(again, turn=1)
        expected.sort(key=lambda row: row["index"])
        assert read_rows(one) == expected
        one.sort()
        assert one.list_files() == [one.whole]
        other.add(expected)
        other.sort()
        assert one.whole.read_bytes() == other.whole.read_bytes()
        assert read_rows(one) == expected


def test_a_table_without_rows_stays_without_files(tmp_path: Path) -> None:
    table = make_table(tmp_path)
    table.sort()
    assert table.list_files() == []


def test_a_removed_row_is_gone_and_the_others_stay(tmp_path: Path) -> None:
    table = make_table(tmp_path)
    table.add(make_records([0, 1, 2]))
    table.add(make_records([3, 4]))
    untouched = table.list_files()[1].stat().st_mtime_ns
    table.remove(np.array([1]))
    assert [row["index"] for row in read_rows(table)] == [0, 2, 3, 4]
    assert table.list_files()[1].stat().st_mtime_ns == untouched


def test_a_sorted_file_that_was_not_yet_in_its_place_is_put_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = make_table(tmp_path)
    table.add(make_records([2, 3]))
    table.add(make_records([0, 1]))
    monkeypatch.setattr(BlockTable, "_replace_files", lambda _: None)
    table.sort()
    monkeypatch.undo()
    table.list_files()[0].unlink()  # as far as it came
    table.recover()
    assert table.list_files() == [table.whole]
    assert [row["index"] for row in read_rows(table)] == [0, 1, 2, 3]


def test_a_damaged_block_is_named_with_what_to_do(tmp_path: Path) -> None:
    table = make_table(tmp_path)
    table.add(make_records([0, 1]))
    (path,) = table.list_files()
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(ScenarioError, match=r"block-00000000\.parquet: cannot be read .* --resume runs its runs again"):
        table.read(path, ["index"])


def test_a_damaged_value_is_found(tmp_path: Path) -> None:
    table = make_table(tmp_path)
    table.add(make_records([0, 1]))
    table.add(make_records([2, 3]))
    path = table.list_files()[0]
    column = pq.ParquetFile(path).metadata.row_group(0).column(0)
    data = bytearray(path.read_bytes())
    data[column.data_page_offset + column.total_compressed_size - 1] ^= 1
    path.write_bytes(data)
    with pytest.raises(ScenarioError, match=r"block-00000000\.parquet: cannot be read"):
        table.sort()
    assert len(table.list_files()) == 2


@pytest.mark.parametrize("content", [b"PAR1", None])
def test_a_staged_file_that_is_damaged_or_foreign_replaces_nothing(tmp_path: Path, content: bytes | None) -> None:
    table = make_table(tmp_path)
    table.add(make_records([0, 1]))
    staged = table.staging / f"{table.folder.name}.parquet"
    if content is None:
        pq.write_table(pa.table({"index": [5]}), staged)
    else:
        staged.write_bytes(content)
    with pytest.raises(ScenarioError, match=r"cannot be read|is not of this sweep"):
        table.recover()
    assert [row["index"] for row in read_rows(table)] == [0, 1]
