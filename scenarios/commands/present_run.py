"""What `velodrome run` shows."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table

from ...reports.drawing import COLUMNS, format_cell, format_verdict, make_remarks

if TYPE_CHECKING:
    from ..run import RunOutcome, RunPlan


def show_outcome(console: Console, plan: RunPlan, outcome: RunOutcome) -> None:
    """Print the table of a run and where its folder is."""
    duration = plan.scenario.simulation.duration
    console.print()
    console.print(f"{plan.name}: {plan.scenario.title}, {duration:g} s", style="bold", markup=False)
    cells = {
        name: [format_cell(values, metric, part) for _, _, metric, part in COLUMNS]
        for name, values in outcome.metrics.items()
    }
    for table in _metric_tables(cells, console.width):
        console.print(table)
    for name, values in outcome.metrics.items():
        for line in make_remarks(name, values, duration):
            console.print(line, style="yellow", markup=False, soft_wrap=True)
    for name, reason in plan.left_out.items():
        console.print(f"{name} left out: {reason}", style="dim", markup=False, highlight=False, soft_wrap=True)
    for name, reason in outcome.failures.items():
        console.print(f"{name} did not run: {reason}", style="red", markup=False, soft_wrap=True)
    for verdict in outcome.verdicts:
        style = "green" if verdict["holds"] else "red"
        console.print(format_verdict(verdict), style=style, markup=False, soft_wrap=True)
    command = Path(sys.executable).with_name("velodrome")
    if command.is_relative_to(Path.cwd()):
        command = command.relative_to(Path.cwd())
    console.print(f"run folder: {outcome.folder}", markup=False, highlight=False, soft_wrap=True)
    console.print(f"report:     {outcome.folder / 'report.html'}", markup=False, highlight=False, soft_wrap=True)
    if (outcome.folder / "comparison.rrd").exists():
        console.print(f"recording:  {command} view {outcome.folder}", markup=False, highlight=False, soft_wrap=True)


def _metric_tables(cells: Mapping[str, list[str]], width: int) -> Iterator[Table]:
    """The table of a run, or several one below the other where it is wider than the terminal.

    Every engine's name and every figure is whole at any width.
    """
    texts = [(*title.split(), unit) for title, unit, _, _ in COLUMNS]
    widths = [max(map(len, (*text, *(row[k] for row in cells.values())))) for k, text in enumerate(texts)]
    gap, room = 2, width - max((len(name) for name in cells), default=0)
    parts: list[list[int]] = [[]]
    used = 0
    for k, column in enumerate(widths):
        if parts[-1] and used + gap + column > room:
            parts.append([])
            used = 0
        parts[-1].append(k)
        used += gap + column
    for part in parts:
        table = Table(box=None, pad_edge=False, padding=(0, gap, 0, 0))
        table.add_column("engine", no_wrap=True)
        for k in part:
            table.add_column("{}\n{}\n[dim]{}[/dim]".format(*texts[k]), justify="right", no_wrap=True)
        for name, row in cells.items():
            table.add_row(name, *(row[k] for k in part))
        yield table


def outcome_json(plan: RunPlan, outcome: RunOutcome) -> dict[str, Any]:
    """JSON of one run."""
    return {
        "scenario": plan.name,
        "folder": str(outcome.folder),
        "complete": not outcome.interrupted,
        "engines": outcome.metrics,
        "failures": outcome.failures,
        "left_out": plan.left_out,
        "verdicts": outcome.verdicts,
    }
