"""Rides of many problems in one call: each as alone, to the bit, in any number of threads."""

# mujoco and numba carry no types for these.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cache
from typing import Any

import mujoco
import numpy as np
import pytest

from velodrome.engines.admission import ride_engine
from velodrome.engines.engine import EngineError, Problem, Trajectory
from velodrome.engines.lagrange import LagrangeEngine
from velodrome.engines.many import ride_engine_many
from velodrome.engines.mujoco import exact_contact, multipliers, native
from velodrome.engines.mujoco.engine import MujocoEngine
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.dae import consistent_state
from velodrome.reference.fall import Fall
from velodrome.reference.families import find_motion
from velodrome.reference.inputs import Inputs
from velodrome.reference.surface import Paraboloid, Plane

ENGINES: dict[str, MujocoEngine[Any]] = {
    "native": native.ENGINE,
    "exact": exact_contact.ENGINE,
    "multiplier": multipliers.ENGINE,
}


@cache
def motion(surface: Any) -> Problem:
    _, found = find_motion(Bicycle(), surface, 18.0, 2)
    return Problem(Bicycle(), surface, *found.state(), np.arange(6) / 20)


def problems() -> list[Problem]:
    """Starts that go on, one that falls, two bicycles, a torque, and starts that are refused."""
    bowl, level = motion(Paraboloid(0.005)), motion(Plane())
    slow = consistent_state(Bicycle(), Plane(), (0.0, 0.0), 0.5, 0.0, (0.0, 0.0, 3.0))
    return [
        *(replace(bowl, qd=bowl.qd * (1 + 0.001 * k)) for k in range(3)),
        replace(bowl, bicycle=replace(Bicycle(), wheelbase=0.3)),
        Problem(Bicycle(), Plane(), *slow, np.arange(21) / 20),
        replace(level, inputs=Inputs(steer_torque=0.1)),
        replace(level, bicycle=replace(Bicycle(), rear_frame_mass=80.0)),
    ]


def bits(ride: Trajectory | Exception) -> Any:
    """Everything but the CPU time, comparable to the bit."""
    if isinstance(ride, Exception):
        return type(ride), str(ride)
    found: dict[str, Any] = {}
    for field in fields(ride):
        value = getattr(ride, field.name)
        if isinstance(value, Fall):
            value = value.as_json()
        found[field.name] = value.tobytes() if isinstance(value, np.ndarray) else value
    del found["cpu_time"]
    return found


def alone(engine: Any, problem: Problem, settings: Any = None) -> Trajectory | Exception:
    try:
        return ride_engine(engine, problem, settings or engine.settings(), lambda _: None)
    except Exception as error:
        return error


@pytest.mark.parametrize("name", ENGINES)
def test_rides_in_threads_are_the_same_to_the_bit(name: str) -> None:
    engine, asked = ENGINES[name], problems()
    before = mujoco.get_mju_user_warning()
    expected = [alone(engine, problem) for problem in asked]
    assert [type(ride) for ride in expected] == 3 * [Trajectory] + [EngineError] + 3 * [Trajectory]
    assert [getattr(ride, "fall", None) is not None for ride in expected] == 4 * [False] + [True] + 2 * [False]
    for threads in (1, 3):
        found = ride_engine_many(engine, asked, engine.settings(), threads)
        assert [bits(ride) for ride in found] == [bits(ride) for ride in expected]
    assert mujoco.get_mju_user_warning() is before


@pytest.mark.parametrize("settings", [{}, {"integrator": "modified-euler"}])
def test_the_reference_rides_many_to_the_bit(settings: dict[str, Any]) -> None:
    engine, asked = LagrangeEngine(), problems()
    chosen = engine.settings(**settings)
    expected = [alone(engine, problem, chosen) for problem in asked]
    found = ride_engine_many(engine, asked, chosen, 2)
    assert [bits(ride) for ride in found] == [bits(ride) for ride in expected]
    assert sum(isinstance(ride, EngineError) for ride in found) == 1


@dataclass
class Single(LagrangeEngine):
    """An engine that rides one problem at a time."""

    simulate_many: Any = None


def test_an_engine_without_rides_of_many_rides_them_one_by_one() -> None:
    engine, asked = Single(), problems()
    found = ride_engine_many(engine, asked, engine.settings())
    assert [bits(ride) for ride in found] == [bits(alone(engine, problem)) for problem in asked]
    assert any(isinstance(ride, Trajectory) for ride in found)
    assert ride_engine_many(engine, [], engine.settings()) == []


def failing(problems: list[Problem], settings: Any, threads: int) -> list[Any]:
    return [ValueError("no place") for _ in problems]


def test_what_an_engine_gives_for_many_is_validated() -> None:
    asked = problems()[:2]
    for given in (lambda *_: None, lambda problems, *_: problems[:1]):
        engine = Single(simulate_many=given)
        with pytest.raises(EngineError, match="gave no list of 2 rides"):
            ride_engine_many(engine, asked, engine.settings())
    engine = Single(simulate_many=lambda problems, *_: list(problems))
    wrong = ride_engine_many(engine, asked, engine.settings())
    assert all("not a Trajectory" in str(ride) for ride in wrong)
    # A ride that fails in a batch only is ridden alone.
    engine = Single(simulate_many=failing)
    found = ride_engine_many(engine, asked, engine.settings())
    assert [bits(ride) for ride in found] == [bits(alone(engine, problem)) for problem in asked]


def test_no_thread_is_refused_and_an_exit_ends_the_batch() -> None:
    engine, asked = native.ENGINE, problems()
    with pytest.raises(ValueError, match="threads is 0; it must be at least 1"):
        ride_engine_many(engine, asked, engine.settings(), 0)

    class Leaving(MujocoEngine[Any]):
        def simulate(self, problem: Problem, settings: Any, progress: Any) -> Trajectory:
            if len(problem.times) > len(asked[0].times):
                raise SystemExit("enough")
            return super().simulate(problem, settings, progress)

    leaving = Leaving(**{field.name: getattr(engine, field.name) for field in fields(engine)})
    with pytest.raises(EngineError, match=r"called sys.exit\('enough'\)"):
        ride_engine_many(leaving, [*asked[:3], asked[4], *asked[:3]], engine.settings(), 2)
