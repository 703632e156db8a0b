"""Verdicts of the ledger: every one of them can fall."""

import json
from io import StringIO

import pytest
from rich.console import Console

from tests.literature import published
from velodrome.scenarios.commands.present_paper import show_ledger
from velodrome.scenarios.paper.ledger import (
    DEPENDS,
    FAILS,
    REPRODUCED,
    ROUNDS,
    TRUNCATED,
    SelfCheck,
    Threshold,
    above,
    below,
    claim_line,
    count_by_cut,
    count_line,
    equals,
    figure_line,
    ledger_document,
    list_surprises,
    source,
    untestable_line,
)
from velodrome.scenarios.paper.printed import read_printed
from velodrome.scenarios.paper.table import ledger_markdown

GOOD, BAD = SelfCheck("residual", 1e-14, 1e-12), SelfCheck("residual", 1e-3, 1e-12)
HOLDS, FALLS = below("a length", 1.0, 2.0, "m"), below("a length", 3.0, 2.0, "m")
SEEN = source("something", json.dumps, command="velodrome critical", search="from here and there")


@pytest.mark.parametrize(
    ("value", "text", "verdict"),
    [
        (17.2122, "17.2", ROUNDS),
        (-22.5737, "-22.6", ROUNDS),
        (-13.3958, "-13.40", ROUNDS),
        (2.78570, "2.78", TRUNCATED),
        (-2.78570, "-2.78", TRUNCATED),
        (-0.05, "-0.04", FAILS),
        (2.7958, "2.78", FAILS),
        (2.7749, "2.78", FAILS),
        (-17.2122, "17.2", FAILS),
    ],
)
def test_a_figure_rounds_to_the_print_or_is_cut_off_or_fails(value: float, text: str, verdict: str) -> None:
    assert figure_line("3", "a figure", text, value, 1e-12, SEEN).verdict == verdict


def test_a_figure_too_uncertain_to_tell_is_ours() -> None:
    line = figure_line("3", "a figure", "2.79", 2.7851, 1e-3, SEEN)
    assert (line.verdict, line.fault) == (FAILS, "ours")


def test_what_fails_is_the_papers_only_if_the_measurement_passes_its_tests() -> None:
    assert claim_line("3", "a claim", [HOLDS], "", SEEN, [GOOD]).verdict == REPRODUCED
    assert claim_line("3", "a claim", [HOLDS], "", SEEN, [GOOD]).fault is None
    assert claim_line("3", "a claim", [FALLS], "", SEEN, [GOOD]).fault == "paper"
    assert claim_line("3", "a claim", [HOLDS, FALLS], "", SEEN, [GOOD]).fault == "paper"
    assert claim_line("3", "a claim", [FALLS], "", SEEN, [GOOD, BAD]).fault == "ours"
    assert claim_line("3", "a claim", [FALLS], "", SEEN, []).fault == "ours"
    failed = claim_line("3", "a claim", [HOLDS], "", SEEN, [BAD])
    assert failed.fault == "ours", "a measurement that fails its tests proves nothing"
    assert claim_line("3", "a claim", [HOLDS], "", SEEN, [SelfCheck("no number", float("nan"), 1.0)]).fault == "ours"
    assert claim_line("3", "a claim", [], "", SEEN, [GOOD]).verdict == FAILS, "no condition, no proof"
    assert claim_line("3", "a claim", [below("no number", float("nan"), 1.0)], "", SEEN, [GOOD]).verdict == FAILS
    assert count_line("3", "a count", 4, 5, "", SEEN, [GOOD]).fault == "paper"


@pytest.mark.parametrize(
    ("threshold", "met", "text"),
    [
        (below("x", 1.0, 1.0), False, "x < 1"),
        (above("x", 1.0, 1.0, "rad/s"), False, "x > 1 rad/s"),
        (Threshold("x", 1.0, "<=", 1.0), True, "x <= 1"),
        (Threshold("x", 1.0, ">=", 1.0), True, "x >= 1"),
        (equals("x", 3, 3), True, "x = 3"),
        (equals("x", 3, 4), False, "x = 4"),
    ],
)
def test_a_threshold_says_what_it_wants(threshold: Threshold, met: bool, text: str) -> None:
    assert (threshold.met, threshold.text) == (met, text)


def test_a_figures_threshold_is_half_a_unit_of_its_last_digit_or_the_digits() -> None:
    (rounds,) = figure_line("3", "a figure", "17.2", 17.2122, 1e-12, SEEN).thresholds
    assert (rounds.limit, rounds.relation) == (0.05, "<=")
    assert rounds.value == pytest.approx(0.0122)
    misses, beyond, less = figure_line("3", "a figure", "-2.78", -2.78570, 1e-12, SEEN).thresholds
    assert (misses.met, beyond.met, less.met) == (False, True, True)
    assert (misses.limit, less.limit) == (0.005, 0.01)


@pytest.mark.parametrize(
    ("counts", "verdict"),
    [({"whole": 4, "cut": 4}, REPRODUCED), ({"whole": 4, "cut": 5}, DEPENDS), ({"whole": 3, "cut": 5}, FAILS)],
)
def test_a_count_may_depend_on_the_cut(counts: dict[str, int], verdict: str) -> None:
    line = count_by_cut("5", "there are four", 4, counts, "seen", SEEN, [GOOD])
    assert line.verdict == verdict
    assert line.holds == (verdict != FAILS)
    assert [threshold.value for threshold in line.thresholds] == list(counts.values())
    assert count_by_cut("5", "there are four", 4, counts, "seen", SEEN, [BAD]).fault == "ours"


def test_the_document_and_the_tables_hold_every_line() -> None:
    lines = [
        claim_line("3", "a claim that holds", [HOLDS], "seen", SEEN, [GOOD]),
        claim_line("4", "a claim that does not", [FALLS], "not seen", SEEN, [GOOD]),
        untestable_line("5", "a claim on a picture", "no picture"),
    ]
    known = ["a claim that does not"]
    found = json.loads(json.dumps(ledger_document(lines, known), allow_nan=False))
    assert [line["verdict"] for line in found["lines"]] == ["reproduced", "does not hold", "not testable"]
    assert found["faults"] == {"paper": 1, "ours": 0}
    assert not found["holds"]
    assert found["surprises"] == []
    assert ledger_document(lines[::2], [])["holds"]
    lost = ledger_document(
        [claim_line("3", "a claim", [below("?", float("nan"), 1)], "", SEEN, [SelfCheck("?", float("nan"), 1)])], []
    )
    (line,) = json.loads(json.dumps(lost, allow_nan=False))["lines"]
    assert line["checks"][0]["value"] is None
    assert line["thresholds"][0]["value"] is None
    text = StringIO()
    show_ledger(Console(file=text, width=120), lines, [], whole=True)
    for part in (
        "a claim that holds",
        "(the paper's)",
        "wanted: a length < 2 m; it is 3",
        "residual: 1.00e-14, limit 1.00e-12: passes",
        "3 lines: 1 repro",
        "the 1 that do not hold are the paper's and known",
    ):
        assert part in text.getvalue()
    text = StringIO()
    show_ledger(Console(file=text, width=120), lines, ["a surprise"])
    assert "a claim that does not" in text.getvalue()
    assert "a surprise" in text.getvalue()
    assert "a claim that holds" not in text.getvalue()
    assert "known" not in text.getvalue()
    page = ledger_markdown(lines)
    assert "**does not hold**: the paper's" in page
    for part in ("a length < 2 m", "something. from here and there", "`velodrome critical`, `json.dumps`"):
        assert part in page


def test_a_surprise_is_whatever_is_not_as_known() -> None:
    holding = claim_line("3", "a claim that holds", [HOLDS], "seen", SEEN, [GOOD])
    failing = claim_line("4", "a claim that does not", [FALLS], "not seen", SEEN, [GOOD])
    untested = claim_line("4", "a claim that does not", [FALLS], "not seen", SEEN, [BAD])
    assert list_surprises([holding, failing], [failing.claim]) == []
    (line,) = list_surprises([holding, failing], [])
    assert line.startswith("4: a claim that does not: does not hold")
    (line,) = list_surprises([holding, untested], [failing.claim])
    assert "its own tests" in line
    (line,) = list_surprises([holding], [holding.claim])
    assert line == "a claim that holds: holds, though known not to"


def test_a_line_in_json_names_its_threshold_and_where_it_comes_from() -> None:
    line = claim_line("3", "a claim", [HOLDS], "seen", SEEN, [GOOD]).as_json()
    # What readers of the document know already, and what has come since.
    before = {"section", "claim", "kind", "printed", "measured", "value", "verdict", "holds", "fault", "checks"}
    assert set(line) == before | {"threshold", "thresholds", "computed", "functions", "command", "search"}
    assert line["threshold"] == "a length < 2 m"
    (threshold,) = line["thresholds"]
    assert threshold == {"what": "a length", "value": 1.0, "relation": "<", "limit": 2.0, "unit": "m", "met": True}
    assert (line["computed"], line["functions"]) == ("something", ["json.dumps"])
    assert (line["command"], line["search"]) == ("velodrome critical", "from here and there")
    lone = untestable_line("5", "a claim on a picture", "no picture").as_json()
    assert (lone["threshold"], lone["functions"], lone["command"]) == ("", [], None)


def test_the_printed_figures_are_those_the_tests_hold() -> None:
    """Two copies, one in the package, one beside the tests: a slip in either shows."""
    other, ours = published("xiong2020"), read_printed()
    for name in ("A", "B", "C", "D", "G", "P1", "P2", "P3", "P4", "Q1", "Q2"):
        for key in set(other[name]) & set(ours[name]) - {"eigenvalues"}:
            if key != "steer" or other[name][key] != "pi":
                assert ours[name][key] == other[name][key], (name, key)
    table = published("basu_mandal2007")
    assert {part: ours["basu_mandal"][part] for part in ("q", "qd", "qdd")} == {p: table[p] for p in ("q", "qd", "qdd")}
    assert float(ours["meijaard"]["capsize_speed"]) == published("meijaard2007")["critical"]["v_capsize"]
