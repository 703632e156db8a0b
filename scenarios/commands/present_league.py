"""Terminal output of `velodrome league`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.console import Console

from ...reports.page import LEAGUE_COLUMNS, find_creeping, rank_rides
from .tables import Column, print_table

_WITHOUT_RIDE = ("failed", "unsuitable")


def show_league(console: Console, document: Mapping[str, Any]) -> None:
    """Print a table for each scenario, by position error, and below it the engines that did not ride."""
    for scenario, table in document["scenarios"].items():
        rides = rank_rides(document, scenario)
        console.print()
        title = f"{scenario}: {table['title']}, {table['duration']:g} s"
        console.print(title, style="bold", markup=False, soft_wrap=True)
        rode = [(name, ride) for name, ride in rides if ride["status"] not in _WITHOUT_RIDE]
        columns = [Column("engine", [name for name, _ in rode], right=False)]
        columns += [
            Column(column.title.replace(" ", "\n"), [column.format_cell(ride) for _, ride in rode], column.unit)
            for column in LEAGUE_COLUMNS
        ]
        print_table(console, columns)
        for name, points in find_creeping(document, scenario).items():
            step, time = points[0]
            line = f"{name} creeps: slip = J̇q̇ / b with 1 / b = {time:.3g} s, {time / step:.3g} steps"
            console.print(line, style="dim", markup=False, soft_wrap=True)
        for name, ride in rides:
            if ride["horizon"] is not None and ride["horizon"] < table["duration"]:
                line = (
                    f"{name}: beyond {ride['horizon']:.2f} s the motion's own instability makes its error meaningless"
                )
                console.print(line, style="yellow", markup=False, soft_wrap=True)
            if ride["status"] == "ended":
                line = f"{name} ended early: {ride['reason']}"
                console.print(line, style="yellow", markup=False, soft_wrap=True)
            if ride["status"] == "unsuitable":
                line = f"{name} left out: {ride['reason']}"
                console.print(line, style="dim", markup=False, soft_wrap=True)
            if ride["status"] == "failed":
                console.print(f"{name} did not ride: {ride['reason']}", style="red", markup=False, soft_wrap=True)
    if not document["complete"]:
        console.print("interrupted: the finished rides are shown", style="yellow")
