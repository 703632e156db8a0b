"""Terminal output of `velodrome check`."""

from __future__ import annotations

from itertools import groupby

from rich.console import Console
from rich.text import Text

from ..gate import CHANGES, NEW, SHOWN, Verdict, count_held, count_statuses, find_outcome, status_word
from .tables import Column, print_table

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
            Column("hold", held),
            Column("friction\nneeded", friction),
            Column("CPU time,\nreference 1", cpu),
            Column("moved most,\nagainst its limit", moved, right=False),
        ]
        print_table(console, columns)
    for name, verdict in verdicts:
        if verdict.told:
            # That the version or a setting is another is no verdict on a quantity.
            what = "" if verdict.quantity == CHANGES else f"{verdict.quantity}: {status_word(verdict)}: "
            style = "default" if verdict.quantity == CHANGES else STATUS_STYLES[verdict.status]
            console.print(
                f"{name}: {verdict.engine}: {what}{verdict.reason}", style=style, markup=False, soft_wrap=True
            )
    if not renewed:
        _show_outcome(console, [verdict for _, verdict in verdicts])


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
    console.print(line, style=style, markup=False, highlight=False, soft_wrap=True)


def _format_engine_row(engine: str, verdicts: list[Verdict]) -> tuple[str, Text, str, str, str]:
    held = ", ".join(filter(None, [count_held(verdicts), count_statuses(verdicts)]))
    style = {"holds": "green", NEW: "cyan"}.get(find_outcome(verdicts), "red")
    shares = {verdict.quantity: share for verdict in verdicts if (share := verdict.share) is not None}
    moved = "nothing moved" if shares else "–"
    if any(shares.values()):
        most = max(shares, key=lambda quantity: shares[quantity])
        moved = f"{most}, {shares[most]:.2g}"
    values = {verdict.quantity: verdict.value for verdict in verdicts}
    friction, cpu = ("–" if (value := values.get(name)) is None else f"{value:.2g}" for name in SHOWN)
    return engine, Text(held, style), friction, cpu, moved
