"""Progress of a command on stderr."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Sequence
from types import TracebackType
from typing import TYPE_CHECKING

from .compilation import describe_compilation
from .terminal import make_console

if TYPE_CHECKING:
    from rich.text import Text

LOADING = "loading the libraries"
COMPUTING = "computing the motion"
RIDING = "preparing the rides"
SILENCE = "VELODROME_PROGRESS"  # environment variable: off for no progress

# Where stderr is no terminal, the first line comes after so many seconds: a command that is quick, or complains about
# its input, writes nothing but its result. Then the time doubles until a line comes a minute.
_FIRST_LINE, _LONGEST_PAUSE = 5.0, 60.0


class ProgressBars:
    """What a command is doing, on stderr; a context, to be entered before the command loads its libraries.

    A terminal shows at once what is being done, and then a bar for each part of the work. Elsewhere there is a plain
    line now and then, the first after five seconds. Both say when kernels are being compiled, and how many. Nothing is
    written if the environment variable `SILENCE` is ``off``.

    Parameters
    ----------
    doing : str
        What the command does until it counts something.
    """

    def __init__(self, doing: str = LOADING) -> None:
        self._console = make_console(stderr=True)
        wanted = os.environ.get(SILENCE) != "off"
        self._doing: str | None = doing
        self._latest: str | None = None  # what was counted last
        self._since = time.monotonic()
        self._animation = None
        if wanted and self._console.is_terminal and not self._console.is_dumb_terminal:
            from .animation import Animation  # imported here: it takes as long as a motion's computation

            self._animation = Animation(self._console, lambda: self._doing)
        self._ended = threading.Event()
        self._speaker = threading.Thread(target=self._write_lines, name="progress", daemon=True) if wanted else None

    def __enter__(self) -> ProgressBars:
        if self._animation is not None:
            self._animation.start()
        elif self._speaker is not None:
            self._speaker.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if self._animation is not None:
            self._animation.stop()
        elif self._speaker is not None:
            self._ended.set()
            self._speaker.join()

    def say(self, doing: str) -> None:
        """Say what is being done now, before anything can be counted."""
        self._doing = doing

    def watch(self, name: str, done: float, total: float | None, unit: str = "s", /) -> None:
        """Show how far an engine or another part of the work is, by default in simulated time.

        Parameters
        ----------
        name : str
        done : float
        total : float or None
            None if it is not known.
        unit : str
            What is counted.
        """
        # Parts of a second, or of another number with decimals; pieces are counted as a whole.
        shown = f"{done:.1f}" if unit in ("s", "1/m") else f"{done:.0f}"
        count = f"{shown}{'' if total is None else f' of {total:g}'} {unit}"
        if self._animation is not None:
            self._animation.move_bar(name, done, total, count)
        self._latest = f"{name} {count}"
        self._doing = None

    def note(self, line: str) -> None:
        """Print a line above the bars."""
        self._console.print(line, soft_wrap=True, markup=False)

    def show_below(self, lines: Sequence[Text]) -> None:
        """Show lines below the bars, on a terminal only, in place of those before."""
        if self._animation is not None:
            self._animation.below = lines

    def _write_lines(self) -> None:
        """Write plain lines until the command has ended."""
        pause = _FIRST_LINE
        while not self._ended.wait(pause):
            self.note(f"progress: {self._describe_now()} ({time.monotonic() - self._since:.0f} s)")
            pause = min(2 * pause, _LONGEST_PAUSE)

    def _describe_now(self) -> str:
        """Return what is being done in one line."""
        # Something that is said is done before or after what the bars count, so that only one of both goes on.
        now = self._latest if self._doing is None else self._doing
        return "; ".join(part for part in (describe_compilation(), now) if part is not None)
