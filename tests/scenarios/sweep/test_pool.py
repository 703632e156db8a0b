"""Worker processes: the same bits from one or two, and a row for whatever becomes of a worker."""

from __future__ import annotations

from pathlib import Path

import planted
import pytest
from sweeping import UPRIGHT, data_set, here, planned, rows, swept

from scenarios.sweep import pool
from scenarios.sweep.pool import Pool, WorkersBroken
from scenarios.sweep.summary import status_of
from scenarios.sweep.worker import Setup


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
        ("raise", "failed"): "RuntimeError: out of order",
        ("abort", "killed"): "its process ended 3 times, last by SIGABRT",
    }
    assert {row["version"] for row in rows(tmp_path / "out", "planted")} == {"1.0"}
    assert outcome.counts["planted"] == {"timeout": 1, "killed": 2, "done": 1, "memory": 1, "failed": 1}
    assert status_of(outcome) == 1


def test_workers_that_do_not_start_are_said(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    plan = planned(tmp_path, UPRIGHT)
    monkeypatch.setattr(pool.sys, "executable", "/bin/false")
    with pytest.raises(WorkersBroken, match="no worker starts"), Pool(Setup(plan.base, 1.0, None), 2) as workers:
        list(workers.run(plan.tasks))
