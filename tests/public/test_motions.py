"""Circular motions, families and critical bowls from Python, as a user would ask for them."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import velodrome
from velodrome.reference import critical as reference_critical
from velodrome.scenarios.motions import families as rooms_families


def test_a_motion_is_found_by_its_family_or_by_its_angles() -> None:
    motion = velodrome.circular(alpha=0.005, rear_rate=18.0, family=2)
    near = velodrome.circular(surface=velodrome.Paraboloid(0.005), rear_rate=18.0, near=(0.74, 2.84))
    assert motion.motion.lean == near.motion.lean
    assert (motion.family, motion.lyapunov_stable, motion.physical) == (2, True, True)
    reduced = velodrome.linearise(velodrome.Bicycle(), velodrome.Paraboloid(0.005), *motion.motion.state())
    assert np.array_equal(reduced.eigenvalues, motion.eigenvalues)


def test_a_motion_of_another_bicycle_on_another_ground() -> None:
    heavy = velodrome.Bicycle(rear_frame_mass=95.0)
    sphere = velodrome.Sphere(100.0)
    motion = velodrome.circular(surface=sphere, rear_rate=18.0, family=2, bicycle=heavy)
    light = velodrome.circular(surface=sphere, rear_rate=18.0, family=2)
    # All weight is carried: the vertical contact forces add up to it.
    for found, bicycle in ((motion, heavy), (light, velodrome.Bicycle())):
        assert found.motion.force[:, 2].sum() == pytest.approx(bicycle.mass * bicycle.gravity, rel=1e-12)
    assert motion.motion.lean != light.motion.lean


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({}, "one of alpha and surface"),
        ({"alpha": 0.005, "surface": velodrome.Plane()}, "one of alpha and surface"),
        ({"alpha": -1.0}, "alpha is -1.0"),
        ({"surface": velodrome.HeightField(((0.0, 0.01) * 3,) * 6, 1.0)}, "surface of revolution"),
    ],
)
@pytest.mark.parametrize("call", [velodrome.circular, velodrome.families])
def test_a_ground_that_is_none_is_refused(call: Any, given: dict[str, Any], words: str) -> None:
    more = {"rear_rate": 18.0, "family": 2} if call is velodrome.circular else {}
    with pytest.raises(velodrome.ScenarioError, match=words):
        call(**given, **more)


def test_the_families_are_the_commands() -> None:
    found = velodrome.families(alpha=0.005)
    assert found.as_json() == rooms_families.families_document(0.005)
    second = next(curve for curve in found.curves if curve.number == 2)
    assert len(second.samples.lean) == len(second.modes) == len(second.rims_clear)
    (start, end), *_ = second.stable_sections
    low, high = sorted([start.motion.rear_rate, end.motion.rear_rate])
    assert low < 18.0 < high  # the motion of the first test is stable
    assert {"hopf", "energy", "end"} >= {start.cause, end.cause}


def test_critical_shapes_are_the_reference_modules(monkeypatch: pytest.MonkeyPatch) -> None:
    """The search takes half a minute and has tests of its own; here it is what is made of it."""
    motion = velodrome.circular(alpha=0.012, rear_rate=18.0, family=2).motion
    point = reference_critical.CriticalPoint(
        (2, 4), 0.012, motion, 0.0, "reconnection", ("the wheels overlap by 1 mm",)
    )
    asked: list[velodrome.Bicycle] = []

    def reconnections(bicycle: velodrome.Bicycle, progress: Any) -> list[Any]:
        asked.append(bicycle)
        progress(0.5)
        return [point]

    monkeypatch.setattr(rooms_families, "reconnections", reconnections)
    monkeypatch.setattr(rooms_families, "last_stable", lambda bicycle, number: point if number == 2 else None)
    monkeypatch.setattr(rooms_families, "describe_gaps", lambda bicycle, number: "no curve" if number == 1 else None)
    told: list[tuple[str, float, float]] = []
    heavy = velodrome.Bicycle(rear_frame_mass=95.0)
    found = velodrome.critical(bicycle=heavy, progress=lambda *seen: told.append(seen))
    assert asked == [heavy]
    assert told[:2] == [("merging", 0.0, 1.0), ("merging", 0.5, 1.0)]
    assert (found.cusp_collision, found.merging) == (point, (point,))
    assert found.last_stable == {1: None, 2: point, 3: None, 4: None}
    assert repr(found).splitlines() == [
        "CriticalShapes, alpha [1/m]:",
        "  cusps of families 2 and 4 meet: 0.012 (cannot be ridden)",
        "  last stable section vanishes: family 1 none, family 2 0.012 (cannot be ridden), family 3 none, "
        "family 4 none",
        "  families exchange parts: families 2 and 4 0.012 (cannot be ridden)",
        "  family 1 not followed: no curve",
    ]
    document = found.as_json()
    assert document["last_stable"]["1"] is None
    assert document["cusp_collision"]["unphysical_because"] == ["the wheels overlap by 1 mm"]
    assert not document["cusp_collision"]["physical"]
    assert document["not_found"] == {"1": "no curve"}
    assert document["bicycle"]["parameters"]["rear_frame_mass"] == 95.0
    assert document["cusp_collision"]["alpha"] == document["last_stable"]["2"]["alpha"] == 0.012


def test_a_solution_is_shown_in_a_few_lines_and_compared_by_identity() -> None:
    found, other = (velodrome.circular(alpha=0.005, rear_rate=18.0, family=2) for _ in range(2))
    assert found == found
    assert found != other
    assert len({found, other}) == 2
    lines = repr(found).splitlines()
    assert len(lines) <= 10
    assert lines[0] == "CircularSolution: family 2, alpha 0.005 1/m"
    assert "lean 0.737443, steer 2.83701" in lines[2]
    assert "  Lyapunov stable: growth rate -" in lines[-1]


def test_a_bicycle_may_be_a_file_or_a_scenarios() -> None:
    source = str(Path(__file__).parents[1] / "cases" / "tms-exact.toml")
    found = velodrome.circular(alpha=0.0, rear_rate=40.0, near=(0.0, 0.0), bicycle=source)
    assert (found.bicycle.front_wheel_mass, found.motion.yaw_rate, found.family) == (0.0, 0.0, None)
    assert found.motion.is_straight
    assert repr(found).startswith("CircularSolution: straight, alpha 0 1/m")
    with pytest.raises(velodrome.ScenarioError, match=r"nowhere\.txt: there is no such file"):
        velodrome.circular(alpha=0.0, rear_rate=40.0, near=(0.0, 0.0), bicycle=Path("nowhere.txt"))


def test_a_missing_motion_has_a_reason() -> None:
    with pytest.raises(velodrome.MissingMotionError, match="no circular motion found") as told:
        velodrome.circular(alpha=0.005, rear_rate=10.0, family=2)
    assert told.value.reason == "no-such-motion"
    assert told.value.as_json() == {"reason": "no-such-motion", "message": str(told.value)}
    again = pickle.loads(pickle.dumps(told.value))
    assert (str(again), again.reason) == (str(told.value), "no-such-motion")
