"""The gate's arithmetic: limits scale as derived, and no change of the wrong kind passes."""

from __future__ import annotations

import json
from typing import Any

import pytest

from velodrome.scenarios.gate.verdict import (
    BELOW_NOISE,
    CHANGES,
    HELD_CPU,
    NEW,
    Verdict,
    count_held,
    count_statuses,
    find_outcome,
    judge_sample,
    missing_verdict,
)

SETTINGS = {"step": 0.001, "tolerance": 1e-10}
ENTRY = {"version": "1.0", "settings": SETTINGS, "quantities": {"short_error": 1e-5, "max_slip": None}}
ALLOWED = {"short_error": 1e-7, "max_slip": 1e-6}


def judged(value: float | None, entry: dict[str, Any] | None = ENTRY, **changes: Any) -> list[Verdict]:
    """Verdicts on quantities."""
    values = {"short_error": value, "max_slip": None}
    run = {"settings": SETTINGS, "version": "1.0"} | changes
    return of_quantities(judge_sample("exudyn", values, entry, ALLOWED, run["settings"], run["version"]))


def of_quantities(verdicts: list[Verdict]) -> list[Verdict]:
    return [verdict for verdict in verdicts if verdict.quantity != CHANGES]


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
    verdicts = judge_sample("exudyn", {"short_error": 1e-5, "max_slip": 1e-9}, ENTRY, ALLOWED, SETTINGS, "1.0")
    assert [(verdict.quantity, verdict.status) for verdict in verdicts] == [
        ("short_error", "holds"),
        ("max_slip", "missing"),
    ]


def test_an_engine_without_a_baseline_is_new_and_does_not_pass() -> None:
    (verdict,) = judged(1e-5, entry=None)
    assert (verdict.engine, verdict.status, verdict.passes) == ("exudyn", NEW, False)
    assert "no baseline" in verdict.reason
    # Where a release was to give one, it is missing.
    (verdict,) = judge_sample("exudyn", {}, None, {}, SETTINGS, "1.0", absent="no baseline: it broke")
    assert (verdict.status, verdict.passes, verdict.reason) == ("missing", False, "no baseline: it broke")


def test_a_release_is_named_in_the_place_of_a_baseline() -> None:
    (verdict,) = judged(2e-5, entry=ENTRY | {"release": "exudyn 1.0"})
    assert verdict.reason.endswith("; same version and settings as exudyn 1.0")
    (verdict,) = judged(2e-5, entry=ENTRY | {"release": "exudyn 1.0"}, version="1.1")
    assert verdict.reason.endswith("; since exudyn 1.0: version 1.0 -> 1.1")


def test_counts_say_what_does_not_hold_and_leave_out_what_is_not_judged() -> None:
    def of(*statuses: str) -> list[Verdict]:
        return [Verdict("exudyn", "max_slip", 1.0, 1.0, 1.0, status, "") for status in statuses]

    change = Verdict("exudyn", CHANGES, None, None, None, "holds", "version 1.0 -> 1.1")
    verdicts = [change, *of("holds", "shown", "better", "better")]
    assert (count_held(verdicts), count_statuses(verdicts), find_outcome(verdicts)) == ("1 of 3", "2 improved", "holds")
    verdicts += of("worse", NEW)
    assert (count_held(verdicts), find_outcome(verdicts)) == ("1 of 4", "fails")
    assert count_statuses(verdicts) == "1 worse, 1 new, 2 improved"
    assert count_statuses(verdicts, failing=True) == "1 worse, 1 new"
    assert (count_held(of(NEW)), find_outcome(of(NEW, "better", "holds"))) == ("", NEW)


def test_a_failure_says_what_else_changed() -> None:
    (verdict,) = judged(2e-5, settings=SETTINGS | {"step": 0.002}, version="1.1")
    assert "step 0.001 -> 0.002" in verdict.reason
    assert "version 1.0 -> 1.1" in verdict.reason
    (verdict,) = judged(2e-5)
    assert "same version and settings" in verdict.reason


def test_verdicts_are_json() -> None:
    rows = [verdict.as_json() for verdict in [*judged(1e-5), missing_verdict("ghost", "did not run: gone")]]
    assert json.loads(json.dumps(rows, allow_nan=False)) == rows
    assert [row["passes"] for row in rows] == [True, False]


@pytest.mark.parametrize(
    ("value", "before", "status"),
    [
        (None, 0.48, "changed"),
        (0.48, None, "worse"),
        (0.47, 0.48, "worse"),
        (0.49, 0.48, "changed"),
        (0.4801, 0.48, "holds"),
    ],
)
def test_an_earlier_fall_is_worse_and_one_that_is_new_too(
    value: float | None, before: float | None, status: str
) -> None:
    entry = ENTRY | {"quantities": {"fell_at": before}}
    (verdict,) = judge_sample("exudyn", {"fell_at": value}, entry, {"fell_at": 1e-3}, SETTINGS, "1.0")
    assert (verdict.status, verdict.passes) == (status, status == "holds")
    (verdict,) = of_quantities(judge_sample("exudyn", {"fell_at": value}, entry, {"fell_at": 1e-3}, SETTINGS, "1.1"))
    assert verdict.status == ("better" if status == "changed" else status)


def test_a_lower_order_is_worse() -> None:
    entry = ENTRY | {"quantities": {"observed_order": 2.0}}
    found = {}
    for value in (1.0, 1.995, 1.9, 4.0):
        _, verdict = judge_sample("exudyn", {"observed_order": value}, entry, {"observed_order": 0.01}, SETTINGS, "1.1")
        found[value] = verdict.status
    # 1.9 is an order of two as well, of another version; of the same it is a fault.
    assert found == {1.0: "worse", 1.995: "holds", 1.9: "holds", 4.0: "better"}
    (verdict,) = judge_sample("exudyn", {"observed_order": 1.9}, entry, {"observed_order": 0.01}, SETTINGS, "1.0")
    assert verdict.status == "worse"


def test_another_number_of_steps_is_neither_worse_nor_better() -> None:
    entry = ENTRY | {"quantities": {"steps": 3000}}
    for value, status in ((3001, "holds"), (1500, "changed"), (6000, "changed")):
        _, verdict = judge_sample("exudyn", {"steps": value}, entry, {"steps": 1.0}, SETTINGS, "1.1")
        assert verdict.status == status


def test_what_this_run_cannot_tell_from_noise_is_missing() -> None:
    entry = ENTRY | {"quantities": {"observed_order": 2.0}}
    (verdict,) = judge_sample("exudyn", {"observed_order": None}, entry, {"observed_order": None}, SETTINGS, "1.0")
    assert (verdict.status, verdict.share) == ("missing", None)
    arguments = ("exudyn", {"observed_order": None}, entry, {"observed_order": None}, SETTINGS)
    # Errors that another version has brought below the noise are an improvement; of the same it is a fault.
    for version, status in (("1.0", "missing"), ("1.1", "better")):
        verdict = judge_sample(*arguments, version, {"observed_order": BELOW_NOISE})[-1]
        assert verdict.status == status
        assert verdict.reason.startswith(BELOW_NOISE)
    verdict = judge_sample(*arguments, "1.1", {"observed_order": "a step that does not divide"})[-1]
    assert (verdict.status, "a step that does not divide" in verdict.reason) == ("missing", True)


def test_other_settings_are_told_even_if_all_holds() -> None:
    change, held = judge_sample(
        "exudyn", {"short_error": 1e-5}, ENTRY, {"short_error": 1e-7}, SETTINGS | {"step": 2}, "1.0"
    )
    assert (change.quantity, change.status, change.passes) == (CHANGES, "holds", True)
    assert "step 0.001 -> 2" in change.reason
    assert held.status == "holds"


def test_the_baselines_date_is_told() -> None:
    (verdict,) = judged(2e-5, entry=ENTRY | {"created": "2026-01-31"})
    assert verdict.reason.endswith("same version and settings as the baseline of 2026-01-31")
    assert verdict.share == pytest.approx(100)


def test_what_is_shown_is_not_judged() -> None:
    entry = ENTRY | {"quantities": ENTRY["quantities"] | {"required_friction": 0.5}}
    values = {"short_error": 1e-5, "required_friction": 0.9, "cpu_ratio": 30.0}
    verdicts = judge_sample("exudyn", values, entry, ALLOWED, SETTINGS, "1.0")
    shown = {verdict.quantity: verdict for verdict in verdicts if verdict.status == "shown"}
    assert set(shown) == {"required_friction", "cpu_ratio"}
    assert all(verdict.passes and not verdict.moved and not verdict.told for verdict in shown.values())
    assert shown["required_friction"].reason == "0.5 -> 0.9, not judged"
    assert shown["cpu_ratio"].reason == "30, not judged"


@pytest.mark.parametrize(("value", "status"), [(0.1, "holds"), (1.9, "holds"), (2.1, "worse")])
def test_less_cpu_time_is_no_fault(value: float, status: str) -> None:
    entry = ENTRY | {"quantities": {HELD_CPU: 1.0}}
    (verdict,) = judge_sample("exudyn", {HELD_CPU: value}, entry, {HELD_CPU: 0.5 * value}, SETTINGS, "1.0")
    assert verdict.status == status
