"""Bicycles that a scenario takes from a file."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path

import pytest

from velodrome.reference.bicycle import Bicycle
from velodrome.scenarios.error import ScenarioError
from velodrome.scenarios.scenario import find_bicycle, load_scenario
from velodrome.scenarios.sweep.file import read_sweep

SKATE = Path(__file__).parents[2] / "cases" / "tms-exact.toml"
SCENARIO = """
title = "Straight"
surface = { kind = "plane" }
motion = { kind = "upright", speed = 5.0 }
simulation = { duration = 0.1 }
"""
# Meijaard's symbols, z down.
BENCHMARK_TEXT = """
w = 1.02
c = 0.08+/-0.001
lam = 0.3141592653589793
g = 9.81
rR = 0.3
mR = 2
IRxx = 0.0603
IRyy = 0.12
xB = 0.3
zB = -0.9
mB = 85
IBxx = 9.2
IByy = 11
IBzz = 2.8
IBxz = 2.4
xH = 0.9
zH = -0.7
mH = 4
IHxx = 0.05892
IHyy = 0.06
IHzz = 0.00708
IHxz = -0.00756
rF = 0.35
mF = 3
IFxx = 0.1405
IFyy = 0.28
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "bicycles").mkdir()
    (tmp_path / "bicycles" / "measured.txt").write_text(BENCHMARK_TEXT.replace("zB = -0.9", "zB = -0.95"))
    return tmp_path


def write(folder: Path, bicycle: str, name: str = "ride.toml") -> str:
    path = folder / name
    path.write_text(f"{SCENARIO}[bicycle]\n{bicycle}\n")
    return str(path)


def test_a_scenario_takes_its_bicycle_from_a_file_beside_it(folder: Path) -> None:
    _, scenario = load_scenario(write(folder, 'file = "bicycles/measured.txt"\nrear_frame_mass = 70.0'))
    assert scenario.make_bicycle() == replace(Bicycle(), rear_frame_z=0.95, rear_frame_mass=70.0)
    # Every number is there, and no path that may vanish.
    assert set(scenario.bicycle) == set(asdict(Bicycle()))


def test_changes_override_the_file_and_replace_it_from_the_working_folder(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = write(folder, 'file = "bicycles/measured.txt"')
    assert load_scenario(source, {"bicycle.trail": 0.1})[1].make_bicycle() == replace(
        Bicycle(), rear_frame_z=0.95, trail=0.1
    )
    monkeypatch.chdir(folder / "bicycles")
    (folder / "bicycles" / "other.txt").write_text(BENCHMARK_TEXT)
    assert load_scenario(source, {"bicycle.file": "other.txt"})[1].make_bicycle() == Bicycle()


def test_a_given_bicycle_replaces_the_scenarios_and_is_changed(folder: Path) -> None:
    source, heavy = write(folder, "trail = 0.1"), replace(Bicycle(), rear_frame_mass=95.0)
    assert load_scenario(source, bicycle=heavy)[1].make_bicycle() == heavy
    changed = load_scenario(source, {"bicycle.trail": 0.05}, bicycle=heavy)[1].make_bicycle()
    assert changed == replace(heavy, trail=0.05)
    with pytest.raises(ScenarioError, match=r"--set bicycle\.file: the bicycle is given already"):
        load_scenario(source, {"bicycle.file": "x.txt"}, "--set", heavy)


def test_a_scenario_may_take_the_bicycle_of_another(folder: Path) -> None:
    write(folder, 'file = "bicycles/measured.txt"\ntrail = 0.07', "first.toml")
    _, scenario = load_scenario(write(folder, 'file = "first.toml"'))
    assert scenario.make_bicycle() == replace(Bicycle(), rear_frame_z=0.95, trail=0.07)
    assert find_bicycle(str(folder / "first.toml")).bicycle == scenario.make_bicycle()
    assert find_bicycle("other-bicycle").bicycle == load_scenario("other-bicycle")[1].make_bicycle()
    assert find_bicycle(str(SKATE)).bicycle.front_wheel_mass == 0.0


def test_scenarios_that_take_the_bicycle_of_one_another_are_refused(folder: Path) -> None:
    write(folder, 'file = "second.toml"', "first.toml")
    source = write(folder, 'file = "first.toml"', "second.toml")
    with pytest.raises(ScenarioError, match="its bicycle is taken from a scenario that takes it from this one"):
        load_scenario(source)


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ('file = "nowhere.txt"', "bicycle.file: .*nowhere.txt: there is no such file"),
        ("file = 5", "bicycle.file is 5; it must be the path of a bicycle file"),
        ('file = "bicycles/measured.txt"\ntrial = 0.1', "bicycle: 'trial' is unknown .*trail"),
        ('file = "nowhere.txt"\ntrial = 0.1', "nowhere.txt.*; .*'trial' is unknown"),
    ],
)
def test_a_wrong_file_is_said_in_one_line(folder: Path, table: str, said: str) -> None:
    with pytest.raises(ScenarioError, match=said) as refused:
        load_scenario(write(folder, table))
    assert "\n" not in str(refused.value)
    assert "ride.toml" in str(refused.value)


@pytest.mark.parametrize("by_path", [True, False])
def test_a_sweeps_base_scenario_takes_its_bicycle_from_a_file(folder: Path, by_path: bool) -> None:
    write(folder, 'file = "bicycles/measured.txt"')
    tables = SCENARIO.replace("\nsurface", "\n[scenario]\nsurface").replace('title = "Straight"\n', "")
    tables = tables.replace(
        "[scenario]\n", '[scenario]\ntitle = "Straight"\nbicycle = { file = "bicycles/measured.txt" }\n'
    )
    (folder / "sweep.toml").write_text('scenario = "ride.toml"\n' if by_path else tables)
    _, base = read_sweep(folder / "sweep.toml")
    assert base["bicycle"] == asdict(replace(Bicycle(), rear_frame_z=0.95))
