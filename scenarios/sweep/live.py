"""The live view of a sweep on stderr: progress, speed, remaining time, and the reasons of failures."""

from __future__ import annotations

import time
from collections import Counter, deque
from datetime import timedelta

from rich.console import Console, Group
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from .plan import Task
from .pool import Done
from .rows import BROKEN, COMPUTED, REFUSED

_REASONS = 4
_RECENT = 500  # rows over which the rate is computed
ROW_STYLES = dict.fromkeys(COMPUTED, "cyan") | {"done": "green", REFUSED: "yellow"} | dict.fromkeys(BROKEN, "red")


class SweepView:
    """Show rows as they arrive; a context. Shows nothing where stderr is no terminal.

    Parameters
    ----------
    total : int
        Number of tasks.
    console : Console, optional
        Standard error's by default.
    """

    def __init__(self, total: int, console: Console | None = None) -> None:
        self._console = Console(stderr=True) if console is None else console
        self._total, self._rows = total, 0
        self._counts: Counter[str] = Counter()
        self._reasons: deque[Text] = deque(maxlen=_REASONS)
        self._arrivals = deque([time.monotonic()], maxlen=_RECENT)
        self._live = Live(console=self._console, transient=True, get_renderable=self.picture, refresh_per_second=4)

    def __enter__(self) -> SweepView:
        if self._console.is_terminal:
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._console.is_terminal:
            self._live.stop()

    def watch(self, task: Task, done: Done, fresh: bool) -> None:
        """Count a row; a row of an earlier session does not count for the rate."""
        status = done.row["status"]
        self._rows += 1
        self._counts[status] += 1
        if fresh:
            self._arrivals.append(time.monotonic())
        if status in BROKEN:
            text = f"{task.key} {task.engine} {status}: {done.row['reason']}"
            self._reasons.append(Text(text, style="red", no_wrap=True, overflow="ellipsis"))

    def picture(self) -> Group:
        """Return what to show now."""
        line = Table.grid(padding=(0, 2))
        line.add_row(
            ProgressBar(self._total, self._rows, width=30), f"{self._rows} of {self._total}", *self._format_speed()
        )
        counts = Text("  ").join(
            Text(f"{status} {n}", ROW_STYLES[status]) for status, n in sorted(self._counts.items())
        )
        return Group(line, counts, *self._reasons)

    def _format_speed(self) -> tuple[str, str]:
        """Return the rate and the remaining time as texts."""
        recent = len(self._arrivals) - 1
        if recent == 0:
            return "", ""
        rate = recent / max(time.monotonic() - self._arrivals[0], 1e-3)
        return f"{rate:.3g} rows/s", f"{timedelta(seconds=round((self._total - self._rows) / rate))} left"
