"""Sweeps of the size that they are for."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from sweeping import UPRIGHT, planned, rows, swept

from velodrome.scenarios.sweep.plan import plan_sweep
from velodrome.scenarios.sweep.rows import COMPUTED
from velodrome.scenarios.sweep.store import RESULTS, TIMINGS

EXAMPLES = Path(__file__).parents[3] / "examples" / "sweeps"
LONGEST_OVERHEAD = 5e-3  # s a run, beyond the engine's own time


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.toml")), ids=lambda path: path.stem)
def test_the_examples_are_sweeps(path: Path) -> None:
    assert len(plan_sweep(path).tasks) > 50


@pytest.mark.slow
def test_two_thousand_runs_of_the_reference_cost_little_beside_themselves(tmp_path: Path) -> None:
    text = UPRIGHT.replace("[20.0]", "[10.0]").replace("[0.5]", "[20.0]")
    text += "[latin_hypercube]\ncount = 2000\nseed = 2\nranges.motion.speed = [4.4, 5.8]\n"
    plan = planned(tmp_path, text + "ranges.perturbation.lean_rate = [-0.5, 0.5]")
    outcome = swept(plan, tmp_path / "out", 2)
    assert outcome.counts == {"reference": {"done": 2000}}
    assert [row["index"] for row in rows(tmp_path / "out")] == list(range(2000))
    timing = pq.read_table(tmp_path / "out" / TIMINGS)
    beside = timing.column("task_time").to_numpy() - timing.column("engine_time").to_numpy()
    # CPU time, not the clock's: other work on the machine is none of the sweep's.
    assert np.median(beside) < LONGEST_OVERHEAD


@pytest.mark.slow
def test_two_hundred_runs_of_several_engines(tmp_path: Path) -> None:
    engines = ("reference", "exudyn", "mujoco-native", "mujoco-multipliers")
    text = f"engines = {list(engines)}\n" + UPRIGHT + "perturbation.lean_rate = [0.0, 0.1, 0.2, 0.3, 0.4]\n"
    text += "motion.speed = [4.4, 4.6, 4.8, 5.0, 5.2]\n"
    text += '"engines.exudyn.step" = [0.01, 0.005, 0.0025]\n"engines.mujoco-native.step" = [0.002, 0.001, 0.0005]\n'
    plan = planned(tmp_path, text)
    assert Counter(task.engine for task in plan.tasks) == dict(zip(engines, (25, 75, 75, 25), strict=True))
    outcome = swept(plan, tmp_path / "out", 2)
    assert all(set(counts) <= set(COMPUTED) for counts in outcome.counts.values())
    found = pq.read_table(tmp_path / "out" / RESULTS, columns=["engine", "position_error_max", "engines.exudyn.step"])
    assert found.num_rows == 200
    error = {
        step: max(row["position_error_max"] for row in found.to_pylist() if row["engines.exudyn.step"] == step)
        for step in (0.01, 0.0025)
    }
    # Of order 2: a quarter of the step leaves a sixteenth of the error, less what higher orders add.
    assert error[0.0025] < error[0.01] / 8
