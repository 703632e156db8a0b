"""Verdicts of the ledger: every one of them can fall."""

import json
from io import StringIO

import pytest
from rich.console import Console

from reports.paper import printed
from reports.paper.ledger import FAILS, REPRODUCED, ROUNDS, TRUNCATED, Check, count, document, figure, untestable, words
from reports.paper.table import markdown, show_ledger
from tests.literature import published

GOOD, BAD = Check("residual", 1e-14, 1e-12), Check("residual", 1e-3, 1e-12)


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
    assert figure("3", "a figure", text, value, 1e-12).verdict == verdict


def test_a_figure_too_uncertain_to_tell_is_ours() -> None:
    line = figure("3", "a figure", "2.79", 2.7851, 1e-3)
    assert (line.verdict, line.fault) == (FAILS, "ours")


def test_what_fails_is_the_papers_only_if_the_measurement_passes_its_tests() -> None:
    assert words("3", "a claim", True, "", [GOOD]).verdict == REPRODUCED
    assert words("3", "a claim", True, "", [GOOD]).fault is None
    assert words("3", "a claim", False, "", [GOOD]).fault == "paper"
    assert words("3", "a claim", False, "", [GOOD, BAD]).fault == "ours"
    assert words("3", "a claim", False, "", []).fault == "ours"
    assert words("3", "a claim", True, "", [BAD]).fault == "ours", "a measurement that fails its tests proves nothing"
    assert words("3", "a claim", True, "", [Check("no number", float("nan"), 1.0)]).fault == "ours"
    assert count("3", "a count", 4, 5, "", [GOOD]).fault == "paper"


def test_the_document_and_the_tables_hold_every_line() -> None:
    lines = [
        words("3", "a claim that holds", True, "seen", [GOOD]),
        words("4", "a claim that does not", False, "not seen", [GOOD]),
        untestable("5", "a claim on a picture", "no picture"),
    ]
    found = json.loads(json.dumps(document(lines), allow_nan=False))
    assert [line["verdict"] for line in found["lines"]] == ["reproduced", "does not hold", "not testable"]
    assert found["faults"] == {"paper": 1, "ours": 0}
    assert not found["holds"]
    assert document(lines[::2])["holds"]
    lost = document([words("3", "a claim", True, "", [Check("no number", float("nan"), 1.0)])])
    assert json.loads(json.dumps(lost, allow_nan=False))["lines"][0]["checks"][0]["value"] is None
    text = StringIO()
    show_ledger(Console(file=text, width=120), lines)
    for part in (
        "a claim that holds",
        "(the paper's)",
        "residual: 1.00e-14, limit 1.00e-12: passes",
        "3 lines: 1 repro",
    ):
        assert part in text.getvalue()
    assert "**does not hold**: the paper's" in markdown(lines)


def test_the_printed_figures_are_those_the_tests_hold() -> None:
    """Two copies, one in the package, one beside the tests: a slip in either shows."""
    other, ours = published("xiong2020"), printed()
    for name in ("A", "B", "C", "D", "G", "P1", "P2", "P3", "P4", "Q1", "Q2"):
        for key in set(other[name]) & set(ours[name]) - {"eigenvalues"}:
            if key != "steer" or other[name][key] != "pi":
                assert ours[name][key] == other[name][key], (name, key)
    table = published("basu_mandal2007")
    assert {part: ours["basu_mandal"][part] for part in ("q", "qd", "qdd")} == {p: table[p] for p in ("q", "qd", "qdd")}
    assert float(ours["meijaard"]["capsize_speed"]) == published("meijaard2007")["critical"]["v_capsize"]
