"""Terminal output of `velodrome run`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from ...reports.drawing import (
    COLUMNS,
    describe_required_friction,
    format_numbers,
    format_table,
    format_verdict,
    group_remarks,
)
from .tables import Column, print_table
from .terminal import print_line, print_words

if TYPE_CHECKING:
    from ..run import RunOutcome, RunPlan


def show_outcome(console: Console, plan: RunPlan, outcome: RunOutcome) -> None:
    """Print the table of a run and the path of its folder."""
    duration = plan.scenario.simulation.duration
    console.print()
    print_words(console, f"{plan.name}: {plan.scenario.title}, {duration:g} s", "bold")
    table = format_table(outcome.metrics)
    ranked = {name: outcome.metrics[name] for name in table}
    columns = [Column("engine", list(table), right=False)]
    falls = [metrics["fell_at"] for metrics in ranked.values()]
    if any(fell is not None for fell in falls):
        columns.append(Column("fell\nat", format_numbers(falls), "s"))
    for k, (title, unit, _, _) in enumerate(COLUMNS):
        columns.append(Column(title.replace(" ", "\n"), [cells[k] for cells in table.values()], unit))
    print_table(console, columns)
    for verdict in outcome.verdicts:
        style = "green" if verdict["holds"] else "red"
        print_words(console, format_verdict(verdict), style)
    for name, reason in outcome.failures.items():
        print_words(console, f"{name} did not run: {reason}", "red")
    for line in group_remarks(ranked, duration):
        print_words(console, line, "yellow")
    friction = describe_required_friction(outcome.metrics)
    if friction is not None:
        print_words(console, friction, "dim")
    for name, reason in plan.left_out.items():
        print_words(console, f"{name} left out: {reason}", "dim")
    command = Path(sys.executable).with_name("velodrome")
    if command.is_relative_to(Path.cwd()):
        command = command.relative_to(Path.cwd())
    print_line(console, f"run folder: {outcome.folder}")
    print_line(console, f"report:     {outcome.folder / 'report.html'}")
    if (outcome.folder / "comparison.rrd").exists():
        print_line(console, f"recording:  {command} view {outcome.folder}")


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
