"""Engines that ignore the ground or the bicycle that they are given, or read it wrongly, are found and named."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from planting import Before, follow, plant

from velodrome.engines.engine import REFERENCE, Problem
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.height_field import HeightField
from velodrome.reference.surface import Paraboloid, Plane
from velodrome.testing import ConformanceReport, examine_engine

WAVES = "order on waves, another bicycle"


def examine(before: Before, engine: str = REFERENCE, **settings: Any) -> ConformanceReport:
    """Examine an engine that simulates a changed problem, and computes its reports from the coordinates."""
    return examine_engine(plant(engine, (before, lambda ride, problem, _: follow(ride, problem))), settings)


def on(kind: type, change: Callable[[Problem], Problem]) -> Before:
    """A change of the problems on one kind of ground."""
    return lambda problem: change(problem) if isinstance(problem.surface, kind) else problem


def with_heights(change: Callable[[np.ndarray], np.ndarray]) -> Before:
    def changed(problem: Problem) -> Problem:
        surface = problem.surface
        assert isinstance(surface, HeightField)
        return replace(problem, surface=replace(surface, heights=change(np.array(surface.heights)).tolist()))

    return on(HeightField, changed)


def shifted(problem: Problem) -> Problem:
    surface = problem.surface
    assert isinstance(surface, HeightField)
    x, y = surface.origin
    return replace(problem, surface=replace(surface, origin=(x + surface.spacing, y)))


def flat(problem: Problem) -> Problem:
    return replace(problem, surface=Plane())


def shallow(problem: Problem) -> Problem:
    return replace(problem, surface=Paraboloid(0.002))


def with_benchmark(name: str) -> Before:
    """A change of one number of the bicycle to the benchmark's."""
    return lambda problem: replace(problem, bicycle=replace(problem.bicycle, **{name: getattr(Bicycle(), name)}))


CASES = {
    "bowl as a plane": (on(Paraboloid, flat), "order on bowl", "it rides as the reference does on the plane"),
    "a tenth of the bowl": (on(Paraboloid, shallow), "order on bowl", "curvature looks to be a tenth of what it is"),
    "waves as a plane": (on(HeightField, flat), WAVES, "it rides as the reference does on the plane"),
    "transposed": (with_heights(np.transpose), WAVES, "the ground looks transposed"),
    "negated": (with_heights(np.negative), WAVES, "the ground looks negated"),
    "shifted": (on(HeightField, shifted), WAVES, "the ground looks shifted by one spacing in x"),
    "mass": (with_benchmark("rear_frame_mass"), WAVES, "rear_frame_mass looks to be the benchmark's"),
    "spin": (with_benchmark("rear_wheel_Iyy"), WAVES, "rear_wheel_Iyy looks to be the benchmark's"),
}


@pytest.mark.parametrize("what", CASES)
def test_a_wrong_model_is_named(what: str) -> None:
    before, check, words = CASES[what]
    report = examine(before, integrator="modified-euler")
    assert report[check].outcome == "failed", report
    assert words in "\n".join(report[check].found)
    assert report["order on plane"].outcome == "passed"


def test_an_engine_whose_contacts_have_friction_is_compared_with_mistakes() -> None:
    for engine in ("mujoco-native", "mujoco-default"):
        report = examine(with_benchmark("rear_wheel_radius"), engine)
        assert "rear_wheel_radius looks to be the benchmark's" in "\n".join(report[WAVES].found)
    report = examine(with_benchmark("rear_frame_mass"), "mujoco-exact-contact")
    assert "rear_frame_mass looks to be the benchmark's" in "\n".join(report[WAVES].found)


def test_an_engine_of_the_plane_is_compared_with_another_bicycle() -> None:
    report = examine(with_benchmark("rear_frame_mass"), "exudyn-builtin")
    check = report["order on plane, another bicycle"]
    assert check.outcome == "failed"
    assert "rear_frame_mass looks to be the benchmark's" in "\n".join(check.found)
    assert report["order on waves"].found == ("it refuses this ground",)
    assert report["order on waves"].outcome == "skipped"
