"""Progress of a command on stderr."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from rich import progress as bars

from .terminal import make_console


class ProgressBars:
    """Progress bars on stderr, one per engine; nothing is shown if stderr is not a terminal."""

    def __init__(self) -> None:
        columns = (
            bars.TextColumn("{task.description:<16}"),
            bars.BarColumn(),
            bars.TextColumn("{task.fields[done]} of {task.total:g} {task.fields[unit]}"),
            bars.TimeRemainingColumn(),
        )
        self._console = make_console(stderr=True)
        self._bars = bars.Progress(*columns, console=self._console, transient=True)
        self._tasks: dict[str, bars.TaskID] = {}

    def __enter__(self) -> ProgressBars:
        if self._console.is_terminal:
            self._bars.start()
        return self

    def __exit__(self, *_: object) -> None:
        # Stopping bars that were not started prints an empty line.
        if self._console.is_terminal:
            self._bars.stop()

    def watch(self, name: str, done: float, total: float, unit: str = "s", /) -> None:
        """Show how far an engine or another part of the work is, by default in simulated time."""
        # Parts of a second, or of another number with decimals; pieces are counted as a whole.
        shown = f"{done:.1f}" if unit in ("s", "1/m") else f"{done:.0f}"
        if name not in self._tasks:
            self._tasks[name] = self._bars.add_task(name, total=total, done=shown, unit=unit)
        self._bars.update(self._tasks[name], completed=done, total=total, done=shown, unit=unit)

    def note(self, line: str) -> None:
        """Print a line above the bars."""
        self._console.print(line, soft_wrap=True, markup=False)


@contextmanager
def show_working(line: str) -> Iterator[None]:
    """Show a line on stderr while the body runs, if stderr is a terminal."""
    console = make_console(stderr=True)
    if not console.is_terminal:
        yield
        return
    with console.status(line):
        yield
