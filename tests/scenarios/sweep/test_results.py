"""Rows on their way to the data set: an end at any step loses none and repeats none."""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from sweeping import UPRIGHT, data_set, planned, rows, stored, swept

from velodrome.scenarios.error import ScenarioError
from velodrome.scenarios.sweep import results
from velodrome.scenarios.sweep.plan import SweepPlan, Task
from velodrome.scenarios.sweep.pool import Done
from velodrome.scenarios.sweep.run import run_sweep
from velodrome.scenarios.sweep.store import JOURNAL, RESULTS, TIMINGS
from velodrome.scenarios.sweep.worker import Setup

COUNT = 6
TEXT = 'engines = ["reference", "mujoco-native"]\n' + UPRIGHT
TEXT += f"perturbation.lean_rate = {[i / 100 for i in range(COUNT)]}\n"


class Killed(BaseException):
    """Stands for the end of the process."""


def invent(setup: Setup, tasks: Sequence[Task]) -> Generator[Done]:
    """Return rows without riding, in an order that is not that of the tasks."""
    del setup
    for place in sorted(range(len(tasks)), key=lambda place: place * 7 % 5):
        index = tasks[place].index
        yield Done(index, {"status": "fell" if index % 4 else "done", "energy_drift": index / 3}, {"task_time": 0.1})


def invent_failures(setup: Setup, tasks: Sequence[Task]) -> Generator[Done]:
    """Return rows of which some have failed."""
    for done in invent(setup, tasks):
        yield Done(done.index, {"status": "failed", "reason": "of itself"}, {}) if done.index % 3 == 0 else done


@pytest.fixture
def plan(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> SweepPlan:
    """Return a sweep of two engines, the rows of which come in blocks of four."""
    monkeypatch.setattr(results, "_BLOCK_ROWS", 4)
    monkeypatch.setattr(os, "fsync", lambda _: None)  # no power fails here, and it takes milliseconds
    return planned(tmp_path, TEXT)


def end_at_step(patch: pytest.MonkeyPatch, last: int) -> None:
    """End the process before a step that changes a folder or a journal."""
    taken = [0]

    def ending(step: Callable[..., Any]) -> Callable[..., Any]:
        def take(*arguments: Any, **keywords: Any) -> Any:
            taken[0] += 1
            if taken[0] > last:
                raise Killed
            return step(*arguments, **keywords)

        return take

    for module, name in ((os, "replace"), (os, "ftruncate"), (os, "fsync"), (Path, "unlink")):
        patch.setattr(module, name, ending(getattr(module, name)))


def find_timed(out: Path) -> list[int]:
    return pq.read_table(out / TIMINGS).column("index").to_pylist()


STRIDES = pytest.mark.parametrize("stride", [7, pytest.param(1, marks=pytest.mark.slow)])


@STRIDES
def test_an_end_at_any_step_loses_no_row_and_repeats_none(plan: SweepPlan, tmp_path: Path, stride: int) -> None:
    swept(plan, tmp_path / "undisturbed", invent)
    expected, last, ended = data_set(tmp_path / "undisturbed"), 0, True
    while ended:
        out, ended, resume = tmp_path / f"out-{last}", False, False
        for first in (last, last % 13):  # the second session ends, too
            with pytest.MonkeyPatch.context() as patch:
                end_at_step(patch, first)
                try:
                    swept(plan, out, invent, resume=resume)
                except Killed:
                    ended = True
            resume = (out / "sweep.json").exists()
            found = stored(out)
            assert len(found) == len(set(found))
        asked: list[int] = []

        def count(setup: Setup, tasks: Sequence[Task], asked: list[int] = asked) -> Generator[Done]:
            asked.extend(task.index for task in tasks)
            yield from invent(setup, tasks)

        swept(plan, out, count, resume=resume)
        assert sorted([*asked, *found]) == list(range(2 * COUNT)), "a row that was there was done again"
        assert data_set(out) == expected
        assert find_timed(out) == list(range(2 * COUNT))
        assert sorted(path.name for path in out.iterdir()) == [JOURNAL, RESULTS, "sweep.json", TIMINGS]
        last += stride
    assert last > 40


@STRIDES
def test_an_end_while_rows_are_replaced_keeps_one_row_of_each_task(
    plan: SweepPlan, tmp_path: Path, stride: int
) -> None:
    swept(plan, tmp_path / "undisturbed", invent)
    expected, last, ended = data_set(tmp_path / "undisturbed"), 0, True
    while ended:
        out, ended = tmp_path / f"out-{last}", False
        swept(plan, out, invent_failures)
        with pytest.MonkeyPatch.context() as patch:
            end_at_step(patch, last)
            try:
                run_sweep(plan, out, invent, True, lambda _: None, ["failed"])
            except Killed:
                ended = True
        assert sorted(stored(out)) == list(range(2 * COUNT)), "a row was lost, or is there twice"
        outcome = run_sweep(plan, out, invent, True, lambda _: None, ["failed"])
        assert (outcome.missing, outcome.stopped) == (0, None)
        assert data_set(out) == expected
        assert find_timed(out) == list(range(2 * COUNT))
        last += stride
    assert last > 20


def test_rows_can_be_read_while_the_sweep_runs(plan: SweepPlan, tmp_path: Path) -> None:
    out, seen = tmp_path / "out", []

    def look(_: Done) -> None:
        # As any reader of a partitioned data set does.
        if (out / RESULTS).exists():
            table = pq.read_table(out / RESULTS)
            found = table.column("index").to_pylist()
            assert len(found) == len(set(found))
            assert set(table.column("engine").to_pylist()) <= set(plan.file.engines)
            seen.append(len(found))

    run_sweep(plan, out, invent, False, look)
    assert seen == sorted(seen)
    assert set(range(4, 2 * COUNT, 4)) <= set(seen)
    assert pq.read_table(out / RESULTS).num_rows == len(rows(out)) + len(rows(out, "mujoco-native")) == 2 * COUNT


def test_a_slow_sweep_writes_a_block_of_few_rows(
    plan: SweepPlan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(results, "_BLOCK_ROWS", 1000)
    clock = [0.0]
    monkeypatch.setattr(results.time, "monotonic", lambda: clock[0])
    out, blocks = tmp_path / "out", []

    def look(_: Done) -> None:
        clock[0] += 40.0
        blocks.append(len(list((out / RESULTS).glob("engine=reference/*"))))

    run_sweep(plan, out, invent, False, look)
    assert blocks[:6] == [0, 0, 1, 1, 2, 2]


def test_an_unreadable_file_stops_before_anything_is_written(plan: SweepPlan, tmp_path: Path) -> None:
    out = tmp_path / "out"
    swept(plan, out, invent)
    part = out / RESULTS / "engine=reference" / "part-0.parquet"
    part.write_bytes(b"PAR1")
    with pytest.raises(Exception, match=r"part-0\.parquet: cannot be read"):
        swept(plan, out, invent, resume=True)
    part.unlink()
    assert swept(plan, out, invent, resume=True).missing == 0
    assert rows(out) == pa.Table.to_pylist(pq.ParquetFile(part).read())
    assert len(rows(out)) == COUNT


@pytest.mark.parametrize("name", ["results/engine=reference/block-00000000.parquet", "timing/block-00000000.parquet"])
def test_a_lost_block_is_ridden_again_with_its_timings(plan: SweepPlan, tmp_path: Path, name: str) -> None:
    def stop(setup: Setup, tasks: Sequence[Task]) -> Generator[Done]:
        yield from islice(invent(setup, tasks), 9)
        raise KeyboardInterrupt

    out = tmp_path / "out"
    swept(plan, tmp_path / "undisturbed", invent)
    swept(plan, out, stop)
    block = out / name
    lost = pq.ParquetFile(block).read(columns=["index"]).num_rows
    block.write_bytes(block.read_bytes()[:-20])
    with pytest.raises(ScenarioError, match=r"block-00000000\.parquet: cannot be read .* remove it"):
        swept(plan, out, invent, resume=True)
    block.unlink()
    asked: list[int] = []

    def count(setup: Setup, tasks: Sequence[Task]) -> Generator[Done]:
        asked.extend(task.index for task in tasks)
        yield from invent(setup, tasks)

    swept(plan, out, count, resume=True)
    assert len(asked) == 3 + lost
    assert data_set(out) == data_set(tmp_path / "undisturbed")
    assert find_timed(out) == list(range(2 * COUNT))


def test_a_sweep_without_its_timings_gets_them_again(plan: SweepPlan, tmp_path: Path) -> None:
    out = tmp_path / "out"
    swept(plan, out, invent)
    expected = data_set(out)
    (out / TIMINGS).unlink()
    assert swept(plan, out, invent, resume=True).counts == swept(plan, out, invent, resume=True).counts
    assert find_timed(out) == list(range(2 * COUNT))
    assert data_set(out) == expected


def test_a_row_of_two_files_is_refused(plan: SweepPlan, tmp_path: Path) -> None:
    out = tmp_path / "out"
    swept(plan, out, invent)
    part = out / RESULTS / "engine=reference" / "part-0.parquet"
    part.with_name("block-00000007.parquet").write_bytes(part.read_bytes())
    with pytest.raises(ScenarioError, match=r"block-00000007\.parquet: has rows that another file has as well"):
        swept(plan, out, invent, resume=True)


def test_a_damaged_name_of_a_column_is_found(plan: SweepPlan, tmp_path: Path) -> None:
    out = tmp_path / "out"
    swept(plan, out, invent)
    table = pq.read_table(out / TIMINGS)
    names = ["hosu" if name == "host" else name for name in table.column_names]
    renamed = table.rename_columns(names).replace_schema_metadata(table.schema.metadata)
    pq.write_table(renamed, out / TIMINGS)
    with pytest.raises(ScenarioError, match=r"timing\.parquet: is damaged: it has other columns"):
        swept(plan, out, invent, resume=True)
