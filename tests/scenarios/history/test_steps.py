"""Verdicts between two releases, and the bisection that needs few of them."""

from __future__ import annotations

from itertools import pairwise
from math import ceil, log2
from types import SimpleNamespace
from typing import Any

import pytest

from velodrome.scenarios.gate import BELOW_NOISE
from velodrome.scenarios.history.bisect import bisect_history
from velodrome.scenarios.history.document import make_history_document
from velodrome.scenarios.history.plan import HistoryPlan, PlannedRide
from velodrome.scenarios.history.releases import Release
from velodrome.scenarios.history.verdicts import judge_step


def row(bits: str = "a", **changes: Any) -> dict[str, Any]:
    """A row of a ride, in which an error of 1e-3 has a limit of 1e-6."""
    quantities = {"position_error": 1e-3, "observed_order": 2.0, "energy_drift": 1e-5, "report_mismatch": 0.1}
    found = {
        "status": "rode",
        "reason": None,
        "version": "1",
        "settings": {"step": 0.001},
        "bits": bits,
        "quantities": quantities | changes.pop("quantities", {}),
        "limits": {"position_error": 1e-6, "observed_order": 0.1, "energy_drift": 1e-9, "report_mismatch": 1.0},
        "reasons": {},
    }
    return found | changes


@pytest.mark.parametrize(
    ("quantities", "status", "moved"),
    [
        ({}, "round-off", []),
        ({"position_error": 1e-3 + 0.9e-6}, "round-off", []),
        ({"position_error": 1e-3 + 2e-6}, "worse", ["position_error"]),
        ({"position_error": 1e-4}, "better", ["position_error"]),
        ({"observed_order": 4.0, "position_error": 1e-6}, "better", ["position_error", "observed_order"]),
        ({"observed_order": 4.0, "position_error": 2e-3}, "changed", ["position_error", "observed_order"]),
        ({"energy_drift": -1e-5}, "changed", ["energy_drift"]),
        ({"energy_drift": None}, "changed", ["energy_drift"]),
        ({"report_mismatch": 3.0}, "worse", ["report_mismatch"]),
        ({"report_mismatch": 0.9}, "round-off", []),
    ],
)
def test_a_step_is_judged_by_the_limits_of_the_gate(quantities: dict[str, Any], status: str, moved: list[str]) -> None:
    found = judge_step(row("a"), row("b", quantities=quantities))
    assert found is not None
    assert (found.status, sorted(move.quantity for move in found.moves)) == (status, sorted(moved))
    assert found.moved == bool(moved)


def test_the_other_way_round_the_verdict_is_the_opposite() -> None:
    better = row("b", quantities={"position_error": 1e-6, "observed_order": 4.0})
    found = judge_step(better, row("a"))
    assert found is not None
    assert found.status == "worse"


def test_an_error_that_rises_out_of_the_noise_is_worse_and_one_that_sinks_into_it_better() -> None:
    quiet = row("b", quantities={"observed_order": None}, reasons={"observed_order": BELOW_NOISE})
    sunk, risen = judge_step(row("a"), quiet), judge_step(quiet, row("a"))
    assert sunk is not None
    assert risen is not None
    assert (sunk.status, risen.status) == ("better", "worse")


def test_equal_bits_are_equal_whatever_else() -> None:
    found = judge_step(row("a"), row("a"))
    assert found is not None
    assert found.status == "same-bits"


@pytest.mark.parametrize(
    ("before", "after", "status"),
    [
        ("rode", "failed", "worse"),
        ("rode", "refused", "worse"),
        ("failed", "rode", "changed"),
        ("failed", "refused", None),
        ("not-installable", "rode", None),
        ("rode", "not-installable", None),
    ],
)
def test_a_release_that_does_not_ride(before: str, after: str, status: str | None) -> None:
    found = judge_step(row("a", status=before), row("b", status=after))
    assert (None if found is None else found.status) == status


def plan_of(count: int, engines: tuple[str, ...] = ("one", "two")) -> HistoryPlan:
    releases = tuple(Release("mill", f"1.{place}") for place in range(count))
    scenarios: Any = {"circle": SimpleNamespace(title="A circle")}
    rides = tuple(PlannedRide(release, engine, "circle", "", "", "") for release in releases for engine in engines)
    return HistoryPlan("mill", releases, engines, scenarios, rides)


def ride_as(plan: HistoryPlan, errors: dict[str, list[float | None]], asked: list[PlannedRide]):
    """Answer for releases: an error for each, None for one that is not installable."""

    def ride(rides):
        asked.extend(rides)
        found = {}
        for one in rides:
            error = errors[one.engine][plan.releases.index(one.release)]
            found[one] = (
                {"status": "not-installable", "reason": "no wheel"}
                if error is None
                else row(str(error), quantities={"position_error": error})
            )
        return found

    return ride


@pytest.mark.parametrize("turn", range(1, 20))
def test_bisection_finds_the_one_between_in_few_releases(turn: int) -> None:
    plan, asked = plan_of(20), list[PlannedRide]()
    two: list[float | None] = [1e-3 if place < turn else 1e-2 for place in range(20)]
    errors: dict[str, list[float | None]] = {"one": [1e-3] * 20, "two": two}
    rows = bisect_history(plan, ride_as(plan, errors, asked))
    document = make_history_document(plan, rows, complete=True, bisected=True)
    (point,) = document["turning_points"]
    assert (point["version"], point["since"], point["engine"]) == (f"1.{turn}", f"1.{turn - 1}", "two")
    assert len(asked) == len(set(asked)), "a ride was asked for twice"
    assert len({one.release for one in asked}) <= 2 + ceil(log2(19))
    # The engine in which nothing moved rides at both ends alone.
    assert sum(one.engine == "one" for one in asked) == 2


def test_bisection_finds_several_turning_points_and_passes_by_what_is_not_installable() -> None:
    plan, asked = plan_of(12, ("one",)), list[PlannedRide]()
    values: list[float | None] = [1e-3, 1e-3, 2e-3, 2e-3, 2e-3, None, None, 2e-3, 2e-3, 5e-3, 5e-3, 5e-3]
    rows = bisect_history(plan, ride_as(plan, {"one": values}, asked))
    points = make_history_document(plan, rows, complete=True, bisected=True)["turning_points"]
    assert [(point["since"], point["version"]) for point in points] == [("1.1", "1.2"), ("1.8", "1.9")]


def test_bisection_of_equal_ends_rides_nothing_between() -> None:
    plan, asked = plan_of(9, ("one",)), list[PlannedRide]()
    bisect_history(plan, ride_as(plan, {"one": [1e-3] * 9}, asked))
    assert [one.release.version for one in asked] == ["1.0", "1.8"]


@pytest.mark.parametrize("count", [1, 2])
def test_bisection_of_one_or_two_releases(count: int) -> None:
    plan, asked = plan_of(count, ("one",)), list[PlannedRide]()
    rows = bisect_history(plan, ride_as(plan, {"one": [1e-3, 1e-2]}, asked))
    assert len(rows) == count


def test_a_release_is_judged_against_the_last_one_that_could_be_installed() -> None:
    plan = plan_of(3, ("one",))
    values: list[float | None] = [1e-3, None, 2e-3]
    rows = ride_as(plan, {"one": values}, [])(plan.rides)
    document = make_history_document(plan, rows, complete=True, bisected=False)
    assert [entry["since_previous"] for entry in document["releases"]] == [None, None, "worse"]
    assert document["releases"][2]["compared_with"] == "1.0"
    assert document["releases"][1]["reason"] == "no wheel"


def judge_rows(*rows: dict[str, Any]) -> dict[str, Any]:
    """The document of releases of one engine, of which the first is 1.0."""
    plan = plan_of(len(rows), ("one",))
    return make_history_document(plan, dict(zip(plan.rides, rows, strict=True)), complete=True, bisected=False)


FAILED = {"status": "failed", "reason": "it broke"}
WORSE_RIDE = row("b", quantities={"position_error": 2e-3})


def names_of(point: dict[str, Any]) -> list[str]:
    return [move["quantity"] for move in point["quantities"]]


def test_what_moved_behind_a_release_that_failed_is_named() -> None:
    document = judge_rows(row(), FAILED, WORSE_RIDE)
    assert [(one["compared_with"], one["since_previous"], one["changed"]) for one in document["releases"]] == [
        (None, None, []),
        ("1.0", "worse", ["run"]),
        ("1.0", "worse", ["run", "position_error"]),
    ]
    broken, fixed = document["turning_points"]
    assert (broken["since"], broken["verdict"], broken["page"]) == ("1.0", "worse", None)
    assert (fixed["since"], fixed["verdict"], names_of(fixed)) == ("1.0", "worse", ["run", "position_error"])
    assert fixed["quantities"][0]["status"] == "better"
    assert fixed["page"] == "rides/one-circle-1.0-1.2.html"


def test_a_release_that_rides_again_as_before_is_told_and_is_not_better() -> None:
    document = judge_rows(row(), FAILED, {**FAILED, "status": "refused"}, row())
    assert [one["since_previous"] for one in document["releases"]] == [None, "worse", None, "same-bits"]
    point = document["turning_points"][-1]
    assert (point["since"], point["verdict"], names_of(point), point["page"]) == ("1.0", "same-bits", ["run"], None)


def test_the_first_release_that_rides_is_not_better() -> None:
    document = judge_rows(FAILED, {**FAILED, "status": "not-installable"}, row(), row("c", status="rode"))
    assert [one["since_previous"] for one in document["releases"]] == [None, None, "changed", "round-off"]
    (point,) = document["turning_points"]
    assert (point["since"], point["verdict"], names_of(point), point["page"]) == ("1.0", "changed", ["run"], None)


def drift(*errors: float) -> list[dict[str, Any]]:
    """Rides whose error moves; its limit is 1e-6."""
    return [row(str(place), quantities={"position_error": error}) for place, error in enumerate(errors)]


def test_a_slow_drift_is_named_where_it_exceeds_the_limit_and_counted_once() -> None:
    rides = drift(*(1e-3 + 0.4e-6 * place for place in range(7)))
    document = judge_rows(*rides[:2], FAILED, *rides[2:])
    assert all("position_error" not in one["changed"] for one in document["releases"])
    first, second = document["gradual_moves"]
    # 3 * 0.4e-6 is the first sum beyond 1e-6; the next is counted from there on.
    assert (first["since"], first["release"], first["verdict"]) == ("1.0", "1.4", "worse")
    assert (second["since"], second["release"]) == ("1.4", "1.7")
    (move,) = first["quantities"]
    assert (move["before"], move["after"]) == (1e-3, 1e-3 + 1.2e-6)


def test_a_turning_point_of_one_quantity_does_not_hide_the_drift_of_another() -> None:
    rides = drift(1e-3, 1e-3 + 0.8e-6, 1e-3 + 1.6e-6)
    rides[1]["quantities"]["energy_drift"] = rides[2]["quantities"]["energy_drift"] = 2e-5
    document = judge_rows(*rides)
    assert [names_of(point) for point in document["turning_points"]] == [["energy_drift"]]
    (slow,) = document["gradual_moves"]
    assert (slow["since"], slow["release"], names_of(slow)) == ("1.0", "1.2", ["position_error"])


def test_what_a_single_release_moves_is_no_drift() -> None:
    document = judge_rows(*drift(1e-3, 1e-3 + 0.8e-6, 2e-3, 2e-3 + 0.8e-6))
    assert [point["release"] for point in document["turning_points"]] == ["1.2"]
    assert document["gradual_moves"] == []


@pytest.mark.parametrize(
    ("missing", "turn"), [((0,), 3), ((11,), 3), ((0, 1, 10, 11), 5), ((0, 1, 2, 3, 4), 6), ((0, 11), 1)]
)
def test_bisection_replaces_ends_that_are_not_installable(missing: tuple[int, ...], turn: int) -> None:
    plan, asked = plan_of(12, ("one",)), list[PlannedRide]()
    values = [None if place in missing else 1e-3 if place < turn else 2e-3 for place in range(12)]
    rows = bisect_history(plan, ride_as(plan, {"one": values}, asked))
    points = make_history_document(plan, rows, complete=True, bisected=True)["turning_points"]
    there = [place for place in range(12) if place not in missing]
    expected = [(f"1.{one}", f"1.{two}") for one, two in pairwise(there) if one < turn <= two]
    assert [(point["since"], point["version"]) for point in points] == expected
    assert len(asked) == len(set(asked)), "a ride was asked for twice"


@pytest.mark.parametrize("count", [1, 2, 3])
def test_bisection_where_nothing_is_installable_ends(count: int) -> None:
    plan, asked = plan_of(count, ("one",)), list[PlannedRide]()
    assert len(bisect_history(plan, ride_as(plan, {"one": [None] * count}, asked))) == count


def test_a_bisection_finds_what_moved_behind_failures() -> None:
    plan, asked = plan_of(12, ("one",)), list[PlannedRide]()
    rows = [row() if place < 4 else FAILED if place < 7 else WORSE_RIDE for place in range(12)]

    def ride(rides):
        asked.extend(rides)
        return {one: rows[plan.releases.index(one.release)] for one in rides}

    document = make_history_document(plan, bisect_history(plan, ride), complete=True, bisected=True)
    assert [(one["since"], one["release"], names_of(one)) for one in document["turning_points"]] == [
        ("1.3", "1.4", ["run"]),
        ("1.3", "1.7", ["run", "position_error"]),
    ]
    assert document["remarks"] == []


def test_a_bisection_between_releases_that_do_not_ride_says_what_it_left_out() -> None:
    plan = plan_of(9, ("one",))
    found = bisect_history(plan, lambda rides: dict.fromkeys(rides, FAILED))
    document = make_history_document(plan, found, complete=True, bisected=True)
    assert len(document["releases"]) == 2
    (remark,) = document["remarks"]
    assert remark.startswith("one on circle: neither the first nor the last release rides")
