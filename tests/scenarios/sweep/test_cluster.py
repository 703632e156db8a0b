"""A Dask cluster gives the rows of local processes to the bit, and may lose workers."""

from __future__ import annotations

import logging
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Generator, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import planted
import pyarrow.parquet as pq
import pytest
from processes import killed, lines, started
from sweeping import UPRIGHT, data_set, here, planned, rows, stored, swept, written
from test_kills import MANY, reached

from velodrome.scenarios.run import library_versions
from velodrome.scenarios.sweep import cluster_worker
from velodrome.scenarios.sweep.plan import Task
from velodrome.scenarios.sweep.pool import Done
from velodrome.scenarios.sweep.run import Work
from velodrome.scenarios.sweep.store import TIMINGS
from velodrome.scenarios.sweep.summary import status_of
from velodrome.scenarios.sweep.worker import Setup

distributed: Any = pytest.importorskip("distributed")
dask: Any = pytest.importorskip("dask")
pytestmark = pytest.mark.slow


@pytest.fixture
def cluster() -> Generator[Any]:
    with two_workers() as found:
        yield found


def two_workers() -> Any:
    return a_cluster(2)


def a_cluster(workers: int) -> Any:
    """A cluster of one thread a worker, on the loopback."""
    quiet = {"dashboard_address": None, "silence_logs": logging.CRITICAL}
    return distributed.LocalCluster(n_workers=workers, threads_per_worker=1, host="127.0.0.1", **quiet)


def soon(holds: Callable[[], bool]) -> bool:
    """Whether something holds within some seconds."""
    give_up = time.monotonic() + 30
    while not holds() and time.monotonic() < give_up:
        time.sleep(0.05)
    return holds()


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


def test_workers_that_join_later_take_part(tmp_path: Path) -> None:
    plan = planned(tmp_path, MANY)
    with a_cluster(1) as cluster:
        work = on_cluster(cluster.scheduler_address)

        def growing(setup: Setup, tasks: Sequence[Task]) -> Generator[Done]:
            for number, done in enumerate(work(setup, tasks)):
                if number == 4:
                    cluster.scale(2)
                    cluster.wait_for_workers(2)
                yield done

        outcome = swept(plan, tmp_path / "out", growing)
        # A moment after the client has left, the scheduler has forgotten the sweep.
        assert soon(lambda: not any(str(name).startswith("sweep-") for name in cluster.scheduler.task_metadata))
    assert outcome.missing == 0
    assert len(set(pq.read_table(tmp_path / "out" / TIMINGS).column("process").to_pylist())) == 2
    swept(plan, tmp_path / "undisturbed", here)
    assert data_set(tmp_path / "out") == data_set(tmp_path / "undisturbed")


def test_a_task_that_ends_dask_workers_is_given_up_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    planted.announce(tmp_path / "site", monkeypatch)
    rides = [f'{{perturbation.lean_rate = {k / 100}, "engines.{planted.NAME}.fault" = "none"}}' for k in range(12)]
    rides[5] = rides[5].replace("none", "end-host")
    plan = planned(tmp_path, f'engines = ["{planted.NAME}"]\nlist = [{", ".join(rides)}]\n' + UPRIGHT)
    # One loss is enough for Dask to give up a batch, so that the test is over soon.
    with dask.config.set({"distributed.scheduler.allowed-failures": 0}), two_workers() as cluster:
        outcome = swept(plan, tmp_path / "out", on_cluster(cluster.scheduler_address))
    assert outcome.stopped is None
    found = {row["index"]: (row["status"], row["reason"]) for row in rows(tmp_path / "out", planted.NAME)}
    lost = ("killed", "the Dask workers that ran it were lost again and again")
    assert found == dict.fromkeys(range(12), ("done", None)) | {5: lost}


def test_a_worker_with_other_versions_is_refused(cluster: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster_worker, "library_versions", lambda: library_versions() | {"numpy": "1.0"})
    outcome = swept(planned(tmp_path, UPRIGHT), tmp_path / "out", on_cluster(cluster.scheduler_address))
    installed = library_versions()["numpy"]
    assert outcome.stopped == f"a Dask worker has numpy {installed}, this sweep is of 1.0"


def test_a_worker_with_another_velodrome_is_refused(tmp_path: Path) -> None:
    info = tmp_path / "site" / "velodrome-0.0.1.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: velodrome\nVersion: 0.0.1\n")
    plan = planned(tmp_path, UPRIGHT)
    path = f"{info.parent}:{os.environ.get('PYTHONPATH', '')}"
    with a_cluster(0) as cluster:
        address = cluster.scheduler_address
        # A process of its own, whose packages are not those of this one.
        command = [sys.executable, "-m", "dask", "worker", address, "--no-nanny", "--no-dashboard", "--nthreads", "1"]
        worker = subprocess.Popen(
            command, cwd=tmp_path, env=os.environ | {"PYTHONPATH": path}, stderr=subprocess.DEVNULL
        )
        try:
            outcome = swept(plan, tmp_path / "out", on_cluster(address))
        finally:
            worker.terminate()
            worker.wait()
    assert outcome.stopped == f"a Dask worker has velodrome 0.0.1, this sweep is of {version('velodrome')}"


def test_ctrl_c_keeps_the_rows_that_have_come(cluster: Any, tmp_path: Path) -> None:
    path, out = written(tmp_path, MANY.replace("duration = [0.5]", "duration = [20.0]")), tmp_path / "out"
    process = started(path, out, resume=False, scheduler=cluster.scheduler_address)
    reached(out, 20, process)
    process.send_signal(signal.SIGINT)
    text, _ = process.communicate(timeout=60)
    assert process.returncode == 130, text
    kept = lines(out)
    assert 20 <= kept < 1500
    assert f"{1500 - kept} of 1500 runs are missing, finished runs are kept" in " ".join(text.split())
    assert len(set(stored(out))) == len(stored(out)) == kept


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
