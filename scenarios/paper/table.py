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


def show_ledger(console: Console, lines: Sequence[LedgerLine]) -> None:
    """Print the ledger: every line in the paper's order; those that do not hold follow, with whose fault they are."""
    table = Table("§", "claim", "printed", "measured", "verdict", box=None, pad_edge=False)
    for line in lines:
        row = (line.section, line.claim, line.printed or "", line.measured)
        table.add_row(*(Text(cell) for cell in row), Text(line.verdict, VERDICT_STYLES[line.verdict]))
    console.print(table)
    console.print()
    for line in lines:
        if not line.holds:
            console.print(_describe_failure(line), style="red", markup=False, highlight=False, soft_wrap=True)
            for threshold in line.thresholds:
                text = f"    wanted: {threshold.text}; it is {threshold.value:.6g}"
                console.print(text, markup=False, highlight=False, soft_wrap=True)
            for check in line.checks:
                word = "passes" if check.passes else "FAILS"
                text = f"    {check.what}: {check.value:.2e}, limit {check.limit:.2e}: {word}"
                console.print(text, markup=False, highlight=False, soft_wrap=True)
    console.print(ledger_summary(lines), markup=False, highlight=False, soft_wrap=True)


def _describe_failure(line: LedgerLine) -> str:
    return f"{line.section}: {line.claim}: {line.measured} ({_WHOSE[line.fault or 'ours']})"


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
