"""The pages of studies: whole, escaped, without a script, their figures those of the documents."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import headless_page as headless
import numpy as np
import pytest
import test_history_page
import test_league_page
from parsed_page import Parsed, check_static_page

from velodrome.engines.engine import REFERENCE
from velodrome.reports.page import (
    make_diff_page,
    make_gate_page,
    make_history_page,
    make_league_page,
    make_precision_page,
    make_ride_pair_page,
    make_sweep_page,
)
from velodrome.reports.page.gate import SIGNS
from velodrome.reports.page.tables import format_after_upright
from velodrome.reports.page.timelines import LinearAxis, draw_over_time, draw_over_values

HOSTILE = "<script>alert(1)</script>"
MACHINE = {"libraries": {"velodrome": "0.1.0", HOSTILE: HOSTILE}, "platform": {"system": HOSTILE}}


# Two runs.


def engine_difference(largest: float, **more: Any) -> dict[str, Any]:
    position = {"max": largest, "end": largest, "end_limit": 1e-9, "begins_at": 0.5 if largest else None}
    position |= {"exceeds_at": 0.75 if largest > 1e-9 else None, "horizon": None}
    field = {"column": "lean", "unit": "rad", "max": largest, "max_at": 1.0, "allowed": 1e-9, "exceeds_at": None}
    error = {"before": 1e-3, "after": 2e-3, "change": 1e-3, "limit": 1e-9, "holds": False}
    listed = {"before": [], "after": [HOSTILE], "change": None, "limit": None, "holds": None}
    return {
        "version": ["1", "2"],
        "settings": {HOSTILE: [1.0, None]},
        "position_difference": position,
        "fields": {"coordinates": field, "gap": {"only_in": "after"}},
        "metrics": {"position_error.max": error, "adaptations": listed},
        "cpu_time": {"before": 1.0, "after": 2.0, "ratio": 2.0},
        "verdict": "differs" if largest > 1e-9 else "same to the bit",
        "reasons": [HOSTILE] if largest > 1e-9 else [],
    } | more


def diff_document() -> dict[str, Any]:
    missing = dict.fromkeys(("position_difference", "cpu_time")) | {"fields": {}, "metrics": {}}
    return {
        "scenario": HOSTILE,
        "title": HOSTILE,
        "duration": 2.0,
        "growth_rate": -0.1,
        "runs": [
            {"name": name, "created": "2026-01-02T03:04:05+00:00", "complete": name != "b"} for name in ("a", "b")
        ],
        "differs": {"libraries": {HOSTILE: [None, "2"]}, "platform": {}},
        "engines": {
            REFERENCE: engine_difference(0.0),
            "moved": engine_difference(0.025),
            "fallen": engine_difference(7.0),
            HOSTILE: engine_difference(1.0, **missing),
        },
        "only_before": [HOSTILE],
        "only_after": [],
        "same": False,
        "notes": [HOSTILE],
    }


def diff_page(**changes: Any) -> str:
    time = np.linspace(0.0, 2.0, 201)
    distances = {
        REFERENCE: (time, np.zeros(201)),
        "moved": (time, 0.0125 * time),
        "fallen": (time[:51], 7.0 * time[:51]),
    }
    document = diff_document() | changes
    distances = {name: found for name, found in distances.items() if name in document["engines"]}
    stops = {"fallen": "fell at 0.50 s"}
    remarks = {"moved": [HOSTILE]}
    return make_diff_page(document, distances, remarks, stops, MACHINE)


def test_two_runs_are_told_by_how_far_they_moved() -> None:
    parsed = check_static_page(diff_page(), HOSTILE)
    (headline,) = [text for attrs, text in parsed.all("p") if attrs.get("class") == "headline"]
    assert headline.startswith("Differs by more than round-off: fallen (by up to 7 m), ")
    assert "moved (by up to 0.025 m)" in headline
    assert headline.endswith(f"The same within round-off: {REFERENCE}.")
    cells = [text for _, text in parsed.all("td")]
    assert "✕ fell at 0.50 s" in cells
    assert "0.025" in cells
    # The ride that fell has no place in the axis of the others: a decade above the largest of theirs is its end.
    assert "10 -1" in [
        text.replace("10", "10 ", 1) for attrs, text in parsed.all("span") if attrs.get("class") == "tick y"
    ]
    assert "100" not in [text for attrs, text in parsed.all("span") if attrs.get("class") == "tick y"]
    same = Parsed(diff_page(same=True, engines={REFERENCE: engine_difference(0.0)}))
    assert "The engines in both runs are the same within round-off." in " ".join(text for _, text in same.all("li"))


def test_sizes_over_time_follow_the_rides_that_stay_up() -> None:
    time = np.linspace(0.0, 3.0, 31)
    kept = {"a": (time, 1e-4 * np.ones(31)), "b": (time, 1e-4 * np.ones(31)), "zero": (time, np.zeros(31))}
    fallen = {"down": (time[:11], 1e9 * np.ones(11))}
    names = ["a", "b", "down", "zero"]
    alone, drawn = draw_over_time(kept, names, {}), draw_over_time(kept | fallen, names, {"down": "fell at 1.00 s"})
    assert alone is not None
    assert drawn is not None
    assert drawn["y"] == alone["y"]
    assert [tick["text"] for tick in drawn["x"]] == ["0", "0.5", "1", "1.5", "2", "2.5", "3"]
    lines = {line["engine"]: line for line in drawn["lines"]}
    assert lines[2]["stopped"] == "fell at 1.00 s"
    assert lines[2]["marks"][-1][1] < 0  # above the axis
    assert drawn["coinciding"] == [["a", "b"]]
    assert [lines[k]["turns"] for k in (0, 1)] == ["9 9", "9 9"]
    assert lines[0]["offset"] != lines[1]["offset"]
    assert 3 not in lines
    only = draw_over_time(fallen, names, {"down": "fell at 1.00 s"})
    assert only is not None
    assert [tick["power"] for tick in only["y"]] == [9, 10]
    assert draw_over_time({"zero": kept["zero"]}, names, {}) is None


@pytest.mark.parametrize("end", [1e-3, 0.7, 1.0, 5.0, 20.0, 333.0])
def test_a_time_axis_has_a_few_round_times(end: float) -> None:
    ticks = LinearAxis(0.0, end).ticks
    assert 3 <= len(ticks) <= 8
    assert all(0 <= tick["at"] <= 100 for tick in ticks)
    assert ticks[0]["text"] == "0"
    assert all(tick["at"] == pytest.approx(100 * float(tick["text"]) / end, rel=1e-4) for tick in ticks)


def test_what_fell_does_not_choose_a_columns_notation() -> None:
    assert format_after_upright([0.25, 1e9, 0.5], [True, False, True]) == ["0.25", "1.0e+09", "0.50"]
    assert format_after_upright([None, 1e9], [False, False]) == ["–", "1.0e+09"]


# Work and precision.


def precision_document() -> dict[str, Any]:
    def points(error: float) -> list[dict[str, Any]]:
        return [
            {"step": 0.004 / 2**k, "position_error": error / 4**k, "energy_drift": 1e-6, "max_slip": 1e-7}
            | {"contact_force_error": None, "cpu_time": 0.01 * 2**k, "horizon": None}
            for k in range(3)
        ]

    eigenvalues = {
        "values": [[-1.0, 2.0], [-1.0, -2.0], [0.5, 0.0]],
        "reference": [[-1.0, 2.0], [-1.0, -2.0], [0.5, 0.0]],
    }
    eigenvalues |= {"errors": [1e-9, 1e-9, 0.0], "error": 1e-9, "order": 2.0, "uncertainty": 1e-3}
    entry = {"failures": [], "observed_order": 2.001, "orders": [2.001], "richardson_error": 1e-8, "ran": True}
    entry |= {"richardson_uncertainty": 2e-8, "window": 1.5, "eigenvalues": eigenvalues}
    failed = dict.fromkeys(entry) | {"points": [], "orders": [], "ran": False}
    failed |= {"failures": [{"step": 0.002, "reason": HOSTILE}, {"step": None, "reason": "no eigenvalues"}]}
    return {
        "scenario": HOSTILE,
        "bicycle": {"name": HOSTILE, "parameters": {}},
        "warnings": [HOSTILE],
        "duration": 2.0,
        "horizon": 1.5,
        "growth_rate": 0.4,
        "engines": {
            REFERENCE: entry | {"points": points(1e-9)},
            "near": entry | {"points": points(1.2e-4)},
            "far": entry | {"points": points(1.0), "observed_order": 1.0, "orders": [1.0]},
            HOSTILE: failed,
        },
        "libraries": {"velodrome": "0.1.0", HOSTILE: HOSTILE},
    }


def test_a_precision_page_tells_who_comes_closest_and_the_orders() -> None:
    parsed = check_static_page(make_precision_page(precision_document()), HOSTILE)
    (headline,) = [text for attrs, text in parsed.all("p") if attrs.get("class") == "headline"]
    assert headline.startswith("near comes closest: 7.5e-06 m from the reference, with steps of 0.001 s.")
    assert "Observed order: near 2.00, far 1.00." in headline
    assert f"No order is seen of {HOSTILE}." in headline
    cells = [text for _, text in parsed.all("td")]
    assert "-1 + 2i" in cells
    assert "-1 − 2i" in cells
    assert "0.5" in cells
    assert [text for _, text in parsed.all("th")].count("0.00100") == 3  # the finest step of each engine that rode
    said = [text for _, text in parsed.all("li")]
    assert f"✕ step 0.002 s: {HOSTILE}" in said
    assert "✕ no eigenvalues" in said
    empty = precision_document()
    empty["engines"] = {HOSTILE: empty["engines"][HOSTILE]}
    assert not check_static_page(make_precision_page(empty), HOSTILE).all("figure")


# The gate.


def gate_verdicts() -> list[dict[str, Any]]:
    def verdict(engine: str, quantity: str, status: str, value: float | None = 1.0) -> dict[str, Any]:
        numbers = {"value": value, "baseline": 1.0, "limit": 0.5} if value is not None else {}
        found = {"scenario": HOSTILE, "engine": engine, "quantity": quantity, "status": status, "reason": HOSTILE}
        found |= {"passes": status in ("holds", "better", "shown")}
        return found | dict.fromkeys(("value", "baseline", "limit")) | numbers

    return [
        verdict("one", "settings", "holds", None),
        verdict("one", "position_error", "holds", 1.25),
        verdict("one", "max_slip", "better", 0.25),
        verdict("one", "cpu_ratio", "shown"),
        verdict("two", "position_error", "worse", 3.0),
        verdict("two", "max_slip", "changed", 2.0),
        verdict(HOSTILE, "run", "missing", None),
        verdict("new", "run", "new", None),
    ]


def gate_page() -> str:
    verdicts = gate_verdicts()
    told = [row for row in verdicts if row["status"] not in ("holds", "shown") or row["quantity"] == "settings"]
    return make_gate_page("fails", HOSTILE, verdicts, told, {HOSTILE: HOSTILE}, MACHINE["libraries"])


def test_the_gates_page_puts_the_worst_first() -> None:
    parsed = check_static_page(gate_page(), HOSTILE)
    assert {verdict["status"] for verdict in gate_verdicts()} == set(SIGNS)
    marks = [text.split()[0] for attrs, text in parsed.all("li") if attrs.get("class") in ("short", "remark", "holds")]
    assert marks == ["✗", "✗", "≠", "•", "+", "!", "–"]
    cells = [text for _, text in parsed.all("td")]
    assert "✗worseposition error 4" in cells  # of the engine; it moved by 2 against a limit of 0.5
    assert "+improvedmax slip 1.5" in cells
    table = cells[cells.index("run") :]  # the worst of all quantities is the one that is missing
    assert [row[-1] for row in zip(*[iter(table)] * 6, strict=False)][:4] == [
        "✗ missing",
        "✗ worse",
        "≠ changed",
        "• new",
    ]
    assert "settings" not in cells


# A sweep.


def sweep_document() -> dict[str, Any]:
    def entry(median: float | None, worst: float | None, **rows: int) -> dict[str, Any]:
        error = None if median is None else {"median": median, "worst": worst}
        return {"rows": rows, "position_error": error, "rows_per_second": 2.0, "reasons": []}

    return {
        "sweep": HOSTILE,
        "title": HOSTILE,
        "folder": HOSTILE,
        "tasks": 30,
        "missing": 0,
        "complete": True,
        "stopped": None,
        "engines": {
            REFERENCE: entry(None, None, done=10),
            "near": entry(1e-6, 2e-6, done=10),
            "far": entry(1e-2, 7.0, done=6, fell=4) | {"reasons": [f"failed: {HOSTILE}"]},
        },
    }


def sweep_page() -> str:
    values = np.array([0.0, 1.0, 2.0])
    errors = {
        HOSTILE: {"near": (values, np.array([1e-6, 2e-6, 1e-6])), "far": (values, np.array([1e-2, 2e-2, 1e-2]))},
        "step": {"near": (np.array([1e-4, 1e-2]), np.array([1e-8, 1e-4]))},
        "alone": {"near": (np.array([1.0]), np.array([1e-8]))},
    }
    return make_sweep_page(sweep_document(), errors, MACHINE["libraries"])


def test_a_sweeps_page_tells_who_drifts_and_what_fell() -> None:
    parsed = check_static_page(sweep_page(), HOSTILE)
    (headline,) = [text for attrs, text in parsed.all("p") if attrs.get("class") == "headline"]
    assert headline == (
        "far drifts most: 0.01 m from the reference in half of its rides. near stays closest: 1e-06 m. "
        "far: 4 fell of 10."
    )
    assert len(parsed.all("figure")) == 2  # a parameter with one value has none
    assert f"✗ far: failed: {HOSTILE}" in [text for _, text in parsed.all("li")]


def test_values_of_two_decades_have_a_logarithmic_axis() -> None:
    sizes = np.array([1e-8, 1e-6, 1e-4])
    linear = draw_over_values({"a": (np.array([-1.0, 0.0, 1.0]), sizes)}, ["a"])
    decades = draw_over_values({"a": (np.array([1e-4, 1e-3, 1e-2]), sizes)}, ["a"])
    assert linear is not None
    assert decades is not None
    assert [tick["text"] for tick in linear["x"]] == ["-1", "-0.5", "0", "0.5", "1"]
    assert [tick["power"] for tick in decades["x"]] == [-4, -3, -2]
    assert [x for x, _ in linear["lines"][0]["marks"]] == [x for x, _ in decades["lines"][0]["marks"]] == [0, 50, 100]
    assert draw_over_values({"a": (np.array([1.0, 1.0]), sizes[:2])}, ["a"]) is None
    assert draw_over_values({}, []) is None


# All of the family, in a browser.

PAGES: dict[str, Callable[[], str]] = {
    "diff": diff_page,
    "gate": gate_page,
    "precision": lambda: make_precision_page(precision_document()),
    "sweep": sweep_page,
    "league": lambda: make_league_page(test_league_page.document()),
    "history": lambda: make_history_page(test_history_page.document()),
    "pair": lambda: make_ride_pair_page(test_history_page.pair(), "../history.html"),
}


@pytest.mark.slow
@pytest.mark.skipif(headless.missing_axe() is not None, reason=str(headless.missing_axe()))
@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("name", list(PAGES))
def test_the_pages_can_be_used_by_everyone(name: str, dark: bool, tmp_path: Path) -> None:
    assert headless.find_violations(PAGES[name](), tmp_path, dark) == []


@pytest.mark.slow
@pytest.mark.skipif(headless.missing() is not None, reason=str(headless.missing()))
@pytest.mark.parametrize("name", list(PAGES))
def test_the_pages_fit_a_narrow_window(name: str, tmp_path: Path) -> None:
    # Chromium's own window is at least 500 pixels wide.
    script = "return document.documentElement.scrollWidth;"
    assert headless.examine(PAGES[name](), script, tmp_path, size=(500, 900)) <= 500
