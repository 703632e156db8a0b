"""Rows of a sweep against rides of their own: equal bits pass, and an altered bit and a lost row do not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest

from benchmarks.sample_rides import compare
from velodrome.scenarios.sweep.plan import SweepPlan, plan_sweep
from velodrome.scenarios.sweep.run import locally, run_sweep
from velodrome.scenarios.sweep.store import part_of

TEXT = """
scenario = "iftomm-1"
engines = ["reference", "mujoco-multipliers"]
time_limit = 60.0
[grid]
simulation.duration = [0.2]
simulation.output_rate = [20.0]
"engines.mujoco-multipliers.step" = [0.01]
perturbation.lean_rate = [0.0, 0.1]
"""


@pytest.fixture(scope="module")
def sweep(tmp_path_factory: pytest.TempPathFactory) -> tuple[SweepPlan, Path]:
    folder = tmp_path_factory.mktemp("sweep")
    (folder / "small.toml").write_text(TEXT)
    plan = plan_sweep(folder / "small.toml")
    outcome = run_sweep(plan, folder / "out", locally(1), False, lambda _: None)
    assert outcome.missing == 0
    return plan, folder / "out"


def test_rows_have_the_bits_of_rides_of_their_own(sweep: tuple[SweepPlan, Path]) -> None:
    assert compare(*sweep, count=4, seed=0) == []


def test_an_altered_bit_and_a_lost_row_are_told(sweep: tuple[SweepPlan, Path]) -> None:
    plan, out = sweep
    path = part_of(out, "mujoco-multipliers")
    table = pq.ParquetFile(path).read()
    drift = table.column("energy_drift").to_numpy().copy()
    drift[1] = np.nextafter(drift[1], 1.0)
    altered = table.set_column(table.column_names.index("energy_drift"), "energy_drift", pa.array(drift))
    try:
        pq.write_table(altered, path)
        (fault,) = compare(plan, out, count=4, seed=0)
        assert "energy_drift" in fault
        pq.write_table(table.filter(pc.field("index") != table.column("index")[0].as_py()), path)
        (fault,) = compare(plan, out, count=4, seed=0)
        assert "has no computed row" in fault
    finally:
        pq.write_table(table, path)
