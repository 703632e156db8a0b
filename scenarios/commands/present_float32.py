"""Terminal output of `velodrome float32`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.console import Console

from .tables import Column, print_table

# (title, key of a point, unit, format): all of them fit in 80 columns.
_COLUMNS = (
    ("own\nstart", "distance", "m", ".1e"),
    ("errors\nof steps", "step_errors", "m", ".1e"),
    ("\nrest", "unexplained", "m", ".1e"),
    ("all\nstarts", "rms_distance", "m, rms", ".1e"),
    ("first\n0.1 s", "start", "m, rms", ".1e"),
    ("unrelated\ndigits", "unrelated_digits", "m", ".1e"),
    ("repeated\ndigits", "repeated_digits", "m", ".1e"),
    ("all /\ndigits", "measured_to_predicted", "", ".2f"),
)
_EXPLANATION = (
    "own, all: distances of D, measured; errors of steps: what those of the own ride lead to, and rest what they leave "
    "of its deviation; first 0.1 s: what they lead to; digits: what the last digits of the state lead to, by roundings "
    "that are unrelated to each other and by those that repeat"
)


def show_float32(console: Console, document: Mapping[str, Any]) -> None:
    """Print a table for each variant of each engine."""
    title = f"{document['scenario']}: what float32 costs, in the distance of D from the ride in float64"
    console.print(title, style="bold", markup=False)
    for line in document["warnings"]:
        console.print(f"warning: {line}", style="yellow", markup=False, highlight=False, soft_wrap=True)
    for name, entry in document["engines"].items():
        if entry["reason"] is not None:
            console.print(
                f"{name} left out: {entry['reason']}", style="dim", markup=False, highlight=False, soft_wrap=True
            )
            continue
        for variant, found in entry["variants"].items():
            console.print()
            label = f"{name}, {variant}, against {entry['counterpart']} in float64"
            console.print(label, style="bold", markup=False)
            _print_points(console, found["points"])
            if found["ended"] is not None:
                line = f"a ride ended {found['ended']}"
                console.print(line, style="yellow", markup=False, highlight=False, soft_wrap=True)
        for failure in entry["failures"]:
            line = f"{name}, {failure['variant']}, did not ride: {failure['reason']}"
            console.print(line, style="red", markup=False, highlight=False, soft_wrap=True)
    if any(found["points"] for entry in document["engines"].values() for found in entry["variants"].values()):
        console.print()
        console.print(_EXPLANATION, style="dim", markup=False, highlight=False)
    if document["reference_distance"]:
        console.print()
        far = ", ".join(f"{row['distance']:.1e} m at {row['time']:g} s" for row in document["reference_distance"])
        console.print(f"float64 itself is {far} from the reference", markup=False, highlight=False)


def _print_points(console: Console, points: list[Mapping[str, Any]]) -> None:
    columns = [Column("time", [f"{point['time']:g}" for point in points], "s")]
    columns += [
        Column(title, ["–" if point[key] is None else format(point[key], digits) for point in points], unit)
        for title, key, unit, digits in _COLUMNS
    ]
    print_table(console, columns)
