"""Scenario files: the library loads, and whatever is wrong with a file is said in one line."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from hypothesis import given
from hypothesis import strategies as st

from tests.literature import published, rounds_to
from velodrome.reference.contact import observe
from velodrome.reference.kinematics import LEAN, REAR_ANGLE, STEER
from velodrome.scenarios.error import ScenarioError
from velodrome.scenarios.scenario.schema import Scenario, library_names, load_scenario, validate_scenario
from velodrome.scenarios.scenario.start import make_start

GOOD = """
title = "A ride"
[surface]
kind = "paraboloid"
alpha = 0.005
[motion]
rear_rate = 18.0
family = 2
[simulation]
duration = 0.1
output_rate = 100.0
"""


def data(**changes: Any) -> dict[str, Any]:
    """The good scenario with dotted keys (double underscore for the dot) changed; None removes."""
    tables: dict[str, Any] = tomllib.loads(GOOD)
    for key, value in changes.items():
        *path, last = key.split("__")
        table = tables
        for name in path:
            table = table.setdefault(name, {})
        if value is None:
            del table[last]
        else:
            table[last] = value
    return tables


def complaint(tables: dict[str, Any]) -> str:
    with pytest.raises(ScenarioError) as caught:
        make_start(validate_scenario(tables, "a.toml"))
    line = str(caught.value)
    assert "\n" not in line
    return line


@pytest.mark.parametrize("name", library_names())
def test_every_library_scenario_starts_on_its_constraints(name: str) -> None:
    found, scenario = load_scenario(name)
    assert found == name
    start = make_start(scenario)
    problem = start.problem
    seen = observe(problem.bicycle, problem.surface, problem.q[None], problem.qd[None])
    # Solved to round-off of lengths below 10 m and speeds below 10 m/s.
    assert np.abs(seen.gap).max() < 1e-13
    assert np.abs(seen.slip).max() < 1e-12
    simulation = scenario.simulation
    assert problem.times[0] == 0
    assert problem.times[-1] == simulation.duration
    assert len(problem.times) == simulation.duration * simulation.output_rate + 1


@pytest.mark.parametrize("name", ["p1", "p2", "p3", "p4"])
def test_the_papers_points_are_the_librarys(name: str) -> None:
    point, start = published("xiong2020")[name.upper()], make_start(load_scenario(name)[1])
    assert start.family == point["family"]
    assert start.motion is not None
    for field in ("lean", "steer", "front_rate"):
        assert rounds_to(getattr(start.motion, field), point[field]), field


def test_a_perturbation_moves_what_it_names_and_solves_the_rest() -> None:
    plain = make_start(validate_scenario(data(), "a.toml")).problem
    changes = {"x": 0.01, "y": -0.02, "lean": 0.03, "steer": -0.04, "lean_rate": 0.1, "steer_rate": 0.2, "rear_rate": 1}
    moved = make_start(validate_scenario(data(perturbation=changes), "a.toml")).problem
    assert moved.q[[0, 1, LEAN, STEER]] - plain.q[[0, 1, LEAN, STEER]] == pytest.approx([0.01, -0.02, 0.03, -0.04])
    assert moved.qd[[LEAN, STEER, REAR_ANGLE]] - plain.qd[[LEAN, STEER, REAR_ANGLE]] == pytest.approx([0.1, 0.2, 1.0])
    seen = observe(moved.bicycle, moved.surface, moved.q[None], moved.qd[None])
    assert np.abs(seen.gap).max() < 1e-13
    assert np.abs(seen.slip).max() < 1e-12


def test_an_override_reaches_the_bicycle() -> None:
    scenario = validate_scenario(data(bicycle={"rear_frame_mass": 80, "trail": 0.06}), "a.toml")
    bicycle = scenario.make_bicycle()
    assert (bicycle.rear_frame_mass, bicycle.trail, bicycle.wheelbase) == (80.0, 0.06, 1.02)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        # Tables and keys.
        ({"surface": None}, ["surface", "missing"]),
        ({"motion": None}, ["motion", "missing"]),
        ({"simulation": None}, ["simulation", "missing"]),
        ({"title": None}, ["title", "missing"]),
        ({"surface": "plane"}, ["surface", "table"]),
        ({"engines": 3}, ["engines", "table"]),
        ({"wind": {"speed": 1.0}}, ["'wind'", "surface, motion"]),
        ({"surface__beta": 1.0}, ["surface", "'beta'", "alpha"]),
        ({"surface__alpha": None}, ["surface.alpha", "missing"]),
        ({"surface__kind": None}, ["surface", "kind is missing"]),
        ({"surface__kind": "cube"}, ["surface", "'cube'", "plane"]),
        ({"motion__kind": "flying"}, ["motion", "'flying'", "upright"]),
        ({"motion__speed": 4.0}, ["motion", "'speed'", "rear_rate"]),
        ({"perturbation__yaw": 0.1}, ["perturbation", "'yaw'", "lean_rate"]),
        ({"criterion__slip": 0.1}, ["criterion", "'slip'", "energy_variation"]),
        # Titles and tags.
        ({"title": ""}, ["title", "one line"]),
        ({"title": " \t"}, ["title", "one line"]),
        ({"title": "a\nb"}, ["title", "one line"]),
        ({"title": 3}, ["title", "string"]),
        ({"tags": "paper"}, ["tags", "'paper'"]),
        ({"tags": [1]}, ["tags", "string"]),
        # Numbers that are none, or out of range.
        ({"surface__alpha": float("nan")}, ["surface.alpha", "finite"]),
        ({"surface__alpha": float("inf")}, ["surface.alpha", "finite"]),
        ({"surface__alpha": -0.1}, ["surface.alpha", "-0.1"]),
        ({"surface__alpha": True}, ["surface.alpha", "number"]),
        ({"surface__alpha": "0.005"}, ["surface.alpha", "number"]),
        ({"motion__rear_rate": 0.0}, ["motion.rear_rate", "0.0"]),
        ({"motion__rear_rate": -18.0}, ["motion.rear_rate", "-18.0"]),
        ({"motion__rear_rate": 1e300}, ["motion.rear_rate", "1e+300"]),
        ({"motion__rear_rate": True}, ["motion.rear_rate", "True"]),
        ({"motion__family": 5}, ["motion.family", "5"]),
        ({"motion__family": True}, ["motion.family", "True"]),
        ({"motion__family": 2.0}, ["motion.family", "2.0"]),
        ({"motion__family": None}, ["motion", "family", "near"]),
        ({"motion__near": [0.74, 2.84]}, ["motion.near", "table"]),
        ({"motion__near": {"lean": 0.74}}, ["motion.near.steer", "missing"]),
        ({"motion": {"kind": "upright", "speed": 0.0}}, ["motion.speed", "0.0"]),
        ({"perturbation__lean": 1e300}, ["perturbation.lean", "1e+300"]),
        ({"criterion__energy_variation": 0.0}, ["criterion.energy_variation", "0.0"]),
        # Samples.
        ({"simulation__duration": 0.0}, ["simulation.duration", "0.0"]),
        ({"simulation__duration": float("nan")}, ["simulation.duration", "finite"]),
        ({"simulation__duration": 0.105}, ["0.105", "whole number", "0.01 s"]),
        ({"simulation__duration": 0.001}, ["0.001", "whole number"]),
        ({"simulation__output_rate": 33.3}, ["simulation", "whole number"]),
        ({"simulation__duration": 1e5}, ["samples", "5e6"]),
        # Bicycles.
        ({"bicycle__wheels": 3.0}, ["'wheels'", "wheelbase"]),
        ({"bicycle__rear_frame_mass": -1.0}, ["rear_frame_mass", "-1.0", "not be negative"]),
        ({"bicycle__rear_frame_mass": True}, ["bicycle.rear_frame_mass", "number"]),
        ({"bicycle__rear_frame_mass": 1e300}, ["bicycle.rear_frame_mass", "1e+300"]),
        ({"bicycle__front_wheel_Iyy": 0.3}, ["front_wheel_I", "rigid body"]),
        # Motions that there are not.
        ({"motion__rear_rate": 500.0}, ["no circular motion", "500.0", "family 2"]),
        ({"surface__alpha": 1e6}, ["no circular motion", "alpha=1000000.0"]),
        ({"bicycle__rear_wheel_radius": 1e-9}, ["no circular motion", "its anchor ends in a fold"]),
        ({"perturbation__lean": 3.0}, ["lean = 3.73", "below the ground"]),
        ({"perturbation__x": 1e5}, ["cannot touch the ground", "x = 100000.9"]),
    ],
    ids=repr,
)
def test_what_is_wrong_is_said_where_it_is(changes: dict[str, Any], words: list[str]) -> None:
    line = complaint(data(**changes))
    for word in words:
        assert word in line
    assert "np.float64" not in line


def test_all_faults_are_said() -> None:
    missing = [f"{name}: is missing" for name in ("title", "surface", "motion", "simulation")]
    assert complaint({}) == f"a.toml: {'; '.join(missing)}"


def test_of_very_many_faults_twenty_are_said_and_the_rest_counted() -> None:
    line = complaint(data(tags=list(range(30))))
    assert line.count("; ") == 20
    assert line.endswith("; and 10 more")


NEWCOMER = [
    "unknown key 'simulaton' (did you mean 'simulation'?)",
    "surface.kind: unknown kind 'parabola' (did you mean 'paraboloid'?)",
    "motion.rear_rate: Input should be a valid number (it is '18')",
    "perturbation.lean_rate: Input should be less than or equal to 1000000 (it is 10000000.0)",
    "engines.mujoco-native: unknown key 'stepp' (did you mean 'step'?)",
]


def test_a_newcomer_is_told_five_mistakes_at_once() -> None:
    path = Path(__file__).parents[2] / "cases" / "newcomer.toml"
    with pytest.raises(ScenarioError) as caught:
        load_scenario(str(path))
    assert str(caught.value) == f"{path}: {'; '.join(NEWCOMER)}"


def test_what_a_misspelt_table_holds_is_checked_too() -> None:
    tables = data()
    tables["simulaton"] = tables.pop("simulation") | {"duration": -1.0}
    line = complaint(tables)
    assert "'simulaton' (did you mean 'simulation'?); simulation.duration: " in line
    # It is not missing besides.
    assert "missing" not in line


def test_all_parameters_that_no_bicycle_has_are_said() -> None:
    line = complaint(data(bicycle={"trial": 0.1, "wheelbase": -1.0, "gravity": 0.0}))
    for words in ("'trial' is unknown (did you mean 'trail'?)", "wheelbase is -1.0", "gravity is 0.0"):
        assert words in line


def test_all_changes_are_checked_at_once() -> None:
    with pytest.raises(ScenarioError) as caught:
        load_scenario("q2", {"title.x": 1, "surface.alpa": 2, "tags.y.z": 3})
    assert str(caught.value) == (
        "changes: title.x: title is no table; changes: tags.y.z: tags is no table; "
        "q2: surface: unknown key 'alpa' (did you mean 'alpha'?)"
    )


@pytest.mark.parametrize(("source", "meant"), [("q2-pluss", "q2-plus"), ("Sphere", "sphere"), ("planecircle", "plane")])
def test_a_scenario_that_is_meant_is_named(source: str, meant: str) -> None:
    with pytest.raises(ScenarioError, match=f"did you mean '{meant}"):
        load_scenario(source)


@given(
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
        lambda inner: st.lists(inner, max_size=2) | st.dictionaries(st.text(max_size=5), inner, max_size=2),
        max_leaves=5,
    ),
    st.sampled_from([key for key in Scenario.model_fields if key != "title"]),
)
def test_any_value_anywhere_is_taken_or_refused_in_one_line(value: Any, key: str) -> None:
    refusal, scenario = "a.toml: ", None
    try:
        scenario = validate_scenario(data() | {key: value}, "a.toml")
    except ScenarioError as error:
        refusal = str(error)
    assert refusal.startswith("a.toml: ")
    assert "\n" not in refusal
    # Only what has a default can be anything: an empty table, or nothing where that may be left out.
    assert scenario is None or key in ("tags", "perturbation", "gate", "criterion", "bicycle", "inputs", "engines")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"this is = = no TOML", "not valid TOML"),
        (bytes(range(256)), "not UTF-8"),
        (None, "No such file"),
    ],
)
def test_a_file_that_is_none_is_refused(content: bytes | None, words: str, tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(ScenarioError, match=words) as caught:
        load_scenario(str(path))
    assert str(caught.value).startswith(f"{path}: ")


def test_a_folder_is_no_scenario(tmp_path: Path) -> None:
    folder = tmp_path / "a.toml"
    folder.mkdir()
    with pytest.raises(ScenarioError, match="cannot be read"):
        load_scenario(str(folder))
    with pytest.raises(ScenarioError, match="q2-plus"):
        load_scenario(str(tmp_path))


def test_a_file_goes_by_its_stem_and_survives_a_round_trip(tmp_path: Path) -> None:
    path = tmp_path / "my-ride.toml"
    path.write_text(GOOD)
    name, scenario = load_scenario(str(path), {"perturbation.lean_rate": 0.1, "engines.exudyn.step": 0.002})
    assert name == "my-ride"
    assert scenario.perturbation.lean_rate == 0.1
    assert scenario.engines == {"exudyn": {"step": 0.002}}
    path.write_text(tomli_w.dumps(scenario.model_dump(exclude_none=True)))
    assert load_scenario(str(path))[1] == scenario


@pytest.mark.parametrize("key", ["title.x", "simulation.duration.x"])
def test_a_change_inside_a_value_is_refused(key: str) -> None:
    with pytest.raises(ScenarioError, match="is no table"):
        load_scenario("q2", {key: 1})
