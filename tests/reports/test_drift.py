"""The gate's arithmetic: limits scale as derived, and no change of the wrong kind passes."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from engines.steady import steady_trajectory
from reference.bicycle import Bicycle
from reference.families import find_motion
from reference.kinematics import REAR_ANGLE
from reference.surface import Paraboloid
from reports.drift import Scale, Verdict, judge, limits, missing, quantities
from reports.metrics import metrics

SCALE = Scale(radius=2.0, speed=5.0, rear_rate=18.0, growth_rate=-0.1, duration=4.0)
SETTINGS = {"step": 0.001, "tolerance": 1e-10}
ENTRY = {"version": "1.0", "settings": SETTINGS, "quantities": {"short_error": 1e-5, "max_slip": None}}
ALLOWED = {"short_error": 1e-7, "max_slip": 1e-6}
BICYCLE = Bicycle()
_, MOTION = find_motion(BICYCLE, Paraboloid(0.005), 18.0, 2)
EXACT = steady_trajectory(BICYCLE, MOTION, np.arange(41) / 10)


def judged(value: float | None, entry: dict[str, Any] | None = ENTRY, **changes: Any) -> list[Verdict]:
    values = {"short_error": value, "max_slip": None}
    run = {"settings": SETTINGS, "version": "1.0"} | changes
    return judge("exudyn", values, entry, ALLOWED, run["settings"], run["version"])


def test_limits_are_noise_times_sensitivity() -> None:
    # 1000 steps of 1e-10 each: 1e-7 of every size, and the start's 1e-11 more.
    found = limits(SCALE, 1e-10, 1000)
    expected = {
        "short_error": 2e-7,
        "radius_drift_rate": 3 * 2e-7 / 4,
        "phase_drift_rate": 3 * 1e-7 / 4,
        "rear_rate_drift_rate": 3 * 18e-7 / 4,
        "energy_drift": 2e-7,
        "max_slip": 5e-7,
        "mean_slip": 5e-7,
    }
    assert found == pytest.approx({name: limit * (1 + 1e-4) for name, limit in expected.items()}, rel=1e-14)


def test_only_growth_widens_limits() -> None:
    decaying, growing = limits(SCALE, 1e-10, 1000), limits(replace(SCALE, growth_rate=0.5), 1e-10, 1000)
    assert limits(replace(SCALE, growth_rate=0.0), 1e-10, 1000) == decaying
    for name, limit in growing.items():
        assert limit == pytest.approx(decaying[name] * np.exp(2.0), rel=1e-14)


@given(hnp.arrays(float, len(EXACT.time), elements=st.floats(-1, 1)))
def test_a_bounded_disturbance_tilts_a_line_by_no_more_than_the_limit_says(disturbance: np.ndarray) -> None:
    # limits() lets a slope move by 3 b / T where the samples move by b.
    qd = EXACT.qd.copy()
    qd[:, REAR_ANGLE] += disturbance
    measured = metrics(replace(EXACT, qd=qd), EXACT, BICYCLE, Paraboloid(0.005), -1.0, 1.0, circular=True)
    bound = float(np.abs(disturbance).max())
    scale = Scale(1.0, 1.0, bound, -1.0, float(EXACT.time[-1]))
    round_off = 18 * 2.0**-50  # of rates of size 18
    assert abs(measured["rear_rate_drift_rate"]) <= limits(scale, 1.0, 1)["rear_rate_drift_rate"] + round_off


@pytest.mark.parametrize(
    ("value", "status"),
    [
        (1e-5, "holds"),
        (1.0099e-5, "holds"),
        (0.9901e-5, "holds"),
        (1.0101e-5, "worse"),
        (0.9899e-5, "changed"),
        (-1e-5, "changed"),
        (-1.0101e-5, "worse"),
        (float("nan"), "worse"),
        (float("inf"), "worse"),
        (None, "missing"),
    ],
)
def test_a_value_is_held_against_its_baseline(value: float | None, status: str) -> None:
    (verdict,) = judged(value)
    assert (verdict.engine, verdict.quantity, verdict.status) == ("exudyn", "short_error", status)
    assert verdict.passes == (status in ("holds", "better"))


def test_an_improvement_needs_another_version_or_other_settings() -> None:
    changes: list[dict[str, Any]] = [{"version": "1.1"}, {"settings": SETTINGS | {"step": 0.0005}}]
    for change in changes:
        (verdict,) = judged(0.9899e-5, **change)
        assert (verdict.status, verdict.passes) == ("better", True)
        # The other sign at the same size is no improvement.
        (verdict,) = judged(-1e-5, **change)
        assert (verdict.status, verdict.passes) == ("changed", False)


def test_what_an_engine_never_gave_is_not_judged_and_what_is_new_is_missing() -> None:
    assert [verdict.quantity for verdict in judged(1e-5)] == ["short_error"]
    verdicts = judge("exudyn", {"short_error": 1e-5, "max_slip": 1e-9}, ENTRY, ALLOWED, SETTINGS, "1.0")
    assert [(verdict.quantity, verdict.status) for verdict in verdicts] == [
        ("short_error", "holds"),
        ("max_slip", "missing"),
    ]


def test_an_engine_without_a_baseline_fails() -> None:
    (verdict,) = judged(1e-5, entry=None)
    assert (verdict.engine, verdict.passes) == ("exudyn", False)
    assert "no baseline" in verdict.reason


def test_a_failure_says_what_else_changed() -> None:
    (verdict,) = judged(2e-5, settings=SETTINGS | {"step": 0.002}, version="1.1")
    assert "step 0.001 -> 0.002" in verdict.reason
    assert "version 1.0 -> 1.1" in verdict.reason
    (verdict,) = judged(2e-5)
    assert "same version and settings" in verdict.reason


def test_verdicts_are_json() -> None:
    rows = [verdict.as_json() for verdict in [*judged(1e-5), missing("ghost", "did not run: gone")]]
    assert json.loads(json.dumps(rows, allow_nan=False)) == rows
    assert [row["passes"] for row in rows] == [True, False]


def test_quantities_keep_their_signs() -> None:
    rates = {"radius_drift_rate": -1e-6, "phase_drift_rate": 2e-6, "rear_rate_drift_rate": -3e-6}
    measured = rates | {"energy_drift": 1e-8, "max_slip": None, "mean_slip": None}
    found = quantities(measured, 5e-6)
    assert found == {
        "short_error": 5e-6,
        "radius_drift_rate": -1e-6,
        "phase_drift_rate": 2e-6,
        "rear_rate_drift_rate": -3e-6,
        "energy_drift": 1e-8,
        "max_slip": None,
        "mean_slip": None,
    }
    # Every quantity has a limit, or it would never be judged.
    assert set(found) == set(limits(SCALE, 1e-10, 1))
