"""Worker processes: the same bits from one or two, and a row for whatever becomes of a worker."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import planted
import pytest
from processes import alive
from sweeping import UPRIGHT, data_set, here, planned, rows, swept

from velodrome.scenarios.sweep import pool
from velodrome.scenarios.sweep.pool import Pool, WorkersBroken
from velodrome.scenarios.sweep.summary import status_of
from velodrome.scenarios.sweep.worker import Setup

pytestmark = pytest.mark.once  # processes of the operating system; `test_run` rides in sweeps

RAISE = 'raise RuntimeError("out of\\norder")'


@contextmanager
def within(seconds: float) -> Iterator[None]:
    """Break off what waits for ever."""

    def give_up(*_: object) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGALRM, give_up)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def test_one_worker_two_workers_and_this_process_give_equal_bits(tmp_path: Path) -> None:
    text = (
        'engines = ["reference", "mujoco-native"]\n' + UPRIGHT + "perturbation.lean_rate = [0.0, 0.1, 0.2, 0.3, 0.4]\n"
    )
    plan = planned(tmp_path, text)
    for work, name in ((1, "one"), (2, "two"), (here, "here")):
        swept(plan, tmp_path / name, work)
    assert data_set(tmp_path / "one") == data_set(tmp_path / "two") == data_set(tmp_path / "here")


def test_each_fault_is_one_row_and_the_others_go_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    planted.announce(tmp_path / "site", monkeypatch)
    plan = planned(tmp_path, planted.SWEEP)
    outcome = swept(plan, tmp_path / "out", 2)
    found = {(row["engines.planted.fault"], row["status"]): row["reason"] for row in rows(tmp_path / "out", "planted")}
    assert found == {
        ("hang", "timeout"): "no result within 5.0 s",
        ("crash", "killed"): "its process ended 3 times, last by SIGSEGV",
        ("none", "done"): None,
        ("hog", "memory"): "more memory than the sweep's memory_limit, or than there is",
        ("raise", "failed"): f"RuntimeError: out of order (planted.py:{planted.line_of(RAISE)})",
        ("exit", "failed"): f"it called sys.exit(0) (planted.py:{planted.line_of('sys.exit(0)')})",
        ("leave", "killed"): "its process ended 3 times, last by exit status 0",
        ("abort", "killed"): "its process ended 3 times, last by SIGABRT",
    }
    assert {row["version"] for row in rows(tmp_path / "out", "planted")} == {"1.0"}
    assert outcome.counts["planted"] == {"timeout": 1, "killed": 3, "done": 1, "memory": 1, "failed": 2}
    assert status_of(outcome) == 1


def test_a_keeper_that_is_stopped_while_its_child_dies_is_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pool, "_PATIENCE", 1.0)
    # A worker has two groups at most, so that most tasks are still to be done when the first row comes.
    count = 8 * pool.GROUP
    rates = ", ".join(str(k / 1000) for k in range(count))
    plan = planned(tmp_path, UPRIGHT + f"perturbation.lean_rate = [{rates}]\n")
    # No time limit comes to the rescue, and nobody else does the work.
    with within(120.0), Pool(Setup(plan.base, 1000.0, None), 1) as workers:
        arriving = workers.run(plan.tasks)
        found = [next(arriving)]
        (worker,) = workers._workers
        assert worker.child is not None
        os.kill(worker.process.pid, signal.SIGSTOP)
        os.kill(worker.child, signal.SIGKILL)
        found += arriving
        assert workers._workers != [worker]
    assert sorted(done.index for done in found) == list(range(count))
    assert {done.row["status"] for done in found} == {"done"}
    assert not alive(worker.process.pid)


def test_a_run_whose_time_is_over_leaves_the_rest_for_the_next(tmp_path: Path) -> None:
    rates = ", ".join(str(k / 1000) for k in range(200))
    plan = planned(tmp_path, UPRIGHT + f"perturbation.lean_rate = [{rates}]\n")
    with Pool(Setup(plan.base, 60.0, None), 1) as workers:
        first = [done.index for done in workers.run(plan.tasks, longest=0.0)]
        # What was sent before the first row came: a worker alone gets whole groups, two at a time.
        assert len(first) == 2 * pool.GROUP
        assert workers.elapsed() > 0.0
        rest = [task for task in plan.tasks if task.index not in first]
        assert sorted(first + [done.index for done in workers.run(rest)]) == list(range(200))


def test_a_task_that_ends_its_process_is_judged_even_when_the_time_is_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    planted.announce(tmp_path / "site", monkeypatch)
    faults = UPRIGHT + f'"engines.{planted.NAME}.fault" = ["none", "crash"]\nperturbation.lean_rate = [0.0, 0.1, 0.2]\n'
    plan = planned(tmp_path, f'engines = ["{planted.NAME}"]\n' + faults)
    with Pool(Setup(plan.base, 60.0, None), 1) as workers:
        found = list(workers.run(plan.tasks, longest=0.0))
    # Two tasks are sent at once; the second crashes three times, and the others are not begun.
    assert [(done.index, done.row["status"]) for done in found] == [(0, "done"), (1, "killed")]


@pytest.mark.slow
def test_a_keeper_that_is_stopped_before_its_first_child_is_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = planned(tmp_path, UPRIGHT)
    monkeypatch.setattr(pool, "_STARTING", 0.0)
    with within(120.0), Pool(Setup(plan.base, 1000.0, None), 1) as workers:
        (worker,) = workers._workers
        os.kill(worker.process.pid, signal.SIGSTOP)
        monkeypatch.undo()
        (done,) = workers.run(plan.tasks)
    assert done.row["status"] == "done"
    assert not alive(worker.process.pid)


def test_workers_that_do_not_start_are_said(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    plan = planned(tmp_path, UPRIGHT)
    monkeypatch.setattr(pool.sys, "executable", "/bin/false")
    with pytest.raises(WorkersBroken, match="no worker starts"), Pool(Setup(plan.base, 1.0, None), 2) as workers:
        list(workers.run(plan.tasks))
