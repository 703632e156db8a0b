"""The ledger as Markdown."""

from __future__ import annotations

from collections.abc import Sequence

from .ledger import LedgerLine, counts

_WHOSE = {"paper": "the paper's", "ours": "ours: the measurement does not pass its own tests"}


def describe_fault(line: LedgerLine) -> str:
    """Say whose fault it is that a line does not hold."""
    return _WHOSE[line.fault or "ours"]


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
        verdict = line.verdict if line.holds else f"**{line.verdict}**: {describe_fault(line)}"
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
