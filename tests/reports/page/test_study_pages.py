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
    make_atlas_page,
    make_bicycle_page,
    make_diff_page,
    make_families_page,
    make_gate_page,
    make_history_page,
    make_league_page,
    make_precision_page,
    make_ride_pair_page,
    make_sweep_page,
)
from velodrome.reports.page.curve_chart import draw_plane
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
    assert "The rides of the engines in both runs are the same within round-off." in " ".join(
        text for _, text in same.all("li")
    )


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
    assert "m" in cells  # the unit of the position error
    table = cells[cells.index("run") :]  # the worst of all quantities is the one that is missing
    assert [row[-1] for row in zip(*[iter(table)] * 7, strict=False)][:4] == [
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


# A bicycle.


def bicycle_document() -> dict[str, Any]:
    speeds = [0.0, 5.0, 10.0]
    eigenvalues = [[[3.0 - v, 2.0], [3.0 - v, -2.0], [v - 6.0, 0.0], [-20.0, 0.0]] for v in speeds]
    return {
        "name": HOSTILE,
        "convention": HOSTILE,
        "parameters": {"wheelbase": 1.02, "trail": 0.08},
        "uncertainties": {"wheelbase": 0.01, "trail": 0.0},
        "ignored": [HOSTILE],
        "warnings": [HOSTILE],
        "canonical": {name: [[1.0, 2.0], [3.0, 4.0]] for name in ("M", "C1", "K0", "K2")},
        "steer_damping": 0.0,
        "speeds": speeds,
        "eigenvalues": eigenvalues,
        "modes": {"names": ["weave", "weave", "capsize", "castering"], "eigenvalues": eigenvalues},
        "weave_speed": 3.0,
        "capsize_speed": 6.0,
        "speed_deviations": {"weave": 0.25, "capsize": None},
        "stability_changes": [
            {"mode": "weave", "speed": 3.0, "stabilises": True},
            {"mode": "capsize", "speed": 6.0, "stabilises": False},
        ],
        "stable_speeds": [[3.0, 6.0]],
    }


def bicycle_page(**changes: Any) -> str:
    units = {"wheelbase": "m", "trail": "m"}
    return make_bicycle_page(bicycle_document() | changes, units, MACHINE["libraries"])


def test_a_bicycles_page_tells_at_which_speeds_it_is_stable() -> None:
    page = bicycle_page()
    parsed = check_static_page(page, HOSTILE)
    (headline,) = [text for attrs, text in parsed.all("p") if attrs.get("class") == "headline"]
    assert headline == (
        "Upright riding is stable from 3 to 6 m/s. Weave becomes stable at 3 m/s; capsize becomes unstable at 6 m/s."
    )
    cells = [text for _, text in parsed.all("td", "dd")]
    assert {"3 ± 0.25 m/s", "6 m/s", "± 0.01", "–", "-2 + 2i", "-2 − 2i"} <= set(cells)
    keys = [text for _, text in parsed.all("li")]
    assert keys[-4:] == ["weave 1", "weave 2", "capsize", "castering"]
    assert '<rect class="band" x="30.0" y="0" width="30.0"' in page
    one = check_static_page(bicycle_page(speeds=[5.0], stable_speeds=[[3.0, None]]), HOSTILE)
    assert not one.all("figure")
    assert "Upright riding is stable above 3 m/s." in " ".join(text for _, text in one.all("p"))
    assert "at no speed" in bicycle_page(stable_speeds=[], stability_changes=[])


# Families of circular motions.


def families_document() -> dict[str, Any]:
    keys = ("rear_rate", "lean", "steer")
    points: dict[str, list[Any]] = {key: [0.0, 1.0, 2.0, 3.0] for key in keys}
    points |= {"lyapunov_stable": [False, True, True, False], "physical": [True, True, True, False]}
    ends = {key: [0.5, 2.5] for key in keys} | {"cause": ["hopf", HOSTILE]}
    special = dict.fromkeys((*keys, "front_rate"), 1.0) | {"kind": HOSTILE, "physical": False}
    family = {
        "family": 2,
        "joined_families": [4],
        "ends": [HOSTILE, "flat"],
        "points": points,
        "rideable_parts": [ends],
    }
    family |= {"stable_sections": [ends | {"rideable": "partly", "rideable_parts": [ends]}]}
    family |= {"special_points": {HOSTILE: special}}
    plain = family | {"family": None, "joined_families": [], "stable_sections": [], "special_points": {}}
    return {
        "alpha": None,
        "surface": {"kind": "sphere", "radius": 20.0},
        "bicycle": {"name": HOSTILE, "parameters": {}},
        "warnings": [HOSTILE],
        "inputs": {"steer_torque": 0.5, "steer_damping": 0.0},
        "families": [family, plain | {"rideable_parts": []}],
        "absent": {"1": HOSTILE},
    }


def families_page() -> str:
    return make_families_page(families_document(), MACHINE["libraries"])


def test_a_page_of_families_tells_what_is_stable_and_can_be_ridden() -> None:
    page = families_page()
    parsed = check_static_page(page, HOSTILE)
    (headline,) = [text for attrs, text in parsed.all("p") if attrs.get("class") == "headline"]
    assert headline == (
        "Lyapunov stable: families 2, 4 from a rear rate of 0.5 to 2.5 rad/s, of which a part can be ridden."
    )
    backwards = families_document()
    for family in backwards["families"]:
        for section in family["stable_sections"]:
            section["rear_rate"] = section["rear_rate"][::-1]
    assert headline in make_families_page(backwards, MACHINE["libraries"])
    said = [text for _, text in parsed.all("li")]
    assert f"• can be ridden: rear rate 0.5 rad/s (hopf) to 2.5 rad/s ({HOSTILE})" in said
    assert "• cannot be ridden" in said
    assert f"– family 1 has no curve: {HOSTILE}" in said
    assert page.count('class="strong"') == 2  # the stable section, in both figures
    assert [text for _, text in parsed.all("h2")][1:3] == ["families 2, 4", "curve 2"]
    assert "sphere, radius 20.0" in [text for _, text in parsed.all("dd")]
    none = families_document() | {"families": []}
    empty = check_static_page(make_families_page(none, MACHINE["libraries"]), HOSTILE)
    assert "No circular motion here is Lyapunov stable." in " ".join(text for _, text in empty.all("p"))


def test_curves_are_cut_at_gaps_and_at_the_box() -> None:
    x = np.array([0.0, 1.0, np.nan, 3.0, 4.0])
    spots = [("a", 1.0, 1.0, "in"), ("a", 9.0, 1.0, "out")]
    drawn = draw_plane({"a": (x, x)}, ["a"], box=(0.0, 4.0, 0.0, 4.0), spots=spots, bands=[(3.0, np.inf), (7.0, 8.0)])
    assert drawn["lines"][0]["path"] == "M0 100L25 75M75 25L100 0"
    assert [text for *_, text in drawn["spots"]] == ["in"]
    assert drawn["bands"] == [(75.0, 100.0)]
    free = draw_plane({"a": (x, x)}, ["a"])  # a margin of 3 %
    assert free["lines"][0]["path"].startswith(f"M{100 * 0.12 / 4.24:.5g} ")


# The atlas.


def atlas_document() -> dict[str, Any]:
    def side(*rates: float) -> dict[str, Any]:
        return {"rear_rate": list(rates), "cause": ["hopf", HOSTILE], "criticality": ["subcritical", None]}

    turn = {"side": "start", "alpha": 0.0075, "rear_rate": 14.25}
    region = {
        "family": 2,
        "bautin": [turn],
        "alpha": [0.0, 0.01],
        "start": side(15.0, 14.0),
        "end": side(20.0, 18.0),
        "vanishing": None,
    }
    tip = {"alpha": 0.015, "rear_rate": 11.0}
    return {
        "bicycle": {"name": HOSTILE, "parameters": {}},
        "warnings": [HOSTILE],
        "alphas": [0.0, 0.01, 0.02],
        "motions": 3000,
        "stable": [region, region | {"family": 4, "vanishing": tip}],
        "touching": [{"families": [2, 4], "alpha": 0.1, "rear_rate": 3.0}],
        "absent": [{"family": 1, "alpha": alpha, "reason": HOSTILE} for alpha in (0.01, 0.02)],
    }


def atlas_page() -> str:
    return make_atlas_page(atlas_document(), MACHINE["libraries"])


def test_an_atlas_page_tells_how_far_families_are_stable() -> None:
    page = atlas_page()
    parsed = check_static_page(page, HOSTILE)
    (headline,) = [text for attrs, text in parsed.all("p") if attrs.get("class") == "headline"]
    assert headline == (
        "Lyapunov stable motions: family 2 up to alpha 0.01 1/m at least; family 4 up to alpha 0.015 1/m."
    )
    said = [text for _, text in parsed.all("li")]
    assert "! families 2 and 4 touch at alpha 0.1 1/m, rear rate 3 rad/s" in said
    assert f"! family 1 was not followed in 2 of 3 bowls, alpha 0.01 to 0.02 1/m: {HOSTILE}" in said
    assert page.count('title="the last stable motion of family 4"') == 1
    assert page.count('title="Bautin point of family 2"') == 1
    assert (
        "! family 2: the start of its stable sections changes its criticality at alpha 0.0075 1/m, rear rate 14.25 "
        "rad/s (Bautin point)"
    ) in said
    assert f"subcritical Hopf point; then {HOSTILE}" in [text for _, text in parsed.all("td")]
    twice = atlas_document()
    twice["stable"].append(twice["stable"][1])
    names = [text for _, text in Parsed(make_atlas_page(twice, MACHINE["libraries"])).all("th")]
    assert [name for name in names if name.startswith("family ")] == [
        *("family 2", "family 4, region 1", "family 4, region 2")
    ]
    none = check_static_page(make_atlas_page(atlas_document() | {"stable": []}, MACHINE["libraries"]), HOSTILE)
    assert "No family has a Lyapunov stable motion." in [text for _, text in none.all("p")]
    assert not none.all("figure")


# All of the family, in a browser.

PAGES: dict[str, Callable[[], str]] = {
    "diff": diff_page,
    "gate": gate_page,
    "precision": lambda: make_precision_page(precision_document()),
    "sweep": sweep_page,
    "atlas": atlas_page,
    "bicycle": bicycle_page,
    "families": families_page,
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
def test_the_pages_fit_into_400_pixels(name: str, tmp_path: Path) -> None:
    assert headless.measure_width(PAGES[name](), 400, tmp_path) <= 400


@pytest.mark.slow
@pytest.mark.skipif(headless.missing() is not None, reason=str(headless.missing()))
def test_the_contents_of_a_page_do_not_cover_its_head(tmp_path: Path) -> None:
    studied = precision_document()
    studied["engines"] |= {f"a-long-name-of-engine-{k}": studied["engines"]["near"] for k in range(8)}
    script = """
    const extent = (element) => {  // of its text, which may be wider than its box
      const range = document.createRange();
      range.selectNodeContents(element);
      return range.getBoundingClientRect();
    };
    const [kicker, ...others] = [...document.querySelectorAll("header > :not(nav), nav li")].map(extent);
    const crosses = (low, high) => (box) => box[low] < kicker[high] && kicker[low] < box[high];
    const covering = others.filter(crosses("left", "right")).filter(crosses("top", "bottom")).length;
    return { covering, lines: new Set(others.map((box) => box.top)).size };"""
    found = headless.examine(make_precision_page(studied), script, tmp_path)
    assert found["lines"] > 4  # heading, lead, facts, and contents of more than one line
    assert found["covering"] == 0
