"""Progress of a command, shown on stderr."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from rich import progress as bars
from rich.console import Console


class ProgressBars:
    """A bar an engine, on stderr; quiet where stderr is no terminal."""

    def __init__(self) -> None:
        columns = (
            bars.TextColumn("{task.description:<16}"),
            bars.BarColumn(),
            bars.TextColumn("{task.completed:.1f} of {task.total:g} s"),
            bars.TimeRemainingColumn(),
        )
        self._console = Console(stderr=True)
        self._bars = bars.Progress(*columns, console=self._console, transient=True)
        self._tasks: dict[str, bars.TaskID] = {}

    def __enter__(self) -> ProgressBars:
        if self._console.is_terminal:
            self._bars.start()
        return self

    def __exit__(self, *_: object) -> None:
        # Bars that never started would still print an empty line.
        if self._console.is_terminal:
            self._bars.stop()

    def watch(self, engine: str, time: float, duration: float) -> None:
        """Show that an engine has reached a simulated time."""
        if engine not in self._tasks:
            self._tasks[engine] = self._bars.add_task(engine, total=duration)
        self._bars.update(self._tasks[engine], completed=time, total=duration)

    def note(self, line: str) -> None:
        """Say a line without disturbing the bars."""
        self._console.print(line, soft_wrap=True, highlight=False, markup=False)


@contextmanager
def show_working(line: str) -> Iterator[None]:
    """Show on a terminal's stderr that something is under way."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield
        return
    with console.status(line):
        yield
