"""Sweep files: what they say, and one line on what is wrong with them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from sweeping import UPRIGHT, planned, written

from velodrome.scenarios.error import ScenarioError
from velodrome.scenarios.names import LIBRARY
from velodrome.scenarios.scenario.table import set_keys
from velodrome.scenarios.sweep.file import read_sweep
from velodrome.scenarios.sweep.plan import plan_sweep
from velodrome.scenarios.sweep.points import Points
from velodrome.scenarios.sweep.task import Tasks


def changes(folder: Path, text: str) -> list[dict]:
    points = Points(*read_sweep(written(folder, text)))
    return [points.at(i)[1] for i in range(len(points))]


def test_a_grid_is_every_combination_and_its_last_key_changes_fastest(tmp_path: Path) -> None:
    found = changes(tmp_path, 'scenario = "q2"\n[grid]\nsurface.alpha = [1, 2]\n"motion.rear_rate" = [3, 4]')
    values = [(point["surface.alpha"], point["motion.rear_rate"]) for point in found]
    assert values == [(1, 3), (1, 4), (2, 3), (2, 4)]


def test_rows_of_a_list_go_with_every_point_of_the_rest(tmp_path: Path) -> None:
    text = 'scenario = "q2"\ngrid.surface.alpha = [1, 2]\n'
    text += "[[list]]\nmotion.family = 1\n[[list]]\nmotion = { family = 2, near = { lean = 1, steer = 2 } }"
    found = changes(tmp_path, text)
    assert found[0] == {"motion.family": 1, "surface.alpha": 1}
    assert found[3] == {"motion.family": 2, "motion.near.lean": 1, "motion.near.steer": 2, "surface.alpha": 2}
    assert len(found) == 4


def test_a_latin_hypercube_has_one_point_in_every_slice_and_is_the_same_again(tmp_path: Path) -> None:
    text = 'scenario = "q2"\n[latin_hypercube]\ncount = 20\nseed = 5\n'
    text += "ranges.surface.alpha = [2.0, 4.0]\nranges.motion.rear_rate = [-1, 1]"
    found = changes(tmp_path, text)
    for key, low, high in (("surface.alpha", 2.0, 4.0), ("motion.rear_rate", -1.0, 1.0)):
        share = [(point[key] - low) / (high - low) for point in found]
        assert sorted(np.floor(np.array(share) * 20)) == list(range(20))
    assert changes(tmp_path, text) == found


def test_changes_leave_what_they_are_made_of_alone() -> None:
    data = {"a": {"b": 1}}
    assert set_keys(data, {"a.c": 2, "d.e": 3}) == {"a": {"b": 1, "c": 2}, "d": {"e": 3}}
    assert data == {"a": {"b": 1}}


def test_settings_of_an_engine_multiply_its_own_runs_only(tmp_path: Path) -> None:
    text = 'engines = ["reference", "exudyn"]\n' + UPRIGHT + '"engines.exudyn.step" = [0.01, 0.005]\n'
    plan = planned(tmp_path, text + "perturbation.lean_rate = [0.0, 0.1, 0.2]")
    count = {engine: sum(task.engine == engine for task in plan.tasks) for engine in ("reference", "exudyn")}
    assert count == {"reference": 3, "exudyn": 6}
    assert [task.index for task in plan.tasks] == list(range(9))
    assert len({task.key for task in plan.tasks}) == 9
    assert all("engines.exudyn.step" not in task.changes for task in plan.tasks if task.engine == "reference")


def test_runs_that_come_out_the_same_are_one_task(tmp_path: Path) -> None:
    assert len(planned(tmp_path, UPRIGHT + "motion.speed = [5, 5.0, 4.6]").tasks) == 2


def test_a_scenario_may_stand_in_the_file_or_beside_it(tmp_path: Path) -> None:
    tables = 'surface = { kind = "plane" }\nmotion = { kind = "upright", speed = 5.0 }\nsimulation = { duration = 1.0 }'
    (tmp_path / "base.toml").write_text(f'title = "x"\n{tables}')
    inside = planned(tmp_path, f'[scenario]\ntitle = "x"\n{tables}')
    beside = planned(tmp_path, 'scenario = "base.toml"')
    assert list(inside.tasks) == list(beside.tasks)


def test_a_drawn_value_out_of_its_range_refuses_its_point_only(tmp_path: Path) -> None:
    text = 'scenario = "iftomm-1"\n[latin_hypercube]\ncount = 10\nseed = 3\nranges.motion.speed = [-5.0, 5.0]\n'
    text += "[grid]\nsimulation.duration = [0.1]"
    tasks = planned(tmp_path, text).tasks
    assert len(tasks) == 10
    for task in tasks:
        row, _ = Tasks(read_sweep(tmp_path / "small.toml")[1]).do(task.engine, task.changes)
        assert (row["status"] != "refused") == (task.changes["motion.speed"] > 0)
        assert row["status"] != "refused" or row["reason"].startswith("motion.speed: ")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("scenario = 'q2'\ngrid = 3", "grid: must be a table"),
        ("scenario = 'q2'\n[grid]\nsurface.alpha = []", "surface.alpha"),
        ("scenario = 'q2'\n[grid]\nsurface.alpha = 0.1", "surface.alpha"),
        ("scenario = 'q2'\n[grid]\nsurface.alfa = [0.1]", "unknown key 'alfa'"),
        ("scenario = 'q2'\n[grid]\nsurface.alpha = [0.1, -1]", "at surface.alpha = -1"),
        ("scenario = 'q2'\n[grid]\nsurface.alpha = ['x']", "valid number"),
        ("scenario = 'q2'\n[grid]\ntitle.x = [1]", "title is no table"),
        ("scenario = 'q2'\n[grid]\nbicycle.wheels = [1]", "'wheels' is unknown"),
        ("scenario = 'q2'\n[grid]\nengines.exudyn.step = [0.01]", "'exudyn' is not among the sweep's engines"),
        (
            "scenario = 'q2'\nengines = ['reference']\n[grid]\nengines.exudyn.step = [0.01]",
            "'exudyn' is not among the sweep's engines (there are reference)",
        ),
        ("scenario = 'q2'\nengines = 3", "engines: must be a list of texts (it is 3)"),
        ("scenario = 'q2'\n[grid]\nsurface.alpha = []", "surface.alpha: must have at least 1 item (it is [])"),
        ("scenario = 'q2'\n[grid]\nsurface.alpha = 0.1", "surface.alpha: must be a list (it is 0.1)"),
        ("scenario = 'q2'\nengines = ['adams']", "engine 'adams' is not installed"),
        ("scenario = 'q2'\nengines = ['reference', 'reference']", "each engine once"),
        ("scenario = 'q2'\nengines = []", "engines: must have at least 1 item (it is [])"),
        ("scenario = 'q2'\n[grid]\nengines.reference.tolerance = [7]", "engines.reference.tolerance"),
        ("scenario = 'q2'\nengines = ['exudyn']\n[grid]\nengines.exudyn.step = [0.003]", "engines.exudyn"),
        ("scenario = 'q3'", "no scenario 'q3'"),
        ("scenario = 'none.toml'", "cannot be read"),
        ("grid.surface.alpha = [1]", "scenario: is missing"),
        ("scenario = 'q2'\nworkers = 3", "unknown key 'workers'"),
        ("scenario = 'q2'\ntime_limit = 0", "time_limit"),
        ("scenario = 'q2'\n[latin_hypercube]\ncount = 0\nseed = 1\nranges.surface.alpha = [0, 1]", "count"),
        ("scenario = 'q2'\n[latin_hypercube]\ncount = 3\nseed = 1\nranges.surface.alpha = [1, 1]", "low < high"),
        ("scenario = 'q2'\n[latin_hypercube]\ncount = 3\nseed = 1\nranges.surface.alpha = [1, inf]", "finite"),
        ("scenario = 'q2'\ngrid.surface.alpha = [1]\n[[list]]\nsurface.alpha = 2", "is changed by"),
        ("scenario = 'q2'\ngrid.motion.near = [{lean=1,steer=1}]\n[[list]]\nmotion.near.lean = 2", "is changed by"),
        ("scenario = 'q2'\nlist = 3", "list"),
        # Every point is refused, or every point of an engine.
        ("scenario = 'q2'\ngrid.simulation.duration = [0.0015]", "no whole number of output intervals"),
        (
            "scenario = 'iftomm-1'\nengines = ['reference', 'exudyn']\n[grid]\nengines.exudyn.step = [0.003]",
            "engines.exudyn",
        ),
        # A wrong name or type is the file's, though other rows are right; so is a drawn whole number.
        ("scenario = 'q2'\n[[list]]\nsurface.alpha = 0.1\n[[list]]\nsurface.alfa = 0.1", "unknown key 'alfa'"),
        ("scenario = 'q2'\n[[list]]\nbicycle.trail = 0.1\n[[list]]\nbicycle.tral = 0.1", "'tral' is unknown"),
        ("scenario = 'q2'\n[[list]]\nsurface.alpha = 0.1\n[[list]]\nsurface.alpha = 'x'", "valid number"),
        ("scenario = 'q2'\n[latin_hypercube]\ncount = 3\nseed = 1\nranges.motion.family = [1, 4]", "motion.family"),
        ("scenario = 'q2'\n[latin_hypercube]\ncount = 3\nseed = 1\nranges.motion.rear_ratte = [1, 4]", "rear_ratte"),
        ("scenario = ", "not valid TOML"),
        ("scenario = 'q2'\n[latin_hypercube]\ncount=999999999\nseed=1\nranges.surface.alpha=[0, 1]", "at most"),
    ],
)
def test_bad_files_are_told_in_one_line_with_their_name(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(ScenarioError, match=r"small\.toml") as error:
        plan_sweep(written(tmp_path, text))
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_everything_wrong_with_a_sweep_file_is_said_at_once(tmp_path: Path) -> None:
    text = """
    time_limt = 3.0
    memory_limit = 0.1
    [scenario]
    titel = "x"
    surface = { kind = "plain" }
    motion = { kind = "upright", speed = 4.0 }
    simulation = { duration = 0.1 }
    [scenario.engines.exudyn]
    stepp = 1
    """
    with pytest.raises(ScenarioError) as caught:
        plan_sweep(written(tmp_path, text))
    line = str(caught.value)
    for words in (
        "unknown key 'time_limt' (did you mean 'time_limit'?)",
        "memory_limit: Input should be greater",
        "scenario: its tables: unknown key 'titel' (did you mean 'title'?)",
        "surface.kind: unknown kind 'plain' (did you mean 'plane'?)",
        "engines.exudyn: unknown key 'stepp' (did you mean 'step'?)",
    ):
        assert words in line
    assert line.count("; ") == 4


def test_everything_wrong_with_the_points_of_a_sweep_is_said_at_once(tmp_path: Path) -> None:
    text = """
    scenario = "q2"
    engines = ["exudyn", "mujocu-native"]
    [grid]
    surface.alfa = [0.1, 0.2]
    motion.rear_rate = [18.0, -1.0]
    engines.exudyn.stepp = [1]
    engines.exudn.step = [0.001]
    """
    with pytest.raises(ScenarioError) as caught:
        plan_sweep(written(tmp_path, text))
    line = str(caught.value)
    for words in (
        "engine 'mujocu-native' is not installed (did you mean 'mujoco-native'?)",
        "engines.exudn.step: 'exudn' is not among the sweep's engines (did you mean 'exudyn'?)",
        "surface: unknown key 'alfa' (did you mean 'alpha'?)",
        "motion.rear_rate: Input should be greater than 0 (it is -1.0)",
        "engines.exudyn: unknown key 'stepp' (did you mean 'step'?)",
    ):
        # Each once, though it is of many points.
        assert line.count(words) == 1
    assert line.count("; ") == 4


def test_settings_of_an_engine_that_a_sweep_does_not_ride_are_checked(tmp_path: Path) -> None:
    base = (LIBRARY / "q2.toml").read_text(encoding="utf-8") + "[engines.mujoco-native]\nstepp = 1\n"
    (tmp_path / "base.toml").write_text(base)
    with pytest.raises(ScenarioError, match=r"scenario: engines\.mujoco-native: unknown key 'stepp'"):
        plan_sweep(written(tmp_path, "scenario = 'base.toml'"))
