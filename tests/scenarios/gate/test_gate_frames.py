"""The gate's limits for MuJoCo's exact contact are those of round-off: a thousandth of a frame's inertia shows."""

from dataclasses import replace
from functools import cache

import pytest
from altered import Altered

from velodrome.engines.engine import Problem
from velodrome.scenarios.gate.exact import find_exact
from velodrome.scenarios.gate.sample import Sample, take_sample
from velodrome.scenarios.run.runner import configure_engine
from velodrome.scenarios.scenario.schema import Gate, load_scenario
from velodrome.scenarios.scenario.start import make_start

# What the bicycle's lean moves least: their share of the whole is the smallest.
INERTIAS = ["rear_frame_Ixx", "rear_frame_Iyy", "rear_frame_Izz", "front_frame_Iyy", "front_frame_Izz"]


@cache
def sampled(inertia: str | None) -> Sample:
    start = make_start(load_scenario("q2", {"simulation.duration": 3.0})[1])
    engine, settings = configure_engine("mujoco-exact-contact", {})

    def heavier(problem: Problem) -> Problem:
        if inertia is None:
            return problem
        bicycle = problem.bicycle
        return replace(problem, bicycle=replace(bicycle, **{inertia: 1.001 * getattr(bicycle, inertia)}))

    rides_only = Gate(order=False, eigenvalues=False)
    return take_sample(start, find_exact(start), rides_only, Altered(engine, heavier), settings, lambda _: None)


@pytest.mark.parametrize("inertia", INERTIAS)
def test_a_thousandth_of_a_frame_s_inertia_is_far_beyond_the_limits(inertia: str) -> None:
    right, wrong = sampled(None), sampled(inertia)
    for quantity in ("short_error", "position_error", "settled_force_error", "phase_drift_rate"):
        values, limit = (right.values[quantity], wrong.values[quantity]), right.limits[quantity]
        assert values[0] is not None
        assert values[1] is not None
        assert limit is not None
        assert abs(values[1] - values[0]) > 100 * limit, quantity
