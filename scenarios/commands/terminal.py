"""The terminal that commands print to."""

from __future__ import annotations

from rich.console import Console


def make_console(stderr: bool = False) -> Console:
    """Return the console of stdout, or of stderr, which colours nothing by itself: a digit in a name is no number."""
    return Console(stderr=stderr, highlight=False)
