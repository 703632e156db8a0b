"""What the bars of progress say."""

from __future__ import annotations

from io import StringIO

import pytest
from rich.console import Console

from velodrome.scenarios.commands import progress


@pytest.mark.parametrize(
    ("done", "total", "unit", "said"),
    [
        (3.25, 20.0, "s", "3.2 of 20 s"),
        (0.25, 1.0, "1/m", "0.2 of 1 1/m"),
        (37.0, 100.0, "%", "37 of 100 %"),
        (120_000.0, 400_000, "motions", "120000 of 400000 motions"),
        (3.0, 12.0, "parts of the paper", "3 of 12 parts of the paper"),
    ],
)
def test_a_bar_says_what_it_counts(
    monkeypatch: pytest.MonkeyPatch, done: float, total: float, unit: str, said: str
) -> None:
    text = StringIO()
    console = Console(file=text, width=120, force_terminal=True, color_system=None)
    monkeypatch.setattr(progress, "make_console", lambda stderr: console)
    with progress.ProgressBars() as bars:
        bars.watch("a name of an engine", done, total, unit)
    assert f"{said} " in text.getvalue()
    assert "a name of an engine" in text.getvalue()
