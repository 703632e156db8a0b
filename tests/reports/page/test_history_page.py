"""The pages of a history: whole, escaped, without a script, with the numbers of the document and no others."""

from __future__ import annotations

import json
import math
import re
from html.parser import HTMLParser
from typing import Any

import headless_page as headless
import pytest

from velodrome.reports.page import AnchorNames, group_releases, make_history_page, make_ride_pair_page
from velodrome.reports.page.history import CELL_KINDS, find_cell_kind
from velodrome.reports.page.judged_quantities import JUDGED_QUANTITIES
from velodrome.reports.page.releases_figure import draw_releases, format_distinct
from velodrome.reports.page.ride_pair import draw_distance, draw_paths
from velodrome.scenarios.gate.sample import EIGENVALUE_QUANTITIES
from velodrome.scenarios.gate.verdict import RIDE_QUANTITIES, SHOWN

HOSTILE = "<script>alert(1)</script>"
NUMBER = re.compile(r"(?<![\w.^])-?\d+(?:\.\d+)*(?:e[+-]?\d+)?")
VALUES = {"position_error": 1.2345678e-5, "radius_drift_rate": -4.5678e-7, "observed_order": 2.01234, "steps": 2500.0}
LIMITS = {"position_error": 3.4e-10, "radius_drift_rate": 5.6e-11, "observed_order": 0.0123, "steps": 1.0}


def row(version: str, since: str | None = None, status: str = "rode", **more: Any) -> dict[str, Any]:
    rode = status == "rode"
    found: dict[str, Any] = {
        "version": version,
        "release": version,
        "date": None,
        "wheel": None,
        "engine": HOSTILE,
        "scenario": HOSTILE,
        "status": status,
        "reason": None if rode else f"{version} says {HOSTILE}",
        "bits": "aa" if rode else None,
        "quantities": VALUES if rode else {},
        "limits": LIMITS if rode else {},
        "compared_with": "0.1" if since else None,
        "since_previous": since,
        "changed": [],
    }
    return found | more


def move(name: str, before: float | None, after: float | None, status: str) -> dict[str, Any]:
    return {"quantity": name, "before": before, "after": after, "limit": LIMITS.get(name), "status": status}


MOVES = [
    move("position_error", 1.2345678e-5, 6.789e-9, "better"),
    move("radius_drift_rate", -4.5678e-7, 5.4321e-6, "worse"),
    move("observed_order", 2.01234, None, "changed"),
]
RUN = [move("run", None, None, "worse")]


def document() -> dict[str, Any]:
    moved = {"position_error": 6.789e-9, "radius_drift_rate": 5.4321e-6, "observed_order": None, "steps": 2500.0}
    names = [each["quantity"] for each in MOVES]
    point = {"engine": HOSTILE, "scenario": HOSTILE}
    return {
        "package": HOSTILE,
        "scenarios": {HOSTILE: HOSTILE},
        "engines": [HOSTILE],
        "complete": False,
        "bisected": True,
        "remarks": [HOSTILE],
        "releases": [
            row("0.1", date="2026-01-02"),
            row("0.2", "same-bits"),
            row("0.3", "round-off"),
            row("0.4", "changed", changed=names, quantities=moved, date="2026-03-04"),
            row("0.5", "worse", "failed", changed=["run"]),
            row("0.6", None, "failed"),
            row("0.7", None, "refused"),
            row("0.8", None, "not-installable"),
            row("0.9", "better", changed=["run", "position_error"], release="0.9 wheel abcd1234", wheel=HOSTILE),
            row("1.0", "worse", changed=["position_error"]),
        ],
        "turning_points": [
            point
            | {"version": "0.4", "release": "0.4", "date": "2026-03-04", "since": "0.1", "verdict": "changed"}
            | {"quantities": MOVES, "page": "rides/one.html"},
            point
            | {"version": "0.5", "release": "0.5", "date": None, "since": "0.4", "verdict": "worse"}
            | {"quantities": RUN, "page": None},
            point
            | {"version": "0.9", "release": "0.9 wheel abcd1234", "date": None, "since": "0.4"}
            | {"verdict": "better", "quantities": [move("run", None, None, "better"), MOVES[0]]}
            | {"page": "rides/three.html"},
            point
            | {"version": "1.0", "release": "1.0", "date": None, "since": "0.9 wheel abcd1234"}
            | {"verdict": "worse", "quantities": MOVES[:1], "page": "rides/two.html"},
        ],
        "gradual_moves": [
            point
            | {"version": "0.3", "release": "0.3", "date": None, "since": "0.1", "verdict": "worse"}
            | {"quantities": [move("steps", 2500.0, 2502.0, "changed")]},
        ],
        "libraries": {"velodrome": "0.1.0", HOSTILE: HOSTILE},
    }


def pair() -> dict[str, Any]:
    def side(release: str, shift: float) -> dict[str, Any]:
        return {
            "release": release,
            "date": "2026-05-06",
            "bits": "aa",
            "settings": {"step": 0.002, HOSTILE: HOSTILE},
            "quantities": VALUES | {"required_friction": 0.4321 + shift},
            "time": [0.0, 0.5, 1.25],
            "position": [[0.0, 0.0, 0.0], [1.0, shift, 0.0], [2.0, 1.0, 0.0]],
        }

    return {
        "package": HOSTILE,
        "engine": HOSTILE,
        "scenario": HOSTILE,
        "title": HOSTILE,
        "verdict": "changed",
        "moved": MOVES,
        "limits": LIMITS,
        "before": side("0.1", 0.0),
        "after": side("0.4", 0.0625),
        "distance": {"time": [0.0, 0.5, 1.25], "distance": [0.0, 0.0625, 1.5e-9]},
        "libraries": {"velodrome": "0.1.0"},
        "command": f"velodrome history {HOSTILE}",
        "commands": [f"velodrome run {HOSTILE}", "velodrome diff before/* after/*"],
    }


class Reader(HTMLParser):
    """The text of a page without its style, with its links, anchors and the texts of labels."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.links: list[str] = []
        self.anchors: list[str] = []
        self.text: list[str] = []
        self._silent = False
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        self.tags.append(tag)
        self.links += [value for key in ("src", "href") if (value := given.get(key))]
        self.anchors += [value for key in ("id",) if (value := given.get(key))]
        self.text += [value for key in ("title", "aria-label") if (value := given.get(key))]
        self._silent = tag in ("style", "title")

    def handle_endtag(self, tag: str) -> None:
        self._silent = False

    def handle_data(self, data: str) -> None:
        if not self._silent:
            self.text.append(data)


def list_numbers(value: Any) -> list[float]:
    if isinstance(value, dict):
        return [number for one in value.values() for number in list_numbers(one)]
    if isinstance(value, list):
        return [number for one in value for number in list_numbers(one)]
    return [float(value)] if isinstance(value, int | float) and not isinstance(value, bool) else []


def find_foreign_numbers(page: str, found: dict[str, Any], prose: set[str]) -> set[str]:
    """Return the numbers of a page that are neither texts nor rounded numbers of its document, nor of the prose."""
    known, texts = list_numbers(found), set(NUMBER.findall(json.dumps(found)))

    def is_rounded(text: str) -> bool:
        digits = len(re.sub(r"e.*|\D", "", text).lstrip("0")) or 1
        return any(
            float(text) == float(format(value, f".{count}g")) for value in known for count in range(digits, digits + 4)
        )

    shown = {text for part in Reader(page).text for text in NUMBER.findall(part)}
    return {text for text in shown - texts - prose if text.count(".") > 1 or not is_rounded(text)}


PROSE = {number for quantity in JUDGED_QUANTITIES.values() for number in NUMBER.findall(quantity.meaning)}


@pytest.mark.parametrize("page", [make_history_page(document()), make_ride_pair_page(pair(), "../history.html")])
def test_pages_are_whole_escaped_and_load_nothing(page: str) -> None:
    assert page.startswith("<!doctype html>")
    reader = Reader(page)
    assert "script" not in reader.tags
    assert HOSTILE not in page
    assert all(re.match(r"#|data:,|rides/|\.\./history\.html$", link) for link in reader.links), reader.links
    assert {link[1:] for link in reader.links if link.startswith("#")} <= {*reader.anchors}
    assert len(reader.anchors) == len({*reader.anchors})
    assert "None" not in " ".join(reader.text)


def test_every_number_is_one_of_the_document() -> None:
    found, of_pair = document(), pair()
    assert find_foreign_numbers(make_history_page(found), found, PROSE) == set()
    assert find_foreign_numbers(make_ride_pair_page(of_pair, "../history.html"), of_pair, PROSE) == set()
    # The check finds a number that is not there.
    found["releases"][0]["reason"] = None
    changed = make_history_page(found).replace("1.235e-05", "1.236e-05")
    assert find_foreign_numbers(changed, found, PROSE) == {"1.236e-05"}


def test_every_status_has_a_sign_and_words_of_its_own() -> None:
    assert len({kind.sign for kind in CELL_KINDS}) == len({kind.meaning for kind in CELL_KINDS}) == len(CELL_KINDS)
    found = document()
    kinds = [find_cell_kind(each) for each in found["releases"]]
    assert {kind.key for kind in kinds} == {kind.key for kind in CELL_KINDS}
    page = make_history_page(found)
    strip = page[page.index('<ol class="strip"') :]
    cells = strip[: strip.index("</ol>")].split("<li>")[1:]
    assert len(cells) == len(kinds)
    for cell, kind, each in zip(cells, kinds, found["releases"], strict=True):
        assert f'<span class="sign" aria-hidden="true">{kind.sign}</span>' in cell
        assert f'title="{each["release"]}' in cell
        assert re.search(r'<span class="visually-hidden">: \w', cell)
        assert ("turn" in cell[: cell.index(" href")]) == bool(each["changed"])
    assert "0.4, 2026-03-04" in cells[3]
    assert "same to the bit as 0.1" in cells[1]


def test_releases_that_ride_alike_are_one_group() -> None:
    groups = [[each["version"] for each in group] for group in group_releases(document()["releases"])]
    # A reason that names the release is the same as that of the next one.
    assert groups == [["0.1", "0.2", "0.3"], ["0.4"], ["0.5", "0.6"], ["0.7"], ["0.8"], ["0.9"], ["1.0"]]


def test_a_turning_point_names_its_moves_its_date_and_its_rides() -> None:
    page = make_history_page(document())
    turns = page[page.index('id="turning-points"') : page.index("</section>", page.index('id="turning-points"'))]
    text = " ".join(re.sub(r"<[^>]*>", " ", turns).split())
    assert "0.4, 2026-03-04" in text
    assert "changed since 0.1: observed order 2.012 → – ; also radius drift rate, position error" in text
    assert "worse since 0.4: it does not ride any more" in text
    assert "better since 0.4: it rides again, and the one before it did not; also position error" in text
    assert "worse between 0.1 and 0.3: steps 2500 → 2502" in text
    assert page.count("The two rides side by side") == 3
    assert "moved gradually between 0.1 and <b>0.3</b>" in page


@pytest.mark.parametrize(
    ("rows", "told"),
    [
        ([row("1.0")], "Nothing to compare"),
        ([row("1.0", None, "failed"), row("1.1", None, "refused")], "Nothing to compare"),
        ([row("1.0"), row("1.1", "round-off")], "No release moved a quantity beyond its limit"),
    ],
)
def test_that_nothing_moved_is_said_where_releases_were_compared_alone(rows: list[dict[str, Any]], told: str) -> None:
    page = make_history_page(document() | {"releases": rows, "turning_points": [], "gradual_moves": []})
    both = ("Nothing to compare", "No release moved a quantity beyond its limit")
    assert [text in page for text in both] == [text == told for text in both]


def test_places_follow_the_values_and_the_band_the_value_before() -> None:
    values = [1e-3, 1e-3, 1e-6]
    rows = [
        row(str(k), None if k == 0 else "worse", quantities={"e": v}, limits={"e": 5e-4}) for k, v in enumerate(values)
    ]
    rows[2]["changed"] = ["e"]
    drawn = draw_releases(rows, "e")
    assert drawn is not None
    assert drawn["log"]
    marks = drawn["marks"]
    assert [mark["at"] for mark in marks] == pytest.approx([100 / 6, 50, 500 / 6], rel=1e-4)
    assert marks[0]["up"] == marks[1]["up"] < marks[2]["up"]
    assert [mark["moved"] for mark in marks] == [False, False, True]
    assert [label["text"] for label in drawn["labels"]] == ["0.001", "1e-06"]
    first, second = drawn["bands"]
    assert (first["top"], first["height"]) == (second["top"], second["height"])
    assert first["top"] < marks[0]["up"] < first["top"] + first["height"] < marks[2]["up"]
    # Three decades, and the band's upper end, with their margins: half a band above is log10(1.5) decades.
    per_decade = (marks[2]["up"] - marks[0]["up"]) / 3
    assert marks[0]["up"] - first["top"] == pytest.approx(per_decade * math.log10(1.5), rel=1e-3)


def test_values_of_both_signs_have_a_linear_axis_and_gaps_break_the_line() -> None:
    rows = [row("1", quantities={"e": -1.0}), row("2", None, "failed"), row("3", quantities={"e": 3.0})]
    drawn = draw_releases(rows, "e")
    assert drawn is not None
    assert not drawn["log"]
    assert drawn["line"].count("M") == 2
    assert [gap["at"] for gap in drawn["gaps"]] == pytest.approx([100 / 3], rel=1e-4)
    assert draw_releases(rows, "other") is None


@pytest.mark.parametrize(("count", "turned", "dated"), [(4, 2, False), (9, 4, True), (9, 5, False), (9, 1, None)])
def test_a_date_at_the_axis_is_left_out_where_it_would_lie_on_another(
    count: int, turned: int, dated: bool | None
) -> None:
    rows = [row(str(k), "worse" if k else None, quantities={"e": 1.0 + k}) for k in range(count)]
    rows[turned]["changed"] = ["e"]
    drawn = draw_releases(rows, "e")
    assert drawn is not None
    assert [label["dated"] for label in drawn["releases"][:2]] == [True, True]
    assert [label["dated"] for label in drawn["releases"][2:]] == ([] if dated is None else [dated])


def test_a_limit_of_its_own_is_a_band_from_zero() -> None:
    rows = [row("1", quantities={"e": 0.25}, limits={"e": 1.0})]
    drawn = draw_releases(rows, "e", absolute=True)
    assert drawn is not None
    (band,), (mark,) = drawn["bands"], drawn["marks"]
    assert (band["top"] + band["height"] - mark["up"]) / band["height"] == pytest.approx(0.25, rel=1e-3)


@pytest.mark.parametrize(
    "values", [[0.0], [0.0, 0.0], [1e-300, 1e300], [1.0, 1.0 + 2**-52], [-5.0, -5.0], [-1e308, 1e308]]
)
def test_any_values_have_a_place(values: list[float]) -> None:
    rows = [row(str(k), "round-off" if k else None, quantities={"e": v}) for k, v in enumerate(values)]
    drawn = draw_releases(rows, "e")
    assert drawn is not None
    assert all(0 <= mark["up"] <= 100 for mark in drawn["marks"])
    assert 1 <= len(drawn["labels"]) <= 2


def test_numbers_that_differ_look_different() -> None:
    assert format_distinct([1.0, 1.0 + 2**-52]) == ["1", "1.0000000000000002"]
    assert format_distinct([2.0, 2.0]) == ["2", "2"]
    assert format_distinct([0.1, 0.1004], most=3) == ["0.1", "0.1"]


def test_paths_are_in_equal_scales_with_y_up() -> None:
    drawn = draw_paths({"before": [[0.0, 0.0, 9.0], [2.0, 1.0, 9.0]], "after": [[0.0, 0.0, 9.0], [0.0, -1.0, 9.0]]})
    assert [float(part) for part in drawn["box"].split()] == pytest.approx([-0.08, -1.08, 2.16, 2.16])
    assert drawn["lines"] == {"before": "M0.0 -0.0L2.0 -1.0", "after": "M0.0 -0.0L0.0 1.0"}


def test_distances_of_zero_are_left_out() -> None:
    drawn = draw_distance({"time": [0.0, 1.0, 2.0], "distance": [0.0, 1e-9, 1e-7]})
    assert drawn is not None
    assert [mark[0] for mark in drawn["marks"]] == [50, 100]
    assert drawn["marks"][0][1] > drawn["marks"][1][1]
    assert draw_distance({"time": [0.0], "distance": [0.0]}) is None
    assert draw_distance({"time": [], "distance": []}) is None


def test_anchors_are_safe_and_differ() -> None:
    names = AnchorNames()
    chosen = [
        names.choose(*parts) for parts in (("a/../b", "1.0"), ("a b", "1.0"), ("A b", "1.0"), ("", ""), ("x" * 999,))
    ]
    assert chosen[:4] == ["a-..-b-1.0", "a-b-1.0", "A-b-1.0-2", "x-x"]
    assert len({name.lower() for name in chosen}) == len(chosen)
    assert all(re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9.-]{0,125}", name) for name in chosen)


def test_every_judged_quantity_is_described() -> None:
    names = {*RIDE_QUANTITIES, *SHOWN, *EIGENVALUE_QUANTITIES, "observed_order", "run"} - {"cpu_ratio"}
    assert names <= {*JUDGED_QUANTITIES}


def test_an_empty_history_says_so() -> None:
    found = document() | {"releases": [], "turning_points": [], "gradual_moves": []}
    page = make_history_page(found)
    assert "No ride was reached." in page
    assert "Nothing to compare" in page


@pytest.mark.slow
@pytest.mark.skipif(headless.missing() is not None, reason=str(headless.missing()))
@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("which", ["history", "pair"])
def test_a_browser_shows_the_pages_without_a_complaint(which: str, dark: bool, tmp_path: Any) -> None:
    path = tmp_path / "page.html"
    made = make_history_page(document()) if which == "history" else make_ride_pair_page(pair(), "../history.html")
    path.write_text(made, encoding="utf-8")
    assert headless.picture(path.as_uri(), tmp_path / "page.png", dark, (400, 3000)) == []
    assert (tmp_path / "page.png").stat().st_size > 10_000


@pytest.mark.slow
@pytest.mark.skipif(headless.missing() is not None, reason=str(headless.missing()))
@pytest.mark.parametrize("which", ["history", "pair"])
def test_pages_fit_into_400_pixels(which: str, tmp_path: Any) -> None:
    # Names without a place to break a line, as long as those of wheels' builds and of scenario files may be.
    text = json.dumps(document() if which == "history" else pair()).replace(HOSTILE, 60 * "x")
    versions = [f"{number}.{number % 7}.{number}" for number in range(10, 60)]
    found = json.loads(text)
    if which == "history":
        found["releases"] += [
            found["releases"][1] | {"version": version, "release": version, "compared_with": "0.1"}
            for version in versions
        ]
        made = make_history_page(found)
    else:
        made = make_ride_pair_page(found, "../history.html")
    assert headless.measure_width(made, 400, tmp_path) <= 400
