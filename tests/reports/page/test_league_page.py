"""The page of a league: whole, escaped, without a script, its points where they belong."""

from __future__ import annotations

import math
import re
from typing import Any

import headless_page as headless
import numpy as np
import pytest
from parsed_page import check_static_page

from velodrome.engines.engine import REFERENCE
from velodrome.reports.page import LEAGUE_COLUMNS, find_creeping, make_league_page
from velodrome.reports.page.league import CREEPS, EXPLAINED, classify_slip
from velodrome.reports.page.loglog import draw_loglog, fit_axis

HOSTILE = "<script>alert(1)</script>"
KEYS = {column.key for column in LEAGUE_COLUMNS}


def ride(error: float | None, creep: float | None = None, **more: Any) -> dict[str, Any]:
    points = [] if error is None else [point(0.002 / 2**k, error / 2**k, creep) for k in range(3)]
    found: dict[str, Any] = dict.fromkeys(KEYS) | {"status": "rode", "reason": None, "order_range": None}
    found |= {"position_error": error, "step": 0.002, "creep": creep_of(0.002, creep), "horizon": None}
    found |= {"same_bits_elsewhere": {}, "remarks": [], "points": points}
    return found | more


def point(step: float, error: float, creep: float | None) -> dict[str, Any]:
    return {"step": step, "position_error": error, "cpu_per_second": 1e-5 / step, "creep": creep_of(step, creep)}


def creep_of(step: float, creep: float | None, share: float = 0.9) -> dict[str, float] | None:
    return None if creep is None else {"time": creep * step, "share": share, "slip_time": creep * step}


def document() -> dict[str, Any]:
    def entry(**rides: Any) -> dict[str, Any]:
        known = {"version": "1.0", "description": HOSTILE, "settings": {"step": 0.002}, "fault": None}
        return known | {"settings_source": HOSTILE, "scenarios": {HOSTILE: rides["there"]}}

    scenario = {"title": HOSTILE, "duration": 2.0, "growth_rate": 0.5, "size": 2.0}
    scenario |= {"surface": {"kind": "plane"}, "motion": {"kind": "circular", "rear_rate": 18.0}, "perturbation": {}}
    return {
        "complete": False,
        "created": "2026-01-02T03:04:05+00:00",
        "levels": 3,
        "settings_file": HOSTILE,
        "scenarios": {HOSTILE: scenario},
        "engines": {
            REFERENCE: entry(there=ride(None, same_bits_twice=True)),
            "worse": entry(there=ride(2e-2, 1.0, observed_order=1.0, order_range=(0.9, 1.1), remarks=[HOSTILE])),
            "better": entry(there=ride(3e-5, 1e-6, same_bits_twice=False, same_bits_elsewhere={HOSTILE: None})),
            "unsuitable": entry(there=ride(None, status="unsuitable", reason=HOSTILE)),
            HOSTILE: entry(there=ride(None, status="failed", reason=HOSTILE)),
            "absent": entry(there=ride(None, status="failed", reason=HOSTILE))
            | {"version": None, "description": None, "settings": None, "settings_source": None, "fault": HOSTILE},
        },
        "libraries": {"velodrome": "0.1.0", HOSTILE: HOSTILE},
        "platform": {"system": HOSTILE},
    }


def read_text(page: str) -> str:
    """The text of a page, without its tags."""
    return re.sub(r"<[^>]*>", "", page)


def test_the_page_is_whole_escaped_and_loads_nothing() -> None:
    check_static_page(make_league_page(document()), HOSTILE)


def test_what_an_engine_leaves_out_for_an_old_release_is_told() -> None:
    found = document()
    assert "For this release" not in make_league_page(found)
    found["engines"]["worse"] |= {"left_out": {"first_force": f"no forces {HOSTILE}"}}
    page = make_league_page(found)
    assert "For this release left out: no forces" in read_text(page)
    assert HOSTILE not in page


def read_rows(table: str) -> list[str]:
    """The text of each row of the first table's body."""
    body = table[table.index("<tbody>") : table.index("</tbody>")]
    return [" ".join(re.sub(r"<[^>]*>", " ", row).split()) for row in body.split("</tr>")[:-1]]


def test_the_overview_says_of_every_engine_how_far_it_comes() -> None:
    found = document()
    found["engines"]["fallen"] = found["engines"]["worse"] | {
        "scenarios": {HOSTILE: ride(1e-9, status="fell", fell_at=0.5)}
    }
    page = make_league_page(found)
    rows = read_rows(page[page.index('id="overview"') :])
    assert rows[:4] == ["better 3.0e-05", "worse 2.0e-02", "fallen ✕ fell at 0.50 s", "unsuitable not made for it"]
    assert len(rows) == 6
    assert all(row.endswith("did not ride") for row in rows[4:])


def test_rows_stand_by_error_with_their_reasons() -> None:
    page = make_league_page(document())
    rows = read_rows(page[page.index('id="ride-') :])
    assert [row.split()[0] for row in rows[:4]] == [REFERENCE, "better", "worse", "unsuitable"]
    assert "0.90 to 1.10" in rows[2]
    assert "not made for this ride: &lt;script&gt;" in rows[3]
    assert rows[1].endswith("no")
    assert "did not ride" in rows[4]


def test_only_wheels_near_the_law_are_said_to_creep() -> None:
    found = document()
    assert find_creeping(found, HOSTILE) == {"worse": [(0.002 / 2**k, 0.002 / 2**k) for k in range(3)]}
    page = read_text(make_league_page(found))
    assert "Roll without creep" in page
    assert "for 1 / b: better." in page
    assert "Slip otherwise" not in page
    rides = {name: entry["scenarios"][HOSTILE] for name, entry in found["engines"].items()}
    rides["better"]["creep"] = creep_of(0.002, 1.01 * CREEPS)
    assert list(find_creeping(found, HOSTILE)) == ["worse", "better"]
    rides["better"]["creep"] = creep_of(0.002, 1.0, share=0.99 * EXPLAINED)
    assert classify_slip(rides["better"]) == "slides"
    assert "of it: better." in read_text(make_league_page(found))
    assert classify_slip(rides[REFERENCE]) is None


def test_a_horizon_before_the_end_stands_below_the_error() -> None:
    found = document()
    assert '<span class="range">horizon' not in make_league_page(found)
    found["engines"]["worse"]["scenarios"][HOSTILE]["horizon"] = 1.234
    found["engines"]["better"]["scenarios"][HOSTILE]["horizon"] = 2.0
    assert make_league_page(found).count('<span class="range">horizon') == 1
    assert "horizon 1.23 s" in make_league_page(found)


def test_points_lie_where_their_logarithms_are() -> None:
    drawn = draw_loglog({"a": [(1e-3, 1e-2), (1e-1, 1.0)], "b": [(1e-2, 1e-1), (0.0, 1.0), (1.0, -1.0)]}, ["b", "a"])
    assert drawn is not None
    assert [tick["power"] for tick in drawn["x"]] == [-3, -2, -1]
    assert [tick["power"] for tick in drawn["y"]] == [-2, -1, 0]
    lines = {line["engine"]: line["marks"] for line in drawn["lines"]}
    assert lines == {1: [(0.0, 100.0), (100.0, 0.0)], 0: [(50.0, 50.0)]}
    assert drawn["coinciding"] == []
    assert draw_loglog({"a": [(0.0, 1.0)]}, ["a"]) is None
    assert draw_loglog({}, []) is None


def test_engines_at_the_same_places_are_told() -> None:
    there = [(1e-3, 1e-2), (1e-1, 1.0)]
    beside = [(x * 1.01, y) for x, y in there]  # 0.2 % of two decades
    other = [(x, y / 2) for x, y in there]
    drawn = draw_loglog({"a": there, "b": other, "c": beside, "d": there[:1]}, list("abcd"))
    assert drawn is not None
    assert drawn["coinciding"] == [["a", "c"]]
    again = document()
    ((name, scenarios),) = ((key, entry["scenarios"]) for key, entry in again["engines"].items() if key == "worse")
    again["engines"]["twin"] = again["engines"][name] | {"scenarios": scenarios}
    assert "one drawn over the other: worse, twin." in read_text(make_league_page(again))


@pytest.mark.parametrize("values", [[1.0], [3.0], [1e-12, 5.0], [0.1, 0.100001], [5e-324, 1e308]])
def test_an_axis_holds_its_values(values: list[float]) -> None:
    axis = fit_axis(values)
    assert axis.low < axis.high
    assert all(0 <= axis.place(value) <= 100 for value in values)
    assert axis.high - axis.low <= max(1, math.ceil(np.ptp(np.log10(values))) + 1)
    assert 2 <= sum(tick["labelled"] for tick in axis.ticks) <= 9


@pytest.mark.slow
@pytest.mark.skipif(headless.missing() is not None, reason=str(headless.missing()))
@pytest.mark.parametrize("dark", [False, True])
def test_a_browser_shows_the_page_without_a_complaint(dark: bool, tmp_path: Any) -> None:
    path = tmp_path / "league.html"
    path.write_text(make_league_page(document()), encoding="utf-8")
    assert headless.picture(path.as_uri(), tmp_path / "league.png", dark, (400, 3000)) == []
    assert (tmp_path / "league.png").stat().st_size > 10_000
