"""The registry, and what the engines in it do; what every engine must keep to is held in `test_conformance`."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from importlib.metadata import Distribution, EntryPoint
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.installed import parametrise_engines
from velodrome.engines import lagrange, registry
from velodrome.engines.engine import REFERENCE, Problem, Trajectory, UnsuitableProblem
from velodrome.engines.registry import engine_names, load_engine
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.families import find_motion
from velodrome.reference.surface import Paraboloid, Plane, SurfaceOfRevolution

NAMES = engine_names()
OPTIONAL = ("contact_point", "contact_force", "gap", "slip", "kinetic_energy", "potential_energy")


@cache
def circle(surface: SurfaceOfRevolution) -> Problem:
    """A tenth of a second of Q2, or of its like on another ground."""
    _, motion = find_motion(Bicycle(), surface, 18.0, 2)
    return Problem(Bicycle(), surface, *motion.state(), np.arange(11) / 100)


@cache
def problem(name: str) -> Problem:
    """A circle that an engine is made for: in the bowl, or on the plane."""
    engine = load_engine(name)
    try:
        engine.check(circle(Paraboloid(0.005)), engine.settings())
    except UnsuitableProblem:
        return circle(Plane())
    return circle(Paraboloid(0.005))


@cache
def ridden(name: str) -> Trajectory:
    """The circle in an engine, as it gives it."""
    engine = load_engine(name)
    return engine.simulate(problem(name), engine.settings(), lambda _: None)


def test_the_reference_comes_first_and_the_rest_in_order() -> None:
    assert NAMES[0] == REFERENCE
    assert NAMES[1:] == sorted(NAMES[1:])
    assert {"exudyn", "exudyn-plane-normal", "exudyn-builtin"} <= set(NAMES)
    assert {f"mujoco-{model}" for model in ("default", "native", "exact-contact", "multipliers")} <= set(NAMES)


def test_an_unknown_engine_is_refused_with_those_that_there_are() -> None:
    with pytest.raises(ValueError, match=r"'warp' is not installed \(there are reference, .*mujoco-native"):
        load_engine("warp")


def test_an_engine_of_another_package_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lagrange, "OWN", type("Own", (lagrange.LagrangeEngine,), {"name": "aaa"})(), raising=False)
    own = EntryPoint("aaa", "velodrome.engines.lagrange:OWN", registry.ENTRY_POINT_GROUP)
    here = registry.list_entry_points(registry.ENTRY_POINT_GROUP)
    monkeypatch.setattr(registry, "list_entry_points", lambda group: [own, *here])
    assert engine_names() == [REFERENCE, "aaa", *NAMES[1:]]
    assert load_engine("aaa").name == "aaa"


def announced_by(package: str, folder: Path) -> Distribution:
    """A distribution that announces the engine "aaa"."""
    info = folder / f"{package}-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[velodrome.engines]\naaa = velodrome.engines.lagrange:OWN\n")
    return Distribution.at(info)


def test_two_packages_may_not_announce_one_name(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    # The second is the first once more, as an editable install puts it on the path.
    places = (("one.engine", "a"), ("one_engine", "b"), ("other-engine", "c"))
    points = [point for name, where in places for point in announced_by(name, tmp_path / where).entry_points]
    monkeypatch.setattr(registry, "list_entry_points", lambda group: points[:2])
    assert engine_names() == ["aaa"]
    monkeypatch.setattr(registry, "list_entry_points", lambda group: points)
    for call in (engine_names, lambda: load_engine("aaa")):
        with pytest.raises(ValueError, match="'aaa' is announced by two packages, one-engine and other-engine"):
            call()


@pytest.mark.parametrize("name", parametrise_engines())
def test_a_step_between_the_outputs_is_refused_with_one_that_fits(name: str) -> None:
    engine = load_engine(name)
    fixed = {"integrator": "modified-euler"} if name == REFERENCE else {}
    engine.check(problem(name), engine.settings.model_validate(fixed | {"step": 0.0025}))
    with pytest.raises(ValueError, match=r"0\.003.* 0\.01 s.* 0\.0025"):
        engine.check(problem(name), engine.settings.model_validate(fixed | {"step": 0.003}))


@pytest.mark.parametrize("name", parametrise_engines())
def test_samples_carry_the_engines_own_clock(name: str) -> None:
    start, trajectory = problem(name), ridden(name)
    # Which may add its step up.
    np.testing.assert_allclose(trajectory.time, start.times, rtol=2.0**-52 * (2 + trajectory.steps / 2), atol=0)
    assert trajectory.cpu_time > 0


def test_a_ride_is_cut_in_all_that_is_sampled() -> None:
    trajectory = replace(ridden("mujoco-native"), slip=None)
    first = trajectory.first(3)
    assert first.slip is None
    assert (first.steps, first.settings) == (trajectory.steps, trajectory.settings)
    for field in ("time", "q", "qd", "body_position", "body_quaternion", *OPTIONAL):
        if field != "slip":
            assert np.array_equal(getattr(first, field), getattr(trajectory, field)[:3]), field


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"q": np.zeros(5)}, "q has shape (5,)"),
        ({"q": np.zeros((1, 9))}, "q has shape (1, 9)"),
        ({"qd": np.full(9, np.nan)}, "qd has shape (9,), [nan"),
        ({"qd": "x"}, "qd is 'x'; it must be an array of numbers"),
        ({"times": []}, "times have shape (0,)"),
        ({"times": [0.0]}, "at least two"),
        ({"times": np.zeros((2, 2))}, "times have shape (2, 2)"),
        ({"times": [1.0, 2.0]}, "rise from 0 s"),
        ({"times": [0.0, 0.2, 0.1]}, "rise from 0 s"),
        ({"times": [0.0, 0.1, 0.1]}, "rise from 0 s"),
        ({"times": [0.0, np.inf]}, "must be finite"),
    ],
)
def test_a_problem_refuses_arrays_that_are_none_of_it(given: dict[str, Any], words: str) -> None:
    right = circle(Paraboloid(0.005))
    with pytest.raises(ValueError, match=re.escape(words)) as told:
        replace(right, **given)
    assert "\n" not in str(told.value)


def test_a_problem_keeps_its_arrays_and_takes_lists() -> None:
    right = circle(Paraboloid(0.005))
    same = replace(right)
    assert same.q is right.q
    listed = replace(right, q=right.q.tolist(), qd=right.qd.tolist(), times=right.times.tolist())
    for name in ("q", "qd", "times"):
        assert getattr(listed, name).tobytes() == getattr(right, name).tobytes()
    assert right != same
    assert len({right, same}) == 2
