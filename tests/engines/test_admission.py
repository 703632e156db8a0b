"""What is taken of an engine: a whole trajectory of the problem, as far as its state is finite, or one clear line."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from importlib.metadata import EntryPoint
from typing import Any

import numpy as np
import pytest

from engines import engine as registry
from engines.admission import ride
from engines.engine import EngineError, Problem, Settings, Trajectory, load_engine
from engines.lagrange import ENGINE, LagrangeEngine
from reference.bicycle import Bicycle
from reference.families import find_motion
from reference.surface import Paraboloid


@cache
def problem() -> Problem:
    _, motion = find_motion(Bicycle(), Paraboloid(0.005), 18.0, 2)
    return Problem(Bicycle(), Paraboloid(0.005), *motion.state(), np.arange(11) / 100)


@cache
def ridden() -> Trajectory:
    return ENGINE.simulate(problem(), ENGINE.settings(), lambda _: None)


@dataclass
class Giving(LagrangeEngine):
    """An engine that gives what it is told to."""

    given: Any
    gives: tuple[str, ...] = LagrangeEngine.gives

    def simulate(self, problem: Problem, settings: Settings, progress: Any) -> Any:
        return self.given


def taken(given: Any, gives: tuple[str, ...] = LagrangeEngine.gives) -> Trajectory:
    return ride(Giving(given, gives), problem(), ENGINE.settings(), lambda _: None)


def test_a_whole_trajectory_is_taken_as_it_is() -> None:
    assert taken(ridden()) is ridden()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"engine": "warp"}, "is of engine 'warp', not 'reference'"),
        ({"version": "0"}, "is of version '0', not "),
        ({"settings": {"step": 9}}, "is of settings {'step': 9}, not {"),
        ({"q": np.zeros((11, 8))}, r"its q has shape (11, 8); it must be (11, 9)"),
        ({"qd": np.zeros((10, 9))}, r"its qd has shape (10, 9); it must be (11, 9)"),
        ({"q": [[0.0] * 9] * 11}, "its q is no array of floats"),
        ({"q": np.zeros((11, 9), complex)}, "its q is no array of floats"),
        ({"body_position": None}, "its body_position is missing"),
        ({"slip": np.zeros((11, 2))}, "its slip has shape"),
        ({"time": np.arange(11) / 50}, "its times are not the problem's"),
        ({"cpu_time": float("nan")}, "its cpu_time is nan"),
        ({"unconverged_steps": -1}, "its unconverged_steps is -1; it must be a number of its "),
        ({"unconverged_steps": 10**9}, "its unconverged_steps is 1000000000; it must be a number of its "),
        ({"unconverged_steps": 0.5}, "its unconverged_steps is 0.5; it must be a number of its "),
        ({"largest_residual": -1e-9}, "its largest_residual is -1e-09; it must be a finite number"),
        ({"largest_residual": float("nan")}, "its largest_residual is nan; it must be a finite number"),
    ],
)
def test_what_is_no_trajectory_of_the_problem_is_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(EngineError) as caught:
        taken(replace(ridden(), **changes))
    assert words in str(caught.value)


def test_other_things_are_refused() -> None:
    for given in (None, 3, {"time": []}):
        with pytest.raises(EngineError, match=f"it gave a {type(given).__name__}, not a Trajectory"):
            taken(given)
    with pytest.raises(EngineError, match="gives gap, which it does not list"):
        taken(ridden(), gives=("slip", "contact_point", "contact_force", "kinetic_energy", "potential_energy"))
    with pytest.raises(EngineError, match=r"ends at 0\.04 s and does not say why"):
        taken(ridden().first(5))
    with pytest.raises(EngineError, match="no sample"):
        taken(ridden().first(0))


def test_a_ride_ends_before_its_first_state_that_is_not_finite() -> None:
    q = ridden().q.copy()
    q[4:] = np.nan
    found = taken(replace(ridden(), q=q))
    assert len(found.time) == 4
    assert found.ended == "its state is not finite at 0.04 s"
    assert np.array_equal(found.q, ridden().q[:4])
    # What it gives beside the state may well have gaps.
    slip = np.full((11, 2, 2), np.nan)
    assert taken(replace(ridden(), slip=slip)).ended is None
    q[:] = np.inf
    with pytest.raises(EngineError, match="its first state is not finite"):
        taken(replace(ridden(), q=q))


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("no_such_package:ENGINE", "cannot be loaded: ModuleNotFoundError"),
        ("engines.lagrange:NOTHING", "cannot be loaded: AttributeError"),
        ("engines.lagrange:ORDER", "is no engine: it has no name"),
        ("engines.lagrange:ENGINE", "calls itself 'reference'; both names must be the same"),
    ],
)
def test_what_is_announced_and_no_engine_is_refused(value: str, words: str, monkeypatch: pytest.MonkeyPatch) -> None:
    point = EntryPoint("own", value, registry.ENTRY_POINT_GROUP)
    monkeypatch.setattr(registry, "entry_points", lambda group: [point])
    with pytest.raises(ValueError, match=f"engine 'own', announced as {value}, {words}"):
        load_engine("own")
