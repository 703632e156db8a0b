"""Rims that touch the ground twice: starts are refused, rides end alike in every engine, and nothing else does."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tests.installed import parametrise_engines
from velodrome.engines.admission import ride_engine
from velodrome.engines.engine import REFERENCE, Trajectory, UnsuitableProblem
from velodrome.engines.registry import load_engine
from velodrome.reference.simulate import simulate
from velodrome.scenarios.error import ScenarioError
from velodrome.scenarios.scenario.schema import library_names, load_scenario
from velodrome.scenarios.scenario.start import make_start

CASES = Path(__file__).parents[2] / "cases"
TOUCH = re.compile(r"^the front rim touches the ground at a second place at t = (\S+) s$")


@cache
def ridden(case: str, engine: str) -> Trajectory:
    _, scenario = load_scenario(str(CASES / f"{case}.toml"))
    problem, rider = make_start(scenario).problem, load_engine(engine)
    settings = rider.settings()
    rider.check(problem, settings)
    return ride_engine(rider, problem, settings, lambda _: None)


@pytest.mark.parametrize("engine", parametrise_engines(without=[REFERENCE]))
@pytest.mark.parametrize("case", ["hollow", "curb"])
def test_every_engine_ends_where_the_reference_does(case: str, engine: str) -> None:
    exact = ridden(case, REFERENCE)
    assert exact.ended is not None
    told = TOUCH.match(exact.ended)
    assert told is not None
    try:
        trajectory = ridden(case, engine)
    except UnsuitableProblem as error:
        pytest.skip(str(error))
    assert trajectory.ended is not None
    mine = TOUCH.match(trajectory.ended)
    assert mine is not None, trajectory.ended
    # One step of a millisecond; soft wheels come deeper by up to their sinking, 4 mm at 3 m/s.
    assert float(mine[1]) == pytest.approx(float(told[1]), abs=1.5e-3)
    assert len(trajectory.time) == len(exact.time)
    assert trajectory.gap is not None
    # No gap of another place of the rim, which was 23 mm.
    assert np.abs(trajectory.gap).max() < 5e-3


def test_a_start_with_a_rim_inside_the_ground_is_refused() -> None:
    _, scenario = load_scenario(str(CASES / "ripples-tight.toml"))
    with pytest.raises(ScenarioError, match=r"^motion: the front rim lies 36\.2 mm inside the ground at x = "):
        make_start(scenario)


@pytest.mark.parametrize("alpha", [1.5, 2.0, 5.0])
def test_a_start_in_a_bowl_tighter_than_a_wheel_is_refused(alpha: float) -> None:
    _, scenario = load_scenario(str(CASES / "bowl-tighter-than-wheel.toml"), {"surface.alpha": alpha})
    with pytest.raises(ScenarioError, match=r"cannot touch the ground|inside the ground"):
        make_start(scenario)


def test_a_start_with_overlapping_wheels_is_refused() -> None:
    """Radii of 0.3 m and 0.35 m on a wheelbase of 0.6 m; turned aside, the front wheel passes the rear one."""
    case = str(CASES / "straight.toml")
    _, scenario = load_scenario(case, {"bicycle.wheelbase": 0.6})
    with pytest.raises(ScenarioError, match=r"^motion: the wheels overlap by 47\.9 mm at a steer of 0 rad$"):
        make_start(scenario)
    _, turned = load_scenario(case, {"bicycle.wheelbase": 0.6, "perturbation.steer": 0.1})
    make_start(turned)


@pytest.mark.parametrize("name", library_names())
def test_the_library_rides_to_its_end(name: str) -> None:
    _, scenario = load_scenario(name)
    problem = make_start(scenario).problem
    assert simulate(problem.bicycle, problem.surface, problem.q, problem.qd, problem.times).ended is None
