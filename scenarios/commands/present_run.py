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
    from ..run import RunOutcome
    from ..scenario import Scenario


def show_outcome(console: Console, name: str, scenario: Scenario, outcome: RunOutcome) -> None:
    """Print the table of a run and the path of its folder."""
    duration = scenario.simulation.duration
    ridden = "" if outcome.release is None else f", with {outcome.release}"
    console.print()
    print_words(console, f"{name}: {scenario.title}, {duration:g} s{ridden}", "bold")
    table = format_table(outcome.metrics)
    ranked = {engine: outcome.metrics[engine] for engine in table}
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
    for engine, reason in outcome.failures.items():
        print_words(console, f"{engine} did not run: {reason}", "red")
    for line in group_remarks(ranked, duration):
        print_words(console, line, "yellow")
    friction = describe_required_friction(outcome.metrics)
    if friction is not None:
        print_words(console, friction, "dim")
    for engine, reason in outcome.left_out.items():
        print_words(console, f"{engine} left out: {reason}", "dim")
    command = Path(sys.executable).with_name("velodrome")
    if command.is_relative_to(Path.cwd()):
        command = command.relative_to(Path.cwd())
    print_line(console, f"run folder: {outcome.folder}")
    print_line(console, f"report:     {outcome.folder / 'report.html'}")
    if outcome.metrics:
        print_line(console, f"recording:  {command} view {outcome.folder}")


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
