"""What `velodrome sweep` shows at the end."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.console import Console
from rich.text import Text

from ...reports.drawing import format_numbers
from ..sweep import PAGE, RESULTS, ROW_STYLES
from .tables import Column, print_table

_DIGITS = 3


def show_summary(console: Console, document: Mapping[str, Any], resume: str) -> None:
    """Print a table by engine, why rows broke, and where the data set is or how to continue."""
    entries: Mapping[str, Mapping[str, Any]] = document["engines"]
    columns = [Column("engine", list(entries), right=False)]
    for status, style in ROW_STYLES.items():
        if any(entry["rows"].get(status) for entry in entries.values()):
            columns.append(
                Column(status, [Text(str(entry["rows"].get(status, 0)), style) for entry in entries.values()])
            )
    errors = [entry.get("position_error") or {} for entry in entries.values()]
    columns += [
        Column("median\nerror", format_numbers([error.get("median") for error in errors], _DIGITS), "m"),
        Column("worst\nerror", format_numbers([error.get("worst") for error in errors], _DIGITS), "m"),
        Column(
            "rows of\na worker",
            format_numbers([entry.get("rows_per_second") for entry in entries.values()], _DIGITS),
            "1/s",
        ),
    ]
    print_table(console, columns)
    for name, entry in entries.items():
        for reason in entry.get("reasons", ()):
            _print_line(console, f"{name} {reason}", ROW_STYLES[reason.partition(":")[0]])
    if document["stopped"] is None:
        _print_line(console, f"data set: {document['folder']}/{RESULTS}")
        _print_line(console, f"page:     {document['folder']}/{PAGE}")
        return
    missing = f"{document['missing']} of {document['tasks']} runs are missing, finished runs are kept"
    _print_line(console, f"{document['stopped']}: {missing}", "yellow")
    _print_line(console, f"continue with: {resume}")


def _print_line(console: Console, line: str, style: str | None = None) -> None:
    console.print(line, style=style, markup=False, soft_wrap=True)
