"""Terminal output of `velodrome run`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from ...reports.drawing import COLUMNS, describe_required_friction, format_table, format_verdict, make_remarks
from .tables import Column, print_table

if TYPE_CHECKING:
    from ..run import RunOutcome, RunPlan


def show_outcome(console: Console, plan: RunPlan, outcome: RunOutcome) -> None:
    """Print the table of a run and the path of its folder."""
    duration = plan.scenario.simulation.duration
    console.print()
    console.print(f"{plan.name}: {plan.scenario.title}, {duration:g} s", style="bold", markup=False)
    table = format_table(outcome.metrics)
    columns = [Column("engine", list(table), right=False)]
    for k, (title, unit, _, _) in enumerate(COLUMNS):
        columns.append(Column(title.replace(" ", "\n"), [cells[k] for cells in table.values()], unit))
    print_table(console, columns)
    for verdict in outcome.verdicts:
        style = "green" if verdict["holds"] else "red"
        console.print(format_verdict(verdict), style=style, markup=False, soft_wrap=True)
    for name, reason in outcome.failures.items():
        console.print(f"{name} did not run: {reason}", style="red", markup=False, soft_wrap=True)
    for name in table:
        for line in make_remarks(name, outcome.metrics[name], duration):
            console.print(line, style="yellow", markup=False, soft_wrap=True)
    friction = describe_required_friction(outcome.metrics)
    if friction is not None:
        console.print(friction, style="dim", markup=False, soft_wrap=True)
    for name, reason in plan.left_out.items():
        console.print(f"{name} left out: {reason}", style="dim", markup=False, soft_wrap=True)
    command = Path(sys.executable).with_name("velodrome")
    if command.is_relative_to(Path.cwd()):
        command = command.relative_to(Path.cwd())
    console.print(f"run folder: {outcome.folder}", markup=False, soft_wrap=True)
    console.print(f"report:     {outcome.folder / 'report.html'}", markup=False, soft_wrap=True)
    if outcome.metrics:
        console.print(f"recording:  {command} view {outcome.folder}", markup=False, soft_wrap=True)


def outcome_json(plan: RunPlan, outcome: RunOutcome) -> dict[str, Any]:
    """Return the JSON document of one run."""
    return {
        "scenario": plan.name,
        "folder": str(outcome.folder),
        "complete": not outcome.interrupted,
        "engines": outcome.metrics,
        "failures": outcome.failures,
        "left_out": plan.left_out,
        "verdicts": outcome.verdicts,
    }
