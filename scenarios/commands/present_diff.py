"""Terminal output of `velodrome diff`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf
from typing import Any

from rich.console import Console
from rich.text import Text

from ...engines.engine import REFERENCE
from ...reports.drawing import format_numbers
from ..compare import DIFFERS, TO_THE_BIT, WITHIN_ROUND_OFF, diff_remarks
from .tables import Column, print_table
from .terminal import print_words

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
    """Print one row per engine, then the verdict, then the differences line by line."""
    before, after = (run["name"] for run in document["runs"])
    print_words(console, f"{document['title']}: {before} against {after}", "bold")
    names = sorted(document["engines"], key=lambda name: _rank_engine(name, document["engines"][name]))
    entries = [document["engines"][name] for name in names]
    numbers = [_pick_numbers(entry) for entry in entries]
    whole = [_find_fall(entry) is None for entry in entries]
    columns = [Column("engine", names, right=False)]
    for k, (first, second, unit) in enumerate(_COLUMNS):
        cells = format_numbers([row[k] for row in numbers], deciding=whole)
        columns.append(Column(f"{first}\n{second}", cells, unit))
    columns.append(Column("the same", [_format_verdict(entry) for entry in entries], right=False))
    print_table(console, columns, gap=1)
    if document["same"]:
        console.print("the rides of the engines in both runs are the same within round-off", style="bold green")
    else:
        console.print("the rides of the engines in both runs are not the same", style="bold red")
    for line, style in _list_lines(document, names):
        print_words(console, line, style)


def _format_verdict(entry: Mapping[str, Any]) -> Text:
    return Text(_VERDICTS[entry["verdict"]], "red" if entry["verdict"] == DIFFERS else "green")


def _pick_numbers(entry: Mapping[str, Any]) -> list[float | None]:
    """Return the numbers of `_COLUMNS`."""
    found = entry["position_difference"]
    if found is None:
        return [None] * len(_COLUMNS)
    # The reference has no error, since errors are relative to it.
    error = entry["metrics"].get("position_error.max", {"before": None, "after": None})
    numbers = [found["max"], found["end_limit"], found["exceeds_at"], error["before"], error["after"]]
    return [*numbers, entry["cpu_time"]["ratio"]]


def _rank_engine(name: str, entry: Mapping[str, Any]) -> tuple[int, float, str]:
    """Return a key that orders engines as the table of a run does: the fallen last, the others by error."""
    if name == REFERENCE:
        return 0, 0.0, name
    fell = _find_fall(entry)
    if fell is not None:
        return 2, -fell, name
    error = entry["metrics"].get("position_error.max", {"after": None})["after"]
    return 1, inf if error is None else error, name


def _find_fall(entry: Mapping[str, Any]) -> float | None:
    """Return when an engine fell in the later run, or if only there, in the earlier one [s]; None if it did not."""
    fell = entry["metrics"].get("fell_at", {"before": None, "after": None})
    return fell["before"] if fell["after"] is None else fell["after"]


def _list_lines(document: Mapping[str, Any], names: Sequence[str]) -> list[tuple[str, str]]:
    """Return lines with their styles: differences outside the engines, then below each name settings and reasons."""
    lines = []
    for part, changes in document["differs"].items():
        lines += [(f"{part}: {name} {before} -> {after}", "dim") for name, (before, after) in changes.items()]
    lines += [(note, "yellow") for note in document["notes"]]
    for name in names:
        entry = document["engines"][name]
        below = [(line, "cyan") for line in diff_remarks(entry)] + [(line, "red") for line in entry["reasons"]]
        lines += [(name, "bold"), *((f"  {line}", style) for line, style in below)] if below else []
    for when in ("before", "after"):
        names = document[f"only_{when}"]
        lines += [(f"only in the run {when}: {', '.join(names)}", "yellow")] if names else []
    return lines
