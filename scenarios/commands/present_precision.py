"""Terminal output of `velodrome precision`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from rich.console import Console

from ...reports.drawing import format_numbers
from ...reports.measure import compared_time
from .tables import Column, print_table
from .terminal import print_words

# (title, unit, key of a point)
_COLUMNS = (
    ("step", "s", "step"),
    ("position error", "m", "position_error"),
    ("energy drift", "1", "energy_drift"),
    ("largest slip", "m/s", "max_slip"),
    ("CPU time", "s", "cpu_time"),
)
_DIGITS = 3


def show_precision(console: Console, document: Mapping[str, Any]) -> None:
    """Print a work-precision study: one table per engine, the most accurate engine first."""
    limit = "" if document["horizon"] is None else "; beyond, the motion's own instability leaves nothing to compare"
    title = f"{document['scenario']}: errors over {compared_time(document):.4g} s{limit}"
    print_words(console, title, "bold")
    for line in document["warnings"]:
        print_words(console, f"warning: {line}", "yellow")
    for name, entry in sorted(document["engines"].items(), key=lambda item: _least_error(item[1])):
        console.print()
        console.print(name, style="bold", markup=False)
        points = entry["points"]
        columns = [
            Column(title, format_numbers([point[key] for point in points], _DIGITS), unit)
            for title, unit, key in _COLUMNS
        ]
        orders = ["", "", *("–" if order is None else f"{order:.3f}" for order in entry["orders"])]
        orders += ["–"] * (len(points) - len(orders))  # of steps that change nothing
        columns.append(Column("order", orders[: len(points)], "1"))
        if points:
            print_table(console, columns)
        for line in _precision_lines(entry):
            print_words(console, line)
        for failure in entry["failures"]:
            what = "" if failure["step"] is None else f"step {failure['step']:g}: "
            print_words(console, f"{what}{failure['reason']}", "yellow")


def _least_error(entry: Mapping[str, Any]) -> float:
    return min((point["position_error"] for point in entry["points"]), default=math.inf)


def _precision_lines(entry: Mapping[str, Any]) -> Iterator[str]:
    if entry["richardson_error"] is not None:
        yield (
            f"limit of the steps: {entry['richardson_error']:.2g} m from the reference over {entry['window']:.4g} s; "
            f"the last extrapolation moved it by {entry['richardson_uncertainty']:.2g} m"
        )
    found = entry["eigenvalues"]
    if found is not None:
        yield f"its own eigenvalues: {found['error']:.2g} 1/s from the reference's at the most"
