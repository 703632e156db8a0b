"""The registry, and what every engine in it must keep to."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from importlib.metadata import Distribution, EntryPoint
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from velodrome.engines import engine as registry
from velodrome.engines import lagrange
from velodrome.engines.engine import REFERENCE, Problem, Trajectory, UnsuitableProblem, engine_names, load_engine
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
def ridden(name: str) -> tuple[Trajectory, list[float]]:
    """The circle in an engine, and the times that it reported."""
    engine, seen = load_engine(name), []
    trajectory = engine.simulate(problem(name), engine.settings(), seen.append)
    return trajectory, seen


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
    here = registry.entry_points(group=registry.ENTRY_POINT_GROUP)
    monkeypatch.setattr(registry, "entry_points", lambda group: [own, *here])
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
    monkeypatch.setattr(registry, "entry_points", lambda group: points[:2])
    assert engine_names() == ["aaa"]
    monkeypatch.setattr(registry, "entry_points", lambda group: points)
    for call in (engine_names, lambda: load_engine("aaa")):
        with pytest.raises(ValueError, match="'aaa' is announced by two packages, one-engine and other-engine"):
            call()


@pytest.mark.parametrize("name", NAMES)
def test_an_engine_says_what_it_is(name: str) -> None:
    engine = load_engine(name)
    assert engine.name == name
    assert engine.version[0].isdigit()
    assert set(engine.gives) <= set(OPTIONAL)
    # No computation adds less than round-off, and a solver that left more would not be converged.
    assert 2.0**-53 < engine.step_noise(engine.settings()) < 1e-6


@pytest.mark.parametrize("name", NAMES)
def test_settings_refuse_what_they_do_not_know(name: str) -> None:
    settings = load_engine(name).settings
    for wrong in ({"stepp": 0.001}, {"step": float("nan")}, {"step": 0.0}, {"step": "small"}):
        with pytest.raises(ValidationError):
            settings.model_validate(wrong)
    with pytest.raises(ValidationError):
        settings().step = 0.002  # pyright: ignore[reportAttributeAccessIssue]


@pytest.mark.parametrize("name", NAMES)
def test_a_step_between_the_outputs_is_refused_with_one_that_fits(name: str) -> None:
    engine = load_engine(name)
    fixed = {"integrator": "modified-euler"} if name == REFERENCE else {}
    engine.check(problem(name), engine.settings.model_validate(fixed | {"step": 0.0025}))
    with pytest.raises(ValueError, match=r"0\.003.* 0\.01 s.* 0\.0025"):
        engine.check(problem(name), engine.settings.model_validate(fixed | {"step": 0.003}))


@pytest.mark.parametrize("name", NAMES)
def test_an_engine_gives_what_it_says_and_starts_where_it_is_told(name: str) -> None:
    engine, start = load_engine(name), problem(name)
    trajectory, seen = ridden(name)
    n = len(start.times)
    assert (trajectory.engine, trajectory.version, trajectory.ended) == (name, engine.version, None)
    assert engine.settings.model_validate(trajectory.settings) == engine.settings()
    # By its own clock, which may add its step up.
    np.testing.assert_allclose(trajectory.time, start.times, rtol=2.0**-52 * (2 + trajectory.steps / 2), atol=0)
    shapes = {"q": (n, 9), "qd": (n, 9), "body_position": (n, 4, 3), "body_quaternion": (n, 4, 4)}
    optional = {"contact_point": (n, 2, 3), "contact_force": (n, 2, 3), "gap": (n, 2), "slip": (n, 2, 2)}
    optional |= {"kinetic_energy": (n,), "potential_energy": (n,)}
    for field, shape in (shapes | optional).items():
        value = getattr(trajectory, field)
        if field in optional and field not in engine.gives:
            assert value is None, field
        else:
            assert value.shape == shape, field
            assert np.all(np.isfinite(value)), field
    # The start goes through rotations and back: a few units of 2^-52 of coordinates below 20.
    np.testing.assert_allclose(trajectory.q[0], start.q, rtol=0, atol=1e-13)
    np.testing.assert_allclose(trajectory.qd[0], start.qd, rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(trajectory.body_quaternion, axis=-1), 1, rtol=0, atol=1e-12)
    assert trajectory.steps > 0
    assert trajectory.cpu_time > 0
    assert seen == sorted(seen)
    assert all(0 <= t <= start.times[-1] for t in seen)


@pytest.mark.parametrize("name", NAMES)
def test_a_repeat_is_the_same_to_the_bit(name: str) -> None:
    engine = load_engine(name)
    again = engine.simulate(problem(name), engine.settings(), lambda _: None)
    assert np.array_equal(again.q, ridden(name)[0].q)
    assert again.steps == ridden(name)[0].steps


def test_a_ride_is_cut_in_all_that_is_sampled() -> None:
    trajectory = replace(ridden("mujoco-native")[0], slip=None)
    first = trajectory.first(3)
    assert first.slip is None
    assert (first.steps, first.settings) == (trajectory.steps, trajectory.settings)
    for field in ("time", "q", "qd", "body_position", "body_quaternion", *OPTIONAL):
        if field != "slip":
            assert np.array_equal(getattr(first, field), getattr(trajectory, field)[:3]), field
