"""The ledger as a table for a terminal and as Markdown."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console
from rich.table import Table
from rich.text import Text

from .ledger import DEPENDS, FAILS, REPRODUCED, ROUNDS, TRUNCATED, UNTESTABLE, LedgerLine, counts

VERDICT_STYLES = {
    REPRODUCED: "green",
    ROUNDS: "green",
    TRUNCATED: "yellow",
    DEPENDS: "yellow",
    FAILS: "red",
    UNTESTABLE: "dim",
}
_WHOSE = {"paper": "the paper's", "ours": "ours: the measurement does not pass its own tests"}


def show_ledger(console: Console, lines: Sequence[LedgerLine], surprises: Sequence[str], whole: bool = False) -> None:
    """Print the lines that matter, then the result: how many claims hold, and what is not as known.

    Parameters
    ----------
    console : Console
    lines : sequence of LedgerLine
    surprises : sequence of str
        See `list_surprises`.
    whole : bool
        Whether to print all lines first, in the paper's order, and how those that do not hold were tested.
    """
    if whole:
        _show_all(console, lines)
    for line in lines:
        if not line.holds:
            console.print(_describe_failure(line), style=VERDICT_STYLES[line.verdict], markup=False, soft_wrap=True)
            _show_evidence(console, line, whole)
        elif line.verdict in (TRUNCATED, DEPENDS):
            said = f"{line.section}: {line.claim}: {line.verdict}: {line.measured}"
            console.print(said, style=VERDICT_STYLES[line.verdict], markup=False, soft_wrap=True)
    console.print()
    console.print(ledger_summary(lines), style="bold", markup=False, soft_wrap=True)
    if surprises:
        for surprise in surprises:
            console.print(surprise, style="bold red", markup=False, soft_wrap=True)
    else:
        failing = sum(not line.holds for line in lines)
        said = f"the {failing} that do not hold are the paper's and known; all measurements pass their own tests"
        console.print(said, style="green", markup=False, soft_wrap=True)
    if not whole:
        console.print("--all prints every claim, and how those that do not hold were tested", style="dim")


def _show_all(console: Console, lines: Sequence[LedgerLine]) -> None:
    table = Table("§", "claim", "printed", "measured", "verdict", box=None, pad_edge=False)
    for line in lines:
        row = (line.section, line.claim, line.printed or "", line.measured)
        table.add_row(*(Text(cell) for cell in row), Text(line.verdict, VERDICT_STYLES[line.verdict]))
    console.print(table)
    console.print()


def _show_evidence(console: Console, line: LedgerLine, whole: bool) -> None:
    """Print the conditions that a line does not meet; all of its conditions and tests if ``whole``."""
    for threshold in line.thresholds:
        if whole or not threshold.met:
            text = f"    wanted: {threshold.text}; it is {threshold.value:.6g}"
            console.print(text, markup=False, soft_wrap=True)
    for check in line.checks:
        if whole or not check.passes:
            word = "passes" if check.passes else "FAILS"
            text = f"    {check.what}: {check.value:.2e}, limit {check.limit:.2e}: {word}"
            console.print(text, markup=False, soft_wrap=True)


def _describe_failure(line: LedgerLine) -> str:
    return f"{line.section}: {line.claim}: does not hold: {line.measured} ({_WHOSE[line.fault or 'ours']})"


def ledger_summary(lines: Sequence[LedgerLine]) -> str:
    """Return the numbers of lines by verdict as one line of text."""
    return f"{len(lines)} lines: " + ", ".join(f"{n} {verdict}" for verdict, n in counts(lines).items() if n)


def ledger_markdown(lines: Sequence[LedgerLine]) -> str:
    """Return the ledger as a Markdown document."""
    rows = ["# The paper, line by line", "", ledger_summary(lines), ""]
    rows += [
        "| § | claim | printed | measured | verdict | threshold | computed | reproduced by |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for line in lines:
        verdict = line.verdict if line.holds else f"**{line.verdict}**: {_WHOSE[line.fault or 'ours']}"
        cells = (
            line.section,
            line.claim,
            line.printed or "",
            line.measured,
            verdict,
            line.threshold,
            ". ".join(part for part in (line.source.computed, line.source.search) if part),
            _list_commands(line),
        )
        rows.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(rows) + "\n"


def _list_commands(line: LedgerLine) -> str:
    command = [line.source.command] if line.source.command else []
    return ", ".join(f"`{part}`" for part in (*command, *line.source.functions))
