"""Runs of a sweep by number: what they are made of, and what their number costs."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2, qmc
from sweeping import planned, written

from velodrome.scenarios.sweep.file import Hypercube, read_sweep
from velodrome.scenarios.sweep.hypercube import LARGEST_TABLE, draw_sample, permute_index
from velodrome.scenarios.sweep.plan import plan_sweep
from velodrome.scenarios.sweep.selection import SelectedTasks

MANY = """
scenario = "iftomm-1"
engines = ["reference", "mujoco-native"]
[grid]
motion.speed = {speeds}
engines.mujoco-native.step = [0.002, 0.001, 0.0005]
[latin_hypercube]
count = {count}
seed = 7
ranges.perturbation.lean_rate = [-0.1, 0.1]
ranges.bicycle.trail = [0.07, 0.09]
"""


def many(folder: Path, count: int, speeds: int = 10) -> Path:
    values = np.linspace(4.4, 5.8, speeds).tolist()
    return written(folder, MANY.format(count=count, speeds=values), f"many-{count}")


def test_every_combination_is_one_run_and_engines_at_a_point_are_neighbours(tmp_path: Path) -> None:
    text = """
    scenario = "iftomm-1"
    engines = ["reference", "exudyn", "mujoco-native"]
    [[list]]
    motion.speed = 5.0
    engines.exudyn.step = 0.01
    [[list]]
    motion.speed = 5
    engines.exudyn.step = 0.005
    [[list]]
    motion.speed = 4.6
    [grid]
    perturbation.lean_rate = [0.0, 0.1]
    engines.mujoco-native.step = [0.002, 0.001]
    engines.reference.tolerance = [1e-12, 1e-13]
    """
    found = [(task.engine, task.changes) for task in planned(tmp_path, text).tasks]
    shared = list(product((5.0, 4.6), (0.0, 0.1), (1e-12, 1e-13)))
    keys = ("motion.speed", "perturbation.lean_rate", "engines.reference.tolerance")
    expected = []
    for values in shared:
        point = dict(zip(keys, values, strict=True))
        steps = (0.01, 0.005) if point["motion.speed"] == 5.0 else (None,)
        expected.append(("reference", point))
        expected += [("exudyn", point if s is None else point | {"engines.exudyn.step": s}) for s in steps]
        expected += [("mujoco-native", point | {"engines.mujoco-native.step": s}) for s in (0.002, 0.001)]
    assert found == expected


def test_a_cube_of_one_engines_settings_does_not_multiply_the_others(tmp_path: Path) -> None:
    text = 'scenario = "iftomm-1"\nengines = ["reference", "mujoco-native"]\n[latin_hypercube]\ncount = 6\nseed = 1\n'
    tasks = planned(tmp_path, text + "ranges.engines.mujoco-native.impratio = [1.0, 9.0]").tasks
    assert [task.engine for task in tasks] == ["reference"] + ["mujoco-native"] * 6
    assert len({task.changes["engines.mujoco-native.impratio"] for task in list(tasks)[1:]}) == 6


def test_keys_of_tasks_are_in_their_order_and_differ_between_bases(tmp_path: Path) -> None:
    tasks, others = (
        planned(tmp_path, f"scenario = '{name}'\ngrid.bicycle.trail = [0.07, 0.08]").tasks for name in ("q2", "q2-plus")
    )
    keys = [task.key for task in tasks]
    assert keys == sorted(keys)
    assert not {*keys} & {task.key for task in others}


def test_small_cubes_are_those_of_scipy() -> None:
    cube = Hypercube(count=50, seed=11, ranges={"a": (0.0, 1.0), "b": (-2.0, 2.0)})
    unit = qmc.LatinHypercube(2, rng=11).random(50)
    low, high = np.array([0.0, -2.0]), np.array([1.0, 2.0])
    found = np.array([list(draw_sample(cube, i).values()) for i in range(50)])
    assert np.array_equal(found, low + (high - low) * unit)


@pytest.mark.parametrize("count", [1, 2, 3, 17, 64, 1000, 1025])
def test_a_keyed_permutation_has_every_index_once(count: int) -> None:
    orders = [[permute_index(i, count, key) for i in range(count)] for key in (1, 2)]
    assert all(sorted(order) == list(range(count)) for order in orders)
    assert count < 17 or orders[0] != orders[1]


def test_a_keyed_permutation_spreads_neighbours_evenly() -> None:
    # Pairs of neighbours' images in 8 x 8 boxes of equal size: uniform to chi-squared's quantile of one in a million.
    count, boxes = 8192, 8
    images = np.array([permute_index(i, count, 5) for i in range(count)]) * boxes // count
    table = np.zeros((boxes, boxes))
    np.add.at(table, (images[::2], images[1::2]), 1)
    expected = table.sum() / boxes**2
    assert ((table - expected) ** 2 / expected).sum() < chi2.ppf(1 - 1e-6, boxes**2 - 1)


def test_points_of_a_large_cube_lie_in_their_slices() -> None:
    count = LARGEST_TABLE + 1
    cube = Hypercube(count=count, seed=3, ranges={"a": (0.0, 1.0), "b": (0.0, 1.0)})
    points = [draw_sample(cube, i) for i in range(0, count, 1009)]
    for key in ("a", "b"):
        slices = {int(point[key] * count) for point in points}
        assert len(slices) == len(points)
    assert [point["a"] for point in points] != [point["b"] for point in points]


def test_ten_million_runs_are_planned_in_the_time_of_ten_thousand(tmp_path: Path) -> None:
    small, large = many(tmp_path, 250), many(tmp_path, 250_000)
    plan_sweep(small)  # loads the engines
    times = []
    for path in (small, large):
        begin = time.process_time()
        plan = plan_sweep(path)
        plan.facts()
        times.append(time.process_time() - begin)
    assert len(plan.tasks) == 10_000_000
    assert times[1] < 2.0
    (last,) = plan.tasks[-1:]
    assert (last.index, last.engine, last.changes["motion.speed"]) == (9_999_999, "mujoco-native", 5.8)
    json.dumps(last.changes, allow_nan=False)


PEAK = """
import resource, sys
from pathlib import Path
from velodrome.scenarios.sweep.plan import plan_sweep
plan = plan_sweep(Path(sys.argv[1]))
plan.facts()
print(len(plan.tasks), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


def test_planning_takes_no_more_memory_for_a_thousand_times_as_many_runs(tmp_path: Path) -> None:
    found = []
    for count in (250, 250_000):
        command = [sys.executable, "-c", PEAK, str(many(tmp_path, count))]
        runs, peak = map(int, subprocess.run(command, capture_output=True, text=True, check=True).stdout.split())
        found.append((runs, peak))
    (few, least), (lots, most) = found
    assert (few, lots) == (10_000, 10_000_000)
    # kB. One bit a run would be 1250 kB; two runs of equal size differ by a few hundred.
    assert most - least < 1250


def test_selected_tasks_are_those_chosen_in_order(tmp_path: Path) -> None:
    tasks = plan_sweep(many(tmp_path, 3, 2)).tasks
    for chosen in ([0, 1, 5, 6, 7, 20], [23], [], list(range(24))):
        mask = np.zeros(len(tasks), bool)
        mask[chosen] = True
        selected = SelectedTasks(tasks, mask)
        assert [task.index for task in selected] == chosen
        assert [task.index for task in reversed(selected)] == chosen[::-1]


def test_a_wrong_value_of_a_large_sweep_is_found_without_trying_every_run(tmp_path: Path) -> None:
    path = many(tmp_path, 250_000)
    good = path.read_text()
    for wrong, said in (
        ("5.8]", "'x']"),
        ("0.0005]", "-0.0005]"),
        ("bicycle.trail", "bicycle.tral"),
    ):
        path.write_text(good.replace(wrong, said))
        assert path.read_text() != good
        with pytest.raises(ValueError, match="many-250000") as error:
            plan_sweep(path)
        assert "\n" not in str(error.value)
    assert read_sweep(written(tmp_path, good))[0].latin_hypercube is not None
