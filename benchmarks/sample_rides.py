"""Hold rows of a finished sweep against rides of their own.

python benchmarks/sample_rides.py SWEEP.toml FOLDER --rows 1000

Rows are drawn at random. Each of their runs is planned, ridden and measured by itself, as `velodrome run` does it, and
every metric must have the same bits as in the data set.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq

from velodrome.engines.admission import ride_engine
from velodrome.engines.engine import REFERENCE
from velodrome.reports.measure import flatten_metrics
from velodrome.scenarios.error import ScenarioError
from velodrome.scenarios.run.runner import claimed_noise, measure_one, plan_run
from velodrome.scenarios.scenario.template import ScenarioTemplate
from velodrome.scenarios.sweep.plan import SweepPlan, Task, plan_sweep
from velodrome.scenarios.sweep.rows import COMPUTED, METRICS
from velodrome.scenarios.sweep.store import RESULTS


def ride_alone(plan: SweepPlan, task: Task) -> dict[str, Any]:
    """Plan, ride and measure one run; return its metrics, or its status where there is no motion to start from."""
    scenario = ScenarioTemplate(plan.base, task.key, lambda data: data).apply(task.changes)
    try:
        run = plan_run(task.key, scenario, wanted=[] if task.engine == REFERENCE else [task.engine])
    except ScenarioError:
        return {"status": "no-motion"}
    rides = {
        name: ride_engine(engine, run.start.problem, settings, lambda _: None)
        for name, (engine, settings) in run.engines.items()
        if name in (task.engine, REFERENCE)
    }
    reference = None if task.engine == REFERENCE else rides[REFERENCE]
    noise = claimed_noise(*run.engines[task.engine])
    found = flatten_metrics(measure_one(run.start, rides[task.engine], reference, step_noise=noise))
    found |= {"family": run.start.family, "growth_rate": run.start.growth_rate, "size": run.start.size}
    return {name: value for name, value in found.items() if name in METRICS}


def read_rows(folder: Path, indices: np.ndarray) -> dict[int, dict[str, Any]]:
    """Return rows of a data set by the index of their task."""
    found = pq.read_table(folder / RESULTS, filters=[("index", "in", indices.tolist())])
    return {row["index"]: row for row in found.to_pylist()}


def compare(plan: SweepPlan, folder: Path, count: int, seed: int) -> list[str]:
    """Return a line for each drawn row that differs from a ride of its own."""
    indices = np.sort(np.random.default_rng(seed).choice(len(plan.tasks), min(count, len(plan.tasks)), replace=False))
    stored, faults = read_rows(folder, indices), []
    for number, index in enumerate(indices.tolist()):
        task, row = plan.tasks[index], stored.get(index)
        if row is None or row["key"] != task.key or row["status"] not in COMPUTED:
            faults.append(f"{task.key}: has no computed row")
            continue
        alone = ride_alone(plan, task)
        differing = [name for name, value in alone.items() if row[name] != value]
        faults += [f"{task.key}: {name} is {row[name]!r}, alone {alone[name]!r}" for name in differing]
        if (number + 1) % 100 == 0:
            print(f"{number + 1} of {len(indices)} rows, {len(faults)} differences", file=sys.stderr)
    return faults


def main() -> None:
    """Compare and print; end with 1 if a row differs."""
    parser = argparse.ArgumentParser(description="Hold rows of a finished sweep against rides of their own.")
    parser.add_argument("sweep", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--rows", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    faults = compare(plan_sweep(options.sweep), options.folder, options.rows, options.seed)
    print("\n".join(faults) or f"all of {options.rows} rows have the bits of rides of their own")
    sys.exit(bool(faults))


if __name__ == "__main__":
    main()
