"""Terminal output of `velodrome sweep`, and the count of its rows."""

from __future__ import annotations

import time
from collections import Counter, deque
from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.text import Text

from ...reports.drawing import format_numbers
from ..sweep import BROKEN, COMPUTED, PAGE, REFUSED, RESULTS, Done, Task
from .progress import ProgressBars
from .tables import Column, print_table
from .terminal import print_line, print_words

ROW_STYLES = dict.fromkeys(COMPUTED, "cyan") | {"done": "green", REFUSED: "yellow"} | dict.fromkeys(BROKEN, "red")
_DIGITS = 3
_REASONS = 4  # of failures that are shown below the bar
_RECENT = 500  # rows over which the rate is computed
_PICTURE = 0.1  # [s] between two pictures


class SweepCounter:
    """Counts a sweep's rows on a command's bars, with their statuses, the rate, and reasons of failures below.

    Parameters
    ----------
    progress : ProgressBars
    name : str
        The sweep's name.
    tasks : sequence of Task
    """

    def __init__(self, progress: ProgressBars, name: str, tasks: Sequence[Task]) -> None:
        self._progress, self._name, self._tasks, self._rows = progress, name, tasks, 0
        self._counts: Counter[str] = Counter()
        self._reasons: deque[Text] = deque(maxlen=_REASONS)
        self._arrivals = deque([time.monotonic()], maxlen=_RECENT)
        self._next_picture = 0.0
        progress.say("starting the workers")

    def recall(self, counts: Mapping[str, int]) -> None:
        """Count rows of earlier sessions, which do not count for the rate."""
        self._counts.update(counts)
        self._rows += sum(counts.values())

    def watch(self, done: Done) -> None:
        """Count a row."""
        status = done.row["status"]
        self._rows += 1
        self._counts[status] += 1
        if status in BROKEN:
            task = self._tasks[done.index]
            text = f"{task.key} {task.engine} {status}: {done.row['reason']}"
            self._reasons.append(Text(text, style="red", no_wrap=True, overflow="ellipsis"))
        # A picture takes a tenth of a millisecond, which rows that come by the thousand do not need.
        now = time.monotonic()
        self._arrivals.append(now)
        if now > self._next_picture or self._rows == len(self._tasks):
            self._next_picture = now + _PICTURE
            self._show()

    def _show(self) -> None:
        self._progress.watch(self._name, self._rows, len(self._tasks), "rows")
        counts = [Text(f"{name} {n}", ROW_STYLES[name]) for name, n in sorted(self._counts.items())]
        self._progress.show_below([Text("  ").join([*counts, *self._describe_rate()]), *self._reasons])

    def _describe_rate(self) -> list[Text]:
        recent = len(self._arrivals) - 1
        rate = recent / max(time.monotonic() - self._arrivals[0], 1e-3)
        return [Text(f"{rate:.3g} rows/s")] if recent else []


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
            print_words(console, f"{name} {reason}", ROW_STYLES[reason.partition(":")[0]])
    if document["stopped"] is None:
        print_line(console, f"data set: {document['folder']}/{RESULTS}")
        print_line(console, f"page:     {document['folder']}/{PAGE}")
        return
    missing = f"{document['missing']} of {document['tasks']} runs are missing, finished runs are kept"
    print_words(console, f"{document['stopped']}: {missing}", "yellow")
    print_line(console, f"continue with: {resume}")
