"""Batches hold every task once, of neighbours, and take about the time that they are meant to."""

from __future__ import annotations

import json
import random
from collections import Counter
from itertools import chain, pairwise
from pathlib import Path

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from sweeping import UPRIGHT, planned

from velodrome.scenarios.sweep import batches
from velodrome.scenarios.sweep.batches import Batches, Ranges, list_undone
from velodrome.scenarios.sweep.cluster_worker import read_ranges, write_ranges
from velodrome.scenarios.sweep.packing import pack_rows, unpack_rows
from velodrome.scenarios.sweep.plan import TaskSequence
from velodrome.scenarios.sweep.pool import GROUP, Done
from velodrome.scenarios.sweep.selection import SelectedTasks

LEAN = "perturbation.lean_rate = [{}]\n"


def sequence(folder: Path, rows: int, extra: str = "") -> TaskSequence:
    values = ", ".join(repr(k / 1000) for k in range(rows))
    return planned(folder, UPRIGHT.replace("[grid]", f"{extra}\n[grid]") + LEAN.format(values)).tasks


def selected(tasks: TaskSequence, left_out: set[int] | None = None) -> SelectedTasks:
    chosen = np.ones(len(tasks), bool)
    chosen[list(left_out or ())] = False
    return SelectedTasks(tasks, chosen)


def indices(batch: Ranges) -> list[int]:
    return list(chain.from_iterable(batch))


@given(st.lists(st.booleans(), max_size=60))
def test_ranges_are_the_chosen_tasks(chosen: list[bool]) -> None:
    # Only the sequence's length and indices matter here.
    ranges = list(SelectedTasks(None, np.array(chosen, bool)).ranges())  # type: ignore[arg-type]
    assert list(chain.from_iterable(ranges)) == [k for k, found in enumerate(chosen) if found]
    assert all(before.stop < after.start for before, after in pairwise(ranges))
    assert read_ranges(write_ranges(ranges)) == ranges


def test_a_sweep_travels_and_makes_the_same_tasks(tmp_path: Path) -> None:
    extra = "[latin_hypercube]\ncount = 50\nseed = 3\nranges.motion.speed = [4.0, 6.0]\n"
    tasks = sequence(tmp_path, 3, extra)
    assert list(TaskSequence.from_json(json.loads(json.dumps(tasks.as_json())))) == list(tasks)


def test_rows_of_all_layouts_survive_packing() -> None:
    rows = [
        Done(7, {"status": "done", "size": 0.1, "steps": 3}, {"task_time": 1e-3}),
        Done(2, {"status": "killed", "reason": "é\n"}, {}),
        Done(5, {"status": "done", "size": None, "steps": 2**60}, {"task_time": 5e-324}),
    ]
    assert list(unpack_rows(pack_rows(rows))) == rows
    assert list(unpack_rows(pack_rows([]))) == []


def test_every_task_is_done_once_whatever_is_lost_or_left(tmp_path: Path) -> None:
    tasks, chance = sequence(tmp_path, 900), random.Random(5)
    left_out = {k for k in range(900) if chance.random() < 0.1}
    waiting, at_work, done = Batches(selected(tasks, left_out)), list[Ranges](), Counter[int]()
    given_up: set[int] = set()
    while True:
        while len(at_work) < 6 and (batch := waiting.next(2, idle=not at_work)):
            at_work.append(batch)
        if not at_work:
            break
        batch = at_work.pop(chance.randrange(len(at_work)))
        alone = not at_work
        if 500 in indices(batch) or chance.random() < 0.1:  # 500 ends every worker
            index = waiting.lose(batch)
            if index is not None:
                assert alone
                given_up.add(index)
            continue
        found = indices(batch)
        kept = found[: chance.randint(1, len(found))]
        done.update(kept)
        waiting.learn(len(kept), 1e-2 * len(kept), 2)
        waiting.return_undone(list_undone(batch, set(kept)))
    assert 500 in given_up
    assert done == Counter(set(range(900)) - left_out - given_up)


def test_batches_take_a_second_and_the_last_ones_less(tmp_path: Path) -> None:
    waiting, sizes = Batches(selected(sequence(tmp_path, 1000))), list[int]()
    waiting.next(2, idle=True)
    waiting.learn(100, 100 * 5e-3, 2)  # 5 ms a task
    while batch := waiting.next(2, idle=True):
        sizes.append(len(indices(batch)))
    assert sizes[0] == int(batches._SPAN / 5e-3) // GROUP * GROUP
    assert sizes[-2] * 5e-3 >= batches._SHORTEST
    assert sizes == sorted(sizes, reverse=True)
    assert sum(sizes) == 1000 - batches._FIRST


def test_a_batch_grows_step_by_step(tmp_path: Path) -> None:
    waiting = Batches(selected(sequence(tmp_path, 900)))
    first = len(indices(waiting.next(2, idle=True)))
    waiting.learn(first, first * 1e-6, 2)  # as of tasks that were refused
    assert len(indices(waiting.next(2, idle=False))) == batches._GROWTH * first


def test_the_runs_of_a_point_stay_together(tmp_path: Path) -> None:
    extra = 'engines = ["reference", "exudyn", "mujoco-native"]'
    tasks = sequence(tmp_path, 40, extra)
    waiting = Batches(selected(tasks))
    waiting.learn(10, 10 * 0.1, 1)  # ten tasks a second: three points and a bit
    batch = waiting.next(1, idle=True)
    assert len(indices(batch)) == 9
    assert {tasks[index].engine for index in indices(batch)} == {"reference", "exudyn", "mujoco-native"}


def test_a_large_cluster_gets_longer_batches() -> None:
    assert batches.longest_batch(8) == 2 * batches._SPAN
    assert batches.longest_batch(1000) == 2 * 1000 / batches._RATE
