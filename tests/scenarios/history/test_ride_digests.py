"""The digest of a ride: of all that was ridden, and of nothing else."""

from __future__ import annotations

from dataclasses import replace
from math import prod
from typing import Any

import numpy as np
import pytest

from velodrome.engines.engine import REQUIRED, SHAPES, Trajectory
from velodrome.scenarios.history.ride import digest_ride

COUNT = 3
SAMPLES: dict[str, Any] = {
    name: np.linspace(0.1, 0.9, COUNT * prod(SHAPES[name])).reshape(COUNT, *SHAPES[name]) for name in REQUIRED
}
RIDE = Trajectory(
    engine="mill",
    version="1.0",
    settings={"step": 0.002},
    steps=500,
    cpu_time=0.25,
    ended=None,
    **SAMPLES,
)


@pytest.mark.parametrize(
    "told",
    [
        {"version": "1.1"},
        {"cpu_time": 0.5},
        {"settings": {"step": 0.002, "left_out": {"first_force": "is zero"}}},
        {"unconverged_steps": 0, "largest_residual": 1e-12},
    ],
    ids=lambda told: "-".join(told),
)
def test_what_is_told_about_a_ride_is_no_part_of_it(told: dict[str, Any]) -> None:
    assert digest_ride(replace(RIDE, **told)) == digest_ride(RIDE)


@pytest.mark.parametrize("name", REQUIRED)
def test_a_last_bit_of_a_sample_is_a_part_of_it(name: str) -> None:
    values = getattr(RIDE, name).copy()
    values.flat[-1] = np.nextafter(values.flat[-1], np.inf)
    assert digest_ride(replace(RIDE, **{name: values})) != digest_ride(RIDE)


@pytest.mark.parametrize("ridden", [{"steps": 501}, {"ended": "fell"}], ids=lambda ridden: "-".join(ridden))
def test_the_steps_and_the_end_are_parts_of_it(ridden: dict[str, Any]) -> None:
    assert digest_ride(replace(RIDE, **ridden)) != digest_ride(RIDE)
