"""Terminal output of `velodrome check`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby

from rich.console import Console
from rich.text import Text

from ...reports.drawing import format_numbers
from ..gate import CHANGES, NEW, SHOWN, Verdict, count_held, count_statuses, find_outcome, status_word
from .tables import Column, print_table
from .terminal import print_line, print_words

STATUS_STYLES = {
    "holds": "green",
    "shown": "green",
    "better": "cyan",
    "changed": "red",
    "worse": "red",
    "missing": "red",
    NEW: "cyan",
}


def show_verdicts(console: Console, verdicts: list[tuple[str, Verdict]], renewed: bool = False) -> None:
    """Print the gate's verdicts: one row per engine, then a line for every verdict that needs attention.

    If the baselines are ``renewed`` by the same run, the gate neither holds nor fails, and no result is printed.
    """
    for name, group in groupby(verdicts, key=lambda item: item[0]):
        console.print(name, style="bold", markup=False)
        by_engine = groupby((verdict for _, verdict in group), key=lambda verdict: verdict.engine)
        rows = [_format_engine_row(engine, list(judged)) for engine, judged in by_engine]
        engines, held, friction, cpu, moved = zip(*rows, strict=True)
        columns = [
            Column("engine", engines, right=False),
            Column("quantities\nthat hold", held),
            Column("friction\nneeded", format_numbers(friction), "1"),
            Column("CPU time,\nreference 1", format_numbers(cpu), "1"),
            Column("moved most,\nagainst its limit", moved, right=False),
        ]
        print_table(console, columns)
    changes = {(name, one.engine): one.reason for name, one in verdicts if one.quantity == CHANGES}
    for name, verdict in verdicts:
        if verdict.told:
            line, style = f"{name}: {verdict.engine}: {verdict.reason}", "default"
            # That the version or a setting is another is no verdict on a quantity. It has a line of its own.
            if verdict.quantity != CHANGES:
                reason = verdict.reason.replace(f"; {changes.get((name, verdict.engine))}", "")
                line = f"{name}: {verdict.engine}: {verdict.quantity}: {status_word(verdict)}: {reason}"
                style = STATUS_STYLES[verdict.status]
            print_words(console, line, style)
    if not renewed:
        _show_outcome(console, [verdict for _, verdict in verdicts])


def show_unjudged(console: Console, package: str | None, others: Sequence[str], left_out: Mapping[str, str]) -> None:
    """Print which engines were not judged: ``others`` of a package's gate, and those whose libraries are missing."""
    if others:
        print_words(console, f"not judged, not of the package {package}: {', '.join(others)}")
    if left_out:
        install = "; ".join(dict.fromkeys(left_out.values()))
        print_words(
            console, f"not judged, their libraries are not installed: {', '.join(left_out)}; install: {install}"
        )


def show_warnings(console: Console, warnings: Mapping[str, Sequence[str]]) -> None:
    """Print what is to be said of the scenarios' bicycles."""
    for name, lines in warnings.items():
        for line in lines:
            print_words(console, f"warning: {name}: {line}", "yellow")


def show_update(console: Console, written: Sequence[str], refused: Sequence[tuple[str, Verdict]]) -> None:
    """Print which baselines were written, and which were not."""
    if not written and not refused:
        console.print("no baseline written: nothing moved beyond its limit")
    for path in written:
        print_line(console, f"baseline written: {path}")
    for name, verdict in refused:
        print_words(console, f"no baseline written of {verdict.engine} on {name}: {verdict.reason}", "red")


def _show_outcome(console: Console, verdicts: list[Verdict]) -> None:
    outcome, others = find_outcome(verdicts), count_statuses(verdicts)
    failing = count_statuses(verdicts, failing=True)
    if outcome == "holds":
        line, style = "the gate holds" + (f": {others}, the rest as before" if others else ""), "bold green"
    elif outcome == NEW:
        engines = dict.fromkeys(verdict.engine for verdict in verdicts if verdict.status == NEW)
        rest = "" if all(verdict.status == NEW for verdict in verdicts) else "; all else passes"
        line, style = f"no verdict, without a baseline yet: {', '.join(engines)}{rest}", "bold yellow"
    else:
        line, style = f"the gate fails: {failing}", "bold red"
    print_words(console, line, style)


def _format_engine_row(engine: str, verdicts: list[Verdict]) -> tuple[str, Text, float | None, float | None, str]:
    held = ", ".join(filter(None, [count_held(verdicts), count_statuses(verdicts)]))
    style = {"holds": "green", NEW: "cyan"}.get(find_outcome(verdicts), "red")
    shares = {verdict.quantity: share for verdict in verdicts if (share := verdict.share) is not None}
    moved = "nothing moved" if shares else "–"
    if any(shares.values()):
        most = max(shares, key=lambda quantity: shares[quantity])
        moved = f"{most}, {_format_share(shares[most])}"
    values = {verdict.quantity: verdict.value for verdict in verdicts}
    friction, cpu = (values.get(name) for name in SHOWN)
    return engine, Text(held, style), friction, cpu, moved


def _format_share(share: float) -> str:
    """Format how many times its limit something moved."""
    return f"{share:.2g}" if share < 100 else f"{share:.0f}"
