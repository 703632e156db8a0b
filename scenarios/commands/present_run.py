"""Terminal output of `velodrome run`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from ...reports.drawing import COLUMNS, describe_required_friction, format_table, format_verdict, make_remarks
from .tables import Column, print_table

if TYPE_CHECKING:
    from ..run import RunOutcome
    from ..scenario import Scenario


def show_outcome(console: Console, name: str, scenario: Scenario, outcome: RunOutcome) -> None:
    """Print the table of a run and the path of its folder."""
    duration = scenario.simulation.duration
    ridden = "" if outcome.release is None else f", with {outcome.release}"
    console.print()
    console.print(f"{name}: {scenario.title}, {duration:g} s{ridden}", style="bold", markup=False)
    table = format_table(outcome.metrics)
    columns = [Column("engine", list(table), right=False)]
    for k, (title, unit, _, _) in enumerate(COLUMNS):
        columns.append(Column(title.replace(" ", "\n"), [cells[k] for cells in table.values()], unit))
    print_table(console, columns)
    for verdict in outcome.verdicts:
        style = "green" if verdict["holds"] else "red"
        console.print(format_verdict(verdict), style=style, markup=False, soft_wrap=True)
    for engine, reason in outcome.failures.items():
        console.print(f"{engine} did not run: {reason}", style="red", markup=False, soft_wrap=True)
    for engine in table:
        for line in make_remarks(engine, outcome.metrics[engine], duration):
            console.print(line, style="yellow", markup=False, soft_wrap=True)
    friction = describe_required_friction(outcome.metrics)
    if friction is not None:
        console.print(friction, style="dim", markup=False, soft_wrap=True)
    for engine, reason in outcome.left_out.items():
        console.print(f"{engine} left out: {reason}", style="dim", markup=False, soft_wrap=True)
    command = Path(sys.executable).with_name("velodrome")
    if command.is_relative_to(Path.cwd()):
        command = command.relative_to(Path.cwd())
    console.print(f"run folder: {outcome.folder}", markup=False, soft_wrap=True)
    console.print(f"report:     {outcome.folder / 'report.html'}", markup=False, soft_wrap=True)
    if (outcome.folder / "comparison.rrd").exists():
        console.print(f"recording:  {command} view {outcome.folder}", markup=False, soft_wrap=True)


def outcome_json(name: str, outcome: RunOutcome) -> dict[str, Any]:
    """Return the JSON document of one run."""
    return {
        "scenario": name,
        "release": outcome.release,
        "folder": str(outcome.folder),
        "complete": not outcome.interrupted,
        "engines": outcome.metrics,
        "failures": outcome.failures,
        "left_out": outcome.left_out,
        "verdicts": outcome.verdicts,
    }
