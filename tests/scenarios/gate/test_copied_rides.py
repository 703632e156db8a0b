"""A ride of the reference is told from one that was integrated, however close that is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from velodrome.engines.admission import ride_engine
from velodrome.engines.engine import REFERENCE
from velodrome.engines.registry import load_engine
from velodrome.scenarios.gate.exact import find_exact
from velodrome.scenarios.scenario import make_start
from velodrome.scenarios.scenario.schema import load_scenario


@pytest.mark.parametrize("scenario", ["forward-left", "q2", "plane-circle"])
def test_only_rides_within_the_last_places_are_copies(scenario: str) -> None:
    """The reference itself at other steps is as close as an engine can come, by round-off and truncation alone."""
    start = make_start(load_scenario(scenario, {"simulation.duration": 1.5})[1])
    exact, engine = find_exact(start), load_engine(REFERENCE)
    for factor in (0.9, 0.8, 0.7):
        own = ride_engine(engine, start.problem, engine.settings().refined(factor), lambda _: None)
        assert not exact.is_copied_by(own), factor
    numbers = np.random.default_rng(1)
    for units in (0, 1, 3):
        changed = {
            name: values + units * np.spacing(values) * numbers.choice([-1, 1], values.shape)
            for name, values in (("q", exact.computed[1].q), ("qd", exact.computed[1].qd))
        }
        assert exact.is_copied_by(replace(exact.computed[1], **changed)), units
