"""Runs of long rides: the results of short ones, in memory that does not grow with the number of engines."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from velodrome.engines import disk_arrays
from velodrome.engines.engine import SHAPES
from velodrome.scenarios.run.folder import RunPlan
from velodrome.scenarios.run.runner import RunResult, plan_run, store_run
from velodrome.scenarios.scenario.schema import load_scenario

ENGINES = ["mujoco-native", "mujoco-multipliers"]


def plan(name: str, changes: dict[str, Any]) -> RunPlan:
    return plan_run(*load_scenario(name, changes), wanted=ENGINES)


def store(made: RunPlan, out: Path) -> tuple[Path, RunResult]:
    return store_run(made, out, lambda *_: None, lambda _: None, recording=False)


def test_rides_on_disk_give_the_results_of_rides_in_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = plan("q2-plus", {"simulation.duration": 0.5})
    folder, short = store(made, tmp_path)
    monkeypatch.setattr(disk_arrays, "LONG_RIDE", 10)
    monkeypatch.setattr(disk_arrays, "BLOCK", 7)
    other, long = store(made, tmp_path)
    assert {path.name for path in folder.iterdir()} == {path.name for path in other.iterdir()}
    timed = ("cpu_time", "real_time_factor")
    for name, metrics in short.metrics.items():
        kept = [{key: value for key, value in one.items() if key not in timed} for one in (metrics, long.metrics[name])]
        assert kept[0] == kept[1], name
    assert set(long.metrics) == set(short.metrics) == {"reference", *ENGINES}
    for rides in ("trajectories", "shown"):
        for name, ride in getattr(long, rides).items():
            for field in SHAPES:
                pair = [getattr(one, field) for one in (ride, getattr(short, rides)[name])]
                assert np.array_equal(*pair), (rides, name, field)


_MEASURE = """
import json, resource, sys
from pathlib import Path
from velodrome.scenarios.run.runner import plan_run, store_run
from velodrome.scenarios.scenario.schema import load_scenario

def store(duration, engines, out):
    fields = {"simulation.duration": duration, "simulation.output_rate": 10_000.0}
    fields |= {f"engines.{name}.step": 1e-4 for name in engines}
    made = plan_run(*load_scenario("plane-circle", fields), wanted=engines)
    store_run(made, Path(out), lambda *_: None, lambda _: None, recording=False)
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024

*engines, out = sys.argv[1:]
store(0.1, engines, out)  # compiles and loads everything
print(json.dumps([store(7.0, [engines[0]], out), store(7.0, engines, out)]))
"""


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the unit of the largest memory is the system's")
def test_further_engines_take_no_further_memory(tmp_path: Path) -> None:
    """The largest memory of a run with three engines is that with one, up to less than one ride's arrays."""
    engines = [f"mujoco-{name}" for name in ("native", "multipliers", "exact-contact")]
    done = subprocess.run(
        [sys.executable, "-c", _MEASURE, *engines, str(tmp_path)], capture_output=True, text=True, check=True
    )
    alone, together = json.loads(done.stdout)
    numbers = sum(int(np.prod(shape, dtype=int)) for shape in SHAPES.values())
    assert together - alone < 70_001 * numbers * 8
