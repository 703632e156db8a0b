"""Terminal output of `velodrome float32`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.console import Console

from .tables import Column, print_table

# (title, key of a point, unit, format)
_COLUMNS = (
    ("distance", "distance", "m", ".1e"),
    ("all starts", "rms_distance", "m, rms", ".1e"),
    ("unrelated\nlast digits", "unrelated_digits", "m", ".1e"),
    ("repeated\nlast digits", "repeated_digits", "m", ".1e"),
    ("measured /\npredicted", "measured_to_predicted", "", ".2f"),
    ("errors of\nits steps", "step_errors", "m", ".1e"),
    ("measured /\ncarried", "measured_to_step_errors", "", ".2f"),
)


def show_float32(console: Console, document: Mapping[str, Any]) -> None:
    """Print a table for each variant of each engine."""
    title = f"{document['scenario']}: what float32 costs, in the distance of D from the ride in float64"
    console.print(title, style="bold", markup=False, soft_wrap=True)
    for line in document["warnings"]:
        console.print(f"warning: {line}", style="yellow", markup=False, highlight=False, soft_wrap=True)
    for name, entry in document["engines"].items():
        if entry["reason"] is not None:
            console.print(
                f"{name} left out: {entry['reason']}", style="dim", markup=False, highlight=False, soft_wrap=True
            )
            continue
        for variant, found in entry["variants"].items():
            points = found["points"]
            console.print()
            label = f"{name}, {variant}, against {entry['counterpart']} in float64"
            console.print(label, style="bold", markup=False, soft_wrap=True)
            columns = [Column("time", [f"{point['time']:g}" for point in points], "s")]
            columns += [
                Column(title, ["–" if point[key] is None else format(point[key], digits) for point in points], unit)
                for title, key, unit, digits in _COLUMNS
            ]
            print_table(console, columns)
            if found["ended"] is not None:
                line = f"a ride ended {found['ended']}"
                console.print(line, style="yellow", markup=False, highlight=False, soft_wrap=True)
        for failure in entry["failures"]:
            line = f"{name}, {failure['variant']}, did not ride: {failure['reason']}"
            console.print(line, style="red", markup=False, highlight=False, soft_wrap=True)
    if document["reference_distance"]:
        console.print()
        far = ", ".join(f"{row['distance']:.1e} m at {row['time']:g} s" for row in document["reference_distance"])
        console.print(f"float64 itself is {far} from the reference", markup=False, highlight=False, soft_wrap=True)
