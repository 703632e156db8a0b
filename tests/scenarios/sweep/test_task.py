"""Tasks of a sweep done together: their rows are those of tasks done one by one, to the bit."""

from __future__ import annotations

import json
import random
from typing import Any

import pytest

from velodrome.engines import many
from velodrome.engines.admission import ride_engine
from velodrome.engines.engine import REFERENCE
from velodrome.engines.registry import load_engine
from velodrome.scenarios.scenario import load_scenario, make_start
from velodrome.scenarios.sweep.task import Tasks

BASE = load_scenario("q2-plus", {"simulation.duration": 1.0, "simulation.output_rate": 20.0})[1]
DATA = BASE.model_dump(mode="json", exclude_none=True)
POINTS: list[dict[str, Any]] = [
    {"perturbation.lean": 0.01},
    {"perturbation.lean": -0.02, "perturbation.steer": 0.01},
    {"surface.alpha": 0.006, "motion.rear_rate": 17.0},
    {"perturbation.lean_rate": 3.0, "simulation.duration": 3.0},  # falls
    {"perturbation.lean_rate": 3.0, "simulation.duration": 3.0, "simulation.beyond_fall": True},
    {"perturbation.lean": 3.0},  # cannot be reached
    {"motion.rear_rate": 0.001},  # no such motion
    {"motion.rear_rate": -1.0},  # no valid scenario
    {"perturbation.leen": 0.1},
    {"simulation.output_rate": 10},
    {"bicycle.trail": 0.09},
    {"bicycle.rear_frame_mass": -1.0},
    {"inputs.steer_damping": 0.5, "inputs.steer_torque": 0.01},
    {"engines.reference.tolerance": 1e-9},
    {"engines.reference.integrator": "modified-euler", "engines.reference.step": 0.01},
    {"engines.reference.integrator": "modified-euler", "engines.reference.step": 0.03},  # refused
]


def text_of(row: dict[str, Any]) -> str:
    return json.dumps(row, sort_keys=True)


@pytest.fixture(scope="module")
def alone() -> list[str]:
    """Rows of tasks, each done by a worker of its own."""
    return [text_of(Tasks(DATA).do(REFERENCE, changes)[0]) for changes in POINTS]


def test_the_points_have_all_kinds_of_rows(alone: list[str]) -> None:
    found = {json.loads(row)["status"] for row in alone}
    assert found == {"done", "fell", "no-motion", "refused"}


@pytest.mark.parametrize("seed", [0, 1])
def test_rows_of_a_batch_are_those_of_single_tasks(alone: list[str], seed: int) -> None:
    order = list(range(len(POINTS)))
    random.Random(seed).shuffle(order)
    done = Tasks(DATA).do_many(REFERENCE, [POINTS[i] for i in order])
    assert [text_of(row) for row, _ in done] == [alone[i] for i in order]
    assert all(timing["task_time"] >= 0 and timing["finished"] > 0 for _, timing in done)


def test_a_small_batch_holds_few_samples_and_changes_no_row(alone: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(many, "_SAMPLES_A_CALL", 45)  # two rides of 21 samples
    done = Tasks(DATA).do_many(REFERENCE, POINTS)
    assert [text_of(row) for row, _ in done] == alone


def test_other_engines_do_their_points_one_by_one() -> None:
    points = [{**changes, "simulation.duration": 0.1} for changes in POINTS[:2]]
    name = "mujoco-multipliers"
    work = Tasks(DATA)
    work.do_many(REFERENCE, points)  # the last ride is kept for the other engines
    together = [text_of(row) for row, _ in work.do_many(name, points[::-1])]
    assert together == [text_of(Tasks(DATA).do(name, changes)[0]) for changes in points[::-1]]


def test_a_ride_of_a_batch_is_that_of_the_engine() -> None:
    engine = load_engine(REFERENCE)
    settings = engine.settings()
    problems = [make_start(BASE.model_copy(update={"perturbation": table})).problem for table in _perturbations()]
    for i, ride in many.ride_in_batches(engine, problems, settings):
        assert not isinstance(ride, Exception)
        expected = ride_engine(engine, problems[i], settings, lambda _: None)
        assert ride.q.tobytes() == expected.q.tobytes()
        assert ride.contact_force is not None
        assert expected.contact_force is not None
        assert ride.contact_force.tobytes() == expected.contact_force.tobytes()
        assert (ride.steps, ride.ended, ride.settings) == (expected.steps, expected.ended, expected.settings)


def _perturbations() -> list[Any]:
    return [BASE.perturbation.model_copy(update={"lean": lean}) for lean in (0.0, 0.05, 0.7)]
