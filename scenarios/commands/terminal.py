"""The terminal that commands print to."""

from __future__ import annotations

import os
import re
import sys
from textwrap import wrap

from rich.console import Console
from rich.text import Text

# The space between a number and its unit, and what stands for it while lines are broken.
_BEFORE_UNIT, _NO_BREAK = re.compile(r"(?<=\d) (?=(?:m|s|N|J|%|rad|1/s|m/s|rad/s)(?:[\s,;:.)]|$))"), "\u00a0"


def make_console(stderr: bool = False) -> Console:
    """Return the console of stdout, or of stderr, which colours nothing by itself: a digit in a name is no number."""
    return _ErrorConsole(stderr=True, highlight=False) if stderr else Console(highlight=False)


class _ErrorConsole(Console):
    """The console of stderr: if its reader has gone, the command goes on."""

    def on_broken_pipe(self) -> None:
        # By default rich would close stdout, where the result goes, and exit.
        leave_stderr()


def leave_stderr() -> None:
    """Let stderr lead nowhere, since its reader has gone; the result on stdout still has one."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, sys.stderr.fileno())
    os.close(nowhere)


def print_words(console: Console, words: str, style: str = "") -> None:
    """Print a sentence: on a terminal in lines between words, elsewhere in one line, for programs that search it.

    No name is broken, not even at a hyphen. For paths and commands that are to be copied there is `print_line`.
    """
    lines = [words]
    if console.is_terminal:
        # Further lines are indented two letters more than the first.
        indent = " " * (len(words) - len(words.lstrip()) + 2)
        whole = _BEFORE_UNIT.sub(_NO_BREAK, words)
        lines = wrap(whole, console.width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
    for line in lines:
        print_line(console, line.replace(_NO_BREAK, " "), style)


def print_line(console: Console, line: str, style: str = "") -> None:
    """Print one line whatever its length, such as a path or a command that is to be copied."""
    console.print(Text(line, style), soft_wrap=True)
