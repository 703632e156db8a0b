"""The words of a history on the terminal."""

from __future__ import annotations

from typing import Any

import pytest
from rich.console import Console
from test_steps import FAILED, WORSE_RIDE, drift, judge_rows, row

from velodrome.scenarios.commands.present_history import show_history

NOTHING_MOVED = "no release moved a quantity beyond its limit"


def show(capsys: pytest.CaptureFixture[str], *rows: dict[str, Any]) -> str:
    """The table of releases of one engine, of which the first is 1.0."""
    show_history(Console(width=200), judge_rows(*rows))
    return capsys.readouterr().out


@pytest.mark.parametrize(
    ("rows", "told"),
    [
        ([row(), FAILED, WORSE_RIDE], "rides again; against 1.0 worse: position_error"),
        ([row(), FAILED, row()], "rides again; against 1.0 same to the bit"),
        ([row(), FAILED], "does not ride any more"),
        ([FAILED, row()], "rides, and none before did"),
        ([row()], "nothing to compare"),
        ([FAILED, FAILED], "nothing to compare"),
        ([row(), {"status": "not-installable", "reason": "no wheel"}], "nothing to compare"),
        (drift(1e-3, 1e-3 + 0.8e-6, 1e-3 + 1.6e-6), "between 1.0 and 1.2: circle: one: worse"),
    ],
)
def test_what_is_told(rows: list[dict[str, Any]], told: str, capsys: pytest.CaptureFixture[str]) -> None:
    text = show(capsys, *rows)
    assert told in text
    assert NOTHING_MOVED not in text


def test_that_nothing_moved_is_told_of_releases_that_rode(capsys: pytest.CaptureFixture[str]) -> None:
    assert NOTHING_MOVED in show(capsys, row(), row("b"))
