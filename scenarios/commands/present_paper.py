"""Terminal output of `velodrome paper`."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console

from ..paper import (
    DEPENDS,
    FAILS,
    REPRODUCED,
    ROUNDS,
    TRUNCATED,
    UNTESTABLE,
    LedgerLine,
    describe_fault,
    ledger_summary,
)
from .terminal import print_words

_STYLES = {
    REPRODUCED: "green",
    ROUNDS: "green",
    TRUNCATED: "yellow",
    DEPENDS: "yellow",
    FAILS: "red",
    UNTESTABLE: "dim",
}


def show_ledger(console: Console, lines: Sequence[LedgerLine], surprises: Sequence[str], whole: bool = False) -> None:
    """Print the lines that matter, then the result: how many claims hold, and what is not as known.

    Parameters
    ----------
    console : Console
    lines : sequence of LedgerLine
    surprises : sequence of str
        See `velodrome.scenarios.paper.ledger.list_surprises`.
    whole : bool
        Whether to print all lines first, in the paper's order, and how those that do not hold were tested.
    """
    if whole:
        for line in lines:
            _show_line(console, line)
        console.print()
    for line in lines:
        if not line.holds:
            said = f"{line.section}: {line.claim}: does not hold: {line.measured} ({describe_fault(line)})"
            print_words(console, said, _STYLES[line.verdict])
            _show_evidence(console, line, whole)
        elif line.verdict in (TRUNCATED, DEPENDS):
            said = f"{line.section}: {line.claim}: {line.verdict}: {line.measured}"
            print_words(console, said, _STYLES[line.verdict])
    console.print()
    print_words(console, ledger_summary(lines), "bold")
    if surprises:
        for surprise in surprises:
            print_words(console, surprise, "bold red")
    else:
        failing = sum(not line.holds for line in lines)
        said = f"the {failing} that do not hold are the paper's and known; all measurements pass their own tests"
        print_words(console, said, "green")
    if not whole:
        print_words(console, "--all prints every claim, and how those that do not hold were tested", "dim")


def _show_line(console: Console, line: LedgerLine) -> None:
    """Print a line with its verdict, and below it what is printed and what was measured."""
    print_words(console, f"{line.section}: {line.claim}: {line.verdict}", _STYLES[line.verdict])
    printed = "" if line.printed is None else f"printed: {line.printed}; "
    print_words(console, f"  {printed}measured: {line.measured}")


def _show_evidence(console: Console, line: LedgerLine, whole: bool) -> None:
    """Print the conditions that a line does not meet; all of its conditions and tests if ``whole``."""
    for threshold in line.thresholds:
        if whole or not threshold.met:
            print_words(console, f"    wanted: {threshold.text}; it is {threshold.value:.6g}")
    for check in line.checks:
        if whole or not check.passes:
            word = "passes" if check.passes else "FAILS"
            print_words(console, f"    {check.what}: {check.value:.2e}, limit {check.limit:.2e}: {word}")
