"""Progress of a command on a terminal: a line that moves, and bars."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from rich import progress as bars
from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.spinner import Spinner
from rich.text import Text

from .compilation import describe_compilation

_WIDEST_BAR = 40


class Animation:
    """What a terminal shows while a command works.

    Parameters
    ----------
    console : rich.console.Console
    describe : callable
        Returns what is being done where nothing is counted; None where something is.

    Attributes
    ----------
    below : sequence of rich.text.Text
        Lines below the bars.
    """

    def __init__(self, console: Console, describe: Callable[[], str | None]) -> None:
        self.below: Sequence[Text] = ()
        self._console, self._describe = console, describe
        self._since = time.monotonic()
        self._spinner = Spinner("dots", Text())
        self._tasks: dict[str, bars.TaskID] = {}
        self._bars = bars.Progress(
            bars.TextColumn("{task.description}", markup=False),
            bars.BarColumn(bar_width=None),
            bars.TextColumn("{task.fields[count]}", markup=False),
            bars.TimeRemainingColumn(compact=True),
            console=console,
        )
        self._live = Live(console=console, transient=True, get_renderable=self._make_picture)

    def start(self) -> None:
        """Show it, until `stop`."""
        self._live.start(refresh=True)

    def stop(self) -> None:
        """Remove it from the terminal."""
        self._live.stop()

    def move_bar(self, name: str, done: float, total: float | None, count: str) -> None:
        """Show how far a part of the work is by a bar, which is added if it is not there, with a text."""
        if name not in self._tasks:
            self._tasks[name] = self._bars.add_task(name, total=total, count=count)
        self._bars.update(self._tasks[name], completed=done, total=total, count=count)

    def _make_picture(self) -> RenderableType:
        """Return what is shown now."""
        rows: list[RenderableType] = []
        doing = describe_compilation() or self._describe()
        if doing is not None:
            self._spinner.update(text=Text(f"{doing} ({time.monotonic() - self._since:.0f} s)"))
            rows.append(self._spinner)
        if self._tasks:
            table = self._bars.make_tasks_table(self._bars.tasks)
            # As wide as its texts, with a bar that takes what they leave.
            table.width = min(self._console.width, self._measure_texts() + _WIDEST_BAR)
            rows.append(table)
        return Group(*rows, *self.below)

    def _measure_texts(self) -> int:
        """Return the width of the bars' texts and of the gaps between the columns."""
        tasks = self._bars.tasks
        words = max(len(task.description) for task in tasks) + max(len(task.fields["count"]) for task in tasks)
        return words + len("00:00") + 3
