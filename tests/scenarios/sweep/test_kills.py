"""Sweeps whose workers and whose own process are killed, and which are resumed: every row once, equal bits."""

from __future__ import annotations

import json
import random
import signal
import subprocess
import time
from collections import Counter
from pathlib import Path

import pytest
from processes import gone, killed, lines, started, workers_of
from sweeping import UPRIGHT, data_set, here, planned, stored, swept, written

from velodrome.scenarios.sweep.store import JOURNAL, MANIFEST

KILLS = 20
MANY = (
    UPRIGHT
    + """
[latin_hypercube]
count = 1500
seed = 4
ranges.perturbation.lean_rate = [-0.5, 0.5]
ranges.motion.speed = [4.0, 6.0]
"""
)


def reached(out: Path, rows: int, process: subprocess.Popen[str]) -> None:
    """Wait until a sweep has so many rows, or has ended."""
    give_up = time.monotonic() + 120
    while lines(out) < rows and process.poll() is None:
        assert time.monotonic() < give_up
        time.sleep(0.02)


@pytest.mark.slow
def test_twenty_kills_lose_nothing_and_repeat_nothing(tmp_path: Path) -> None:
    path, out, chance = written(tmp_path, MANY), tmp_path / "out", random.Random(7)
    process, done, kills = started(path, out, resume=False), 0, Counter[str]()
    for _ in range(KILLS):
        reached(out, done + chance.randint(5, 60), process)
        time.sleep(chance.random() * 0.02)
        workers = workers_of(process.pid)
        assert process.poll() is None, "the sweep was over before the last kill"
        if chance.random() < 0.5:
            killed(process.pid)
            process.communicate()
            kills["parent"] += 1
            assert gone(workers), "workers outlive their sweep"
            process = started(path, out, resume=True)
        elif workers:
            killed(chance.choice(workers))
            kills["worker"] += 1
        done = lines(out)
    text, _ = process.communicate(timeout=300)
    assert process.returncode == 0, text
    assert min(kills["parent"], kills["worker"]) >= 5
    assert sorted(stored(out)) == list(range(1500))
    swept(planned(tmp_path, MANY), tmp_path / "undisturbed", here)
    assert data_set(out) == data_set(tmp_path / "undisturbed")


@pytest.mark.slow
def test_ctrl_c_keeps_what_is_done_and_says_how_to_go_on(tmp_path: Path) -> None:
    path, out = written(tmp_path, MANY), tmp_path / "out"
    process = started(path, out, resume=False)
    reached(out, 20, process)
    workers = workers_of(process.pid)
    process.send_signal(signal.SIGINT)
    text, _ = process.communicate(timeout=60)
    assert process.returncode == 130
    assert f"velodrome sweep {path} --out {out} --resume" in " ".join(text.split())
    assert workers
    assert gone(workers)
    assert json.loads((out / MANIFEST).read_text())["complete"] is False
    kept = lines(out)
    assert f"{1500 - kept} of 1500 runs are missing" in text


@pytest.mark.slow
def test_two_sweeps_do_not_write_to_one_folder(tmp_path: Path) -> None:
    # Long rides: the first must be at work when the second has started.
    path, out = written(tmp_path, MANY.replace("duration = [0.5]", "duration = [200.0]")), tmp_path / "out"
    process = started(path, out, resume=False)
    reached(out, 1, process)
    second = started(path, out, resume=True)
    text, _ = second.communicate(timeout=60)
    assert "another sweep is writing there" in text
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)
    assert len(set(stored(out))) == len(stored(out))


@pytest.mark.slow
def test_a_disk_without_room_stops_the_sweep_and_loses_nothing(tmp_path: Path) -> None:
    path, out = written(tmp_path, MANY), tmp_path / "out"
    process = started(path, out, resume=False, largest=100_000)
    text, _ = process.communicate(timeout=120)
    assert process.returncode == 1
    assert "cannot write: File too large" in text
    assert (out / JOURNAL).stat().st_size <= 100_000
    kept = lines(out)
    assert f"{1500 - kept} of 1500 runs are missing, finished runs are kept" in text
    process = started(path, out, resume=True)
    text, _ = process.communicate(timeout=120)
    assert process.returncode == 0, text
    assert sorted(stored(out)) == list(range(1500))
