"""Terminal output of `velodrome diff`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.console import Console
from rich.text import Text

from ..compare import DIFFERS, TO_THE_BIT, WITHIN_ROUND_OFF, diff_remarks
from .tables import Column, print_table

_COLUMNS = (
    ("largest", "apart", "m"),
    ("allowed", "at end", "m"),
    ("beyond", "from", "s"),
    ("error", "before", "m"),
    ("error", "after", "m"),
    ("CPU", "ratio", "1"),
)
# Short texts, so that a row with an engine's name of 20 characters fits 80 columns.
_VERDICTS = {TO_THE_BIT: "to the bit", WITHIN_ROUND_OFF: "to round-off", DIFFERS: "differs"}


def show_diff(console: Console, document: Mapping[str, Any]) -> None:
    """Print one row per engine, then the differences line by line, then the verdict."""
    before, after = (run["name"] for run in document["runs"])
    console.print(f"{document['title']}: {before} against {after}", style="bold", markup=False, soft_wrap=True)
    entries = document["engines"].values()
    numbers = [_format_numbers(entry) for entry in entries]
    columns = [Column("engine", list(document["engines"]), right=False)]
    for k, (first, second, unit) in enumerate(_COLUMNS):
        columns.append(Column(f"{first}\n{second}", [row[k] for row in numbers], unit))
    columns.append(Column("the same", [_format_verdict(entry) for entry in entries], right=False))
    print_table(console, columns, gap=1)
    for line, style in _list_lines(document):
        console.print(line, style=style, markup=False, soft_wrap=True)
    if document["same"]:
        console.print("the engines in both runs are the same within round-off", style="bold green")
    else:
        console.print("the engines in both runs are not the same", style="bold red")


def _format_verdict(entry: Mapping[str, Any]) -> Text:
    return Text(_VERDICTS[entry["verdict"]], "red" if entry["verdict"] == DIFFERS else "green")


def _format_numbers(entry: Mapping[str, Any]) -> list[str]:
    found = entry["position_difference"]
    if found is None:
        return ["–"] * len(_COLUMNS)
    # The reference has no error, since errors are relative to it.
    error = entry["metrics"].get("position_error.max", {"before": None, "after": None})
    numbers = [found["max"], found["end_limit"], found["exceeds_at"], error["before"], error["after"]]
    numbers.append(entry["cpu_time"]["ratio"])
    return ["–" if number is None else f"{number:.2g}" for number in numbers]


def _list_lines(document: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return lines with their styles: differences outside the engines, then each engine's settings and reasons."""
    lines = []
    for part, changes in document["differs"].items():
        lines += [(f"{part}: {name} {before} -> {after}", "dim") for name, (before, after) in changes.items()]
    lines += [(note, "yellow") for note in document["notes"]]
    for name, entry in document["engines"].items():
        lines += [(f"{name}: {line}", "cyan") for line in diff_remarks(entry)]
        lines += [(f"{name}: {line}", "red") for line in entry["reasons"]]
    for when in ("before", "after"):
        names = document[f"only_{when}"]
        lines += [(f"only in the run {when}: {', '.join(names)}", "yellow")] if names else []
    return lines
