"""A Dask cluster gives the rows of local processes to the bit, and may lose workers."""

from __future__ import annotations

import logging
import socket
import subprocess
import sys
from collections.abc import Generator, Sequence
from pathlib import Path
from typing import Any

import planted
import pytest
from processes import killed
from sweeping import UPRIGHT, data_set, here, planned, stored, swept
from test_kills import MANY

from velodrome.scenarios.sweep.plan import Task
from velodrome.scenarios.sweep.pool import Done
from velodrome.scenarios.sweep.run import Work
from velodrome.scenarios.sweep.summary import status_of
from velodrome.scenarios.sweep.worker import Setup

distributed: Any = pytest.importorskip("distributed")
pytestmark = pytest.mark.slow


@pytest.fixture
def cluster() -> Generator[Any]:
    with two_workers() as found:
        yield found


def two_workers() -> Any:
    """A cluster of one thread a worker, on the loopback."""
    quiet = {"dashboard_address": None, "silence_logs": logging.CRITICAL}
    return distributed.LocalCluster(n_workers=2, threads_per_worker=1, host="127.0.0.1", **quiet)


def on_cluster(address: str) -> Work:
    from velodrome.scenarios.sweep.cluster import on_cluster

    return on_cluster(address)


def test_a_cluster_gives_the_bits_of_local_processes(cluster: Any, tmp_path: Path) -> None:
    text = 'engines = ["reference", "exudyn", "mujoco-native"]\n' + UPRIGHT + "perturbation.lean_rate = [0.0, 0.1, 0.2]"
    plan = planned(tmp_path, text)
    swept(plan, tmp_path / "cluster", on_cluster(cluster.scheduler_address))
    swept(plan, tmp_path / "local", 2)
    assert data_set(tmp_path / "cluster") == data_set(tmp_path / "local")


def test_a_worker_that_is_lost_midway_loses_nothing(cluster: Any, tmp_path: Path) -> None:
    plan = planned(tmp_path, MANY)
    pids = [worker.pid for worker in cluster.workers.values()]
    work = on_cluster(cluster.scheduler_address)

    def losing(setup: Setup, tasks: Sequence[Task]) -> Generator[Done]:
        for number, done in enumerate(work(setup, tasks)):
            if number == 200:
                killed(pids[0])
            yield done

    outcome = swept(plan, tmp_path / "out", losing)
    assert outcome.missing == 0
    assert sorted(stored(tmp_path / "out")) == list(range(1500))
    swept(plan, tmp_path / "undisturbed", here)
    assert data_set(tmp_path / "out") == data_set(tmp_path / "undisturbed")


def test_a_scheduler_that_is_lost_stops_the_sweep_and_it_goes_on_elsewhere(cluster: Any, tmp_path: Path) -> None:
    plan, out = planned(tmp_path, MANY), tmp_path / "out"
    work = on_cluster(cluster.scheduler_address)

    def losing(setup: Setup, tasks: Sequence[Task]) -> Generator[Done]:
        for number, done in enumerate(work(setup, tasks)):
            if number == 100:
                cluster.close()
            yield done

    first = swept(plan, out, losing)
    assert first.stopped is not None
    assert first.missing < 1500
    assert status_of(first) == 1
    swept(plan, out, 2, resume=True)
    assert sorted(stored(out)) == list(range(1500))
    swept(plan, tmp_path / "undisturbed", here)
    assert data_set(out) == data_set(tmp_path / "undisturbed")


def test_faults_on_a_cluster_are_the_rows_they_are_here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    planted.announce(tmp_path / "site", monkeypatch)
    plan = planned(tmp_path, planted.SWEEP)
    # Its processes must find the engine.
    with two_workers() as cluster:
        outcome = swept(plan, tmp_path / "cluster", on_cluster(cluster.scheduler_address))
    assert outcome.stopped is None
    swept(plan, tmp_path / "local", 2)
    assert data_set(tmp_path / "cluster") == data_set(tmp_path / "local")


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nope", "", "http://nope", "tls://127.0.0.1:1", "LISTENER"])
def test_no_scheduler_is_said_in_one_line(address: str) -> None:
    # In a process of its own: Dask complains when its objects are collected.
    code = (
        "import gc, sys\n"
        "from velodrome.scenarios.error import ScenarioError\n"
        "from velodrome.scenarios.sweep import cluster\n"
        "cluster._PATIENCE = 1\n"
        "try:\n"
        "    cluster.on_cluster(sys.argv[1])\n"
        "except ScenarioError as error:\n"
        "    line = str(error)\n"
        "gc.collect()\n"
        "print(line)\n"
    )
    with socket.create_server(("127.0.0.1", 0)) as silent:
        if address == "LISTENER":  # accepts and says nothing
            address = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        done = subprocess.run([sys.executable, "-c", code, address], capture_output=True, text=True, timeout=60)
    words = f"--scheduler {address}: no Dask scheduler answers there; give the address"
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith(words)
    assert done.stdout.count("\n") == 1
