"""What is taken of an engine: a whole trajectory of the problem, as far as its state is finite, or one clear line."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import cache
from importlib.metadata import EntryPoint
from typing import Any

import numpy as np
import pytest

from velodrome.engines import registry
from velodrome.engines.admission import ride_engine
from velodrome.engines.engine import SHAPES, EngineError, Problem, Settings, Trajectory
from velodrome.engines.lagrange import ENGINE, LagrangeEngine
from velodrome.engines.registry import load_engine
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.dae import consistent_state
from velodrome.reference.families import find_motion
from velodrome.reference.kinematics import STEER
from velodrome.reference.surface import Paraboloid, Plane


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
    return ride_engine(Giving(given, gives), problem(), ENGINE.settings(), lambda _: None)


def test_a_whole_trajectory_is_taken_as_it_is() -> None:
    found = taken(ridden())
    for name in SHAPES:
        assert np.array_equal(getattr(found, name), getattr(ridden(), name)), name
    assert (found.steps, found.cpu_time, found.ended) == (ridden().steps, ridden().cpu_time, None)


def test_numbers_of_an_engine_are_taken_over() -> None:
    """An engine may use its arrays again for its next ride, and count with numpy."""
    given = replace(ridden(), q=ridden().q.copy(), steps=np.int64(7), cpu_time=np.float32(0.5))
    found = taken(given)
    given.q[:] = 0.0
    assert np.array_equal(found.q, ridden().q)
    assert (type(found.steps), type(found.cpu_time)) == (int, float)


def test_what_an_engine_writes_into_its_problem_changes_no_other_ride() -> None:
    class Writing(LagrangeEngine):
        def simulate(self, problem: Problem, settings: Any, progress: Any) -> Trajectory:
            trajectory = super().simulate(problem, settings, progress)
            problem.q[4] += 1.0
            problem.qd[:] = 0.0
            problem.times[1:] += 1.0
            return trajectory

    before = problem()
    kept = [array.copy() for array in (before.q, before.qd, before.times)]
    ride_engine(Writing(), before, ENGINE.settings(), lambda _: None)
    for array, copy in zip((before.q, before.qd, before.times), kept, strict=True):
        assert np.array_equal(array, copy)


def test_a_ride_ends_where_the_wheels_collide() -> None:
    """A wheelbase shorter than both radii: the front wheel strikes the rear one where steer passes zero."""
    short = Bicycle(wheelbase=0.6)
    q, qd = consistent_state(short, Plane(), (0.5, 0.0), 0.0, 0.2, (0.0, -1.0, 10.0))
    turned = Problem(short, Plane(), q, qd, np.arange(101) / 100)
    ride = ride_engine(ENGINE, turned, ENGINE.settings(), lambda _: None)
    told = re.fullmatch(r"the wheels collide at t = (\S+) s: there they overlap by 47\.9 mm", ride.ended or "")
    assert told is not None, ride.ended
    time, steer = float(told[1]), ride.q[:, STEER]
    assert np.all(steer > 0)
    assert ride.time[-1] <= time < ride.time[-1] + 0.01
    # Straight ahead from the last sample on, to second order in the 10 ms between samples.
    assert time - ride.time[-1] == pytest.approx(-steer[-1] / ride.qd[-1, STEER], abs=2e-3)
    q, qd = consistent_state(short, Plane(), (0.5, 0.0), 0.0, 0.0, (0.0, 0.0, 10.0))
    with pytest.raises(EngineError, match=r"^the wheels overlap by 47\.9 mm at a steer of 0 rad$"):
        ride_engine(ENGINE, replace(turned, q=q, qd=qd), ENGINE.settings(), lambda _: None)


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
        ({"time": np.arange(11) / 50}, "its sample 1 is at 0.02 s by its own clock, not at the 0.01 s asked for: 0.01"),
        (
            {"time": np.arange(11) / 100 + 1e-3 * (np.arange(11) > 6)},
            "its sample 7 is at 0.071 s by its own clock, not at the 0.07 s asked for: 0.001 s off",
        ),
        ({"time": np.arange(11) / 100 + 1e-12}, "its sample 0 is at 1e-12 s by its own clock"),
        ({"time": np.where(np.arange(11) == 3, np.nan, np.arange(11) / 100)}, "its sample 3 is at nan s"),
        ({"q": np.ma.masked_array(np.zeros((11, 9)))}, "its q is a MaskedArray of float64; it must be a plain ndarray"),
        ({"q": np.zeros((11, 9), ">f8")}, "its q is a ndarray of >f8; it must be a plain ndarray of float64"),
        ({"contact_force": np.zeros((11, 2, 3), np.float16)}, "its contact_force is a ndarray of float16"),
        ({"cpu_time": float("nan")}, "its cpu_time is nan"),
        ({"cpu_time": -1.0}, "its cpu_time is -1.0; it must be a finite number of seconds, not negative"),
        ({"steps": 12.5}, "its steps is 12.5; it must be a whole number, not negative"),
        ({"steps": True}, "its steps is True; it must be a whole number"),
        ({"steps": "12"}, "its steps is '12'; it must be a whole number"),
        ({"ended": ""}, "its ended is ''; it must be one line of text, or None"),
        ({"ended": "fell\nover"}, "its ended is 'fell\\nover'; it must be one line of text, or None"),
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


def test_a_clock_that_is_right_up_to_its_round_off_is_set_to_the_times_asked_for() -> None:
    """MuJoCo adds its step up: in a hundred seconds of 1 ms that errs by some 1e-12 of them."""
    sums = np.concatenate([[0.0], np.cumsum(np.full(100, 1e-3))])[::10]
    assert not np.array_equal(sums, problem().times)
    assert np.array_equal(taken(replace(ridden(), time=sums)).time, problem().times)


def test_more_samples_than_asked_for_are_refused() -> None:
    longer = {
        name: np.concatenate([value, value[-1:]]) for name in SHAPES if (value := getattr(ridden(), name)) is not None
    }
    with pytest.raises(EngineError, match="it gives 12 samples; 11 are asked for"):
        taken(replace(ridden(), **longer))


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
        ("velodrome.engines.lagrange:NOTHING", "cannot be loaded: AttributeError"),
        ("velodrome.engines.lagrange:ORDER", "is no engine: it has no name"),
        ("velodrome.engines.lagrange:ENGINE", "calls itself 'reference'; both names must be the same"),
    ],
)
def test_what_is_announced_and_no_engine_is_refused(value: str, words: str, monkeypatch: pytest.MonkeyPatch) -> None:
    point = EntryPoint("own", value, registry.ENTRY_POINT_GROUP)
    monkeypatch.setattr(registry, "list_entry_points", lambda group: [point])
    with pytest.raises(ValueError, match=f"engine 'own', announced as {value}, {words}"):
        load_engine("own")
