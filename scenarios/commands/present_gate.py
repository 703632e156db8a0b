"""Terminal output of `velodrome check`."""

from __future__ import annotations

from itertools import groupby

from rich.console import Console
from rich.text import Text

from ..gate import SHOWN, Verdict
from .tables import Column, print_table

STATUS_STYLES = {
    "holds": "green",
    "shown": "green",
    "better": "cyan",
    "changed": "red",
    "worse": "red",
    "missing": "red",
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
            line = f"{name}: {verdict.engine}: {verdict.quantity}: {verdict.status}: {verdict.reason}"
            console.print(line, style=STATUS_STYLES[verdict.status], markup=False, soft_wrap=True)
    if renewed:
        return
    passes = all(verdict.passes for _, verdict in verdicts)
    console.print("the gate holds" if passes else "the gate fails", style="bold green" if passes else "bold red")


def _format_engine_row(engine: str, verdicts: list[Verdict]) -> tuple[str, Text, str, str, str]:
    held = sum(verdict.status == "holds" for verdict in verdicts)
    judged = sum(verdict.status != "shown" for verdict in verdicts)
    passes = all(verdict.passes for verdict in verdicts)
    shares = {verdict.quantity: share for verdict in verdicts if (share := verdict.share) is not None}
    moved = "nothing moved" if shares else "–"
    if any(shares.values()):
        most = max(shares, key=lambda quantity: shares[quantity])
        moved = f"{most}, {shares[most]:.2g}"
    values = {verdict.quantity: verdict.value for verdict in verdicts}
    friction, cpu = ("–" if (value := values.get(name)) is None else f"{value:.2g}" for name in SHOWN)
    return engine, Text(f"{held} of {judged}", "green" if passes else "red"), friction, cpu, moved
