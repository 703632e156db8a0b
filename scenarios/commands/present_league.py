"""Terminal output of `velodrome league`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Console

from ...reports.drawing import format_numbers
from ...reports.page import LEAGUE_COLUMNS, LeagueColumn, find_creeping, rank_rides
from .tables import Column, print_table
from .terminal import print_words

_WITHOUT_RIDE = ("failed", "unsuitable")
_DIGITS = 3


def show_league(console: Console, document: Mapping[str, Any]) -> None:
    """Print a table for each scenario, by position error, and below it the engines that did not ride."""
    for scenario, table in document["scenarios"].items():
        rides = rank_rides(document, scenario)
        console.print()
        title = f"{scenario}: {table['title']}, {table['duration']:g} s"
        print_words(console, title, "bold")
        rode = [(name, ride) for name, ride in rides if ride["status"] not in _WITHOUT_RIDE]
        columns = [Column("engine", [name for name, _ in rode], right=False)]
        columns += [
            Column(column.title.replace(" ", "\n"), _format_cells(column, [ride for _, ride in rode]), column.unit)
            for column in LEAGUE_COLUMNS
        ]
        print_table(console, columns)
        for line, style in _list_remarks(document, scenario, rides):
            print_words(console, line, style)
    if not document["complete"]:
        console.print("interrupted: the finished rides are shown", style="yellow")


def _format_cells(column: LeagueColumn, rides: Sequence[Mapping[str, Any]]) -> list[str]:
    """Format a column; numbers in one notation, which the rides that did not fall decide."""
    values = [ride[column.key] for ride in rides]
    if any(isinstance(value, bool) for value in values):
        return [column.format_cell(ride) for ride in rides]
    return format_numbers(values, _DIGITS, [ride["status"] == "rode" for ride in rides])


def _list_remarks(
    document: Mapping[str, Any], scenario: str, rides: Sequence[tuple[str, Mapping[str, Any]]]
) -> list[tuple[str, str]]:
    """Return the remarks on a table with their styles, in one line those that say the same of several engines."""
    duration = document["scenarios"][scenario]["duration"]
    found: dict[tuple[str, str], list[str]] = {}
    for name, ride in rides:
        if ride["status"] == "failed":
            found.setdefault((f"did not ride ({ride['reason']})", "red"), []).append(name)
        if ride["status"] == "ended":
            found.setdefault((f"ended early ({ride['reason']})", "yellow"), []).append(name)
        if ride["horizon"] is not None and ride["horizon"] < duration:
            about = "error without meaning beyond the horizon, by the motion's own instability"
            found.setdefault((about, "yellow"), []).append(f"{name} {ride['horizon']:.2f} s")
        if ride["status"] == "unsuitable":
            found.setdefault((f"left out ({ride['reason']})", "dim"), []).append(name)
    for name, points in find_creeping(document, scenario).items():
        step, time = points[0]
        about = "wheels creep, slip = J̇q̇ / b, with 1 / b"
        found.setdefault((about, "dim"), []).append(f"{name} {time:.3g} s, {time / step:.3g} steps")
    order = ("red", "yellow", "dim")
    lines = [(f"{about}: {'; '.join(names)}", style) for (about, style), names in found.items()]
    return sorted(lines, key=lambda line: order.index(line[1]))
