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
            bars.TextColumn("{task.completed:.1f} of {task.total:g} s"),
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

    def watch(self, engine: str, time: float, duration: float) -> None:
        """Show the simulated time that an engine has reached."""
        if engine not in self._tasks:
            self._tasks[engine] = self._bars.add_task(engine, total=duration)
        self._bars.update(self._tasks[engine], completed=time, total=duration)

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
