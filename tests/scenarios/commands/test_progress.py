"""What a command says while it works."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from numba.core import config
from rich.console import Console

from velodrome.reference.kernels.compilation import find_compilation, jit
from velodrome.scenarios.commands import progress
from velodrome.scenarios.commands.progress import ProgressBars

MakeScreen = Callable[[bool, int], StringIO]


@pytest.fixture
def make_screen(monkeypatch: pytest.MonkeyPatch) -> MakeScreen:
    """Let bars write to a text, as to a terminal of some width or as to a pipe."""
    monkeypatch.delenv(progress.SILENCE)

    def make(terminal: bool, width: int = 120) -> StringIO:
        text = StringIO()
        console = Console(file=text, width=width, force_terminal=terminal, color_system=None)
        monkeypatch.setattr(progress, "make_console", lambda stderr: console)
        return text

    return make


@pytest.mark.parametrize(
    ("done", "total", "unit", "said"),
    [
        (3.25, 20.0, "s", "3.2 of 20 s"),
        (0.25, 1.0, "1/m", "0.2 of 1 1/m"),
        (37.0, 100.0, "%", "37 of 100 %"),
        (120_000.0, 400_000, "motions", "120000 of 400000 motions"),
        (3.0, 12.0, "parts of the paper", "3 of 12 parts of the paper"),
        (7.0, None, "rides", "7 rides"),
    ],
)
@pytest.mark.parametrize("width", [60, 80, 120])
def test_a_bar_says_what_it_counts(
    make_screen: MakeScreen, width: int, done: float, total: float | None, unit: str, said: str
) -> None:
    text = make_screen(True, width)
    with ProgressBars() as bars:
        bars.watch("mujoco-exact-contact", done, total, unit)
    assert f"{said} " in text.getvalue()
    assert "mujoco-exact-contact " in text.getvalue()


def test_a_terminal_is_told_at_once_what_is_done(make_screen: MakeScreen) -> None:
    text = make_screen(True, 60)
    with ProgressBars() as bars:
        assert f"{progress.LOADING} (" in text.getvalue()
        bars.say(progress.COMPUTING)
    assert f"{progress.COMPUTING} (" in text.getvalue()


def write_lines_often(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "_FIRST_LINE", 0.01)
    monkeypatch.setattr(progress, "_LONGEST_PAUSE", 0.01)


def wait_for(text: StringIO, said: str) -> None:
    """Wait until something has been written."""
    give_up = time.monotonic() + 30
    while said not in text.getvalue():
        assert time.monotonic() < give_up, text.getvalue()
        time.sleep(0.01)


def test_a_pipe_has_plain_lines_now_and_then(make_screen: MakeScreen, monkeypatch: pytest.MonkeyPatch) -> None:
    write_lines_often(monkeypatch)
    text = make_screen(False, 60)
    with ProgressBars() as bars:
        wait_for(text, f"progress: {progress.LOADING} (")
        bars.watch("reference", 20.0, 20.0)
        bars.watch("mujoco-exact-contact", 3.2, 20.0)
        wait_for(text, "progress: mujoco-exact-contact 3.2 of 20 s (")
    assert "\x1b" not in text.getvalue()


def test_a_quick_command_writes_nothing_into_a_pipe(make_screen: MakeScreen) -> None:
    text = make_screen(False, 60)
    begin = time.monotonic()
    with ProgressBars() as bars:
        bars.watch("reference", 1.0, 20.0)
    assert text.getvalue() == ""
    assert time.monotonic() - begin < 5  # nor does it wait for the first line
    assert "progress" not in [thread.name for thread in threading.enumerate()]


@pytest.mark.parametrize("terminal", [True, False])
def test_progress_can_be_switched_off(make_screen: MakeScreen, monkeypatch: pytest.MonkeyPatch, terminal: bool) -> None:
    write_lines_often(monkeypatch)
    text = make_screen(terminal, 60)
    monkeypatch.setenv(progress.SILENCE, "off")
    with ProgressBars() as bars:
        bars.watch("reference", 1.0, 20.0)
        bars.note("a remark")
        time.sleep(0.05)
    assert text.getvalue() == "a remark\n"


@pytest.mark.parametrize("terminal", [True, False])
def test_compilation_is_told(
    make_screen: MakeScreen, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, terminal: bool
) -> None:
    def look(x: float) -> float:
        return x

    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path))
    kernel = jit(look)
    write_lines_often(monkeypatch)
    text = make_screen(terminal, 120)
    compile_whole = type(kernel._compiler).compile
    found = []

    def compile_slowly(*arguments: Any) -> Any:
        found.append(find_compilation())
        wait_for(text, "compiling kernels, once on this machine: ")
        return compile_whole(*arguments)

    monkeypatch.setattr(type(kernel._compiler), "compile", compile_slowly)
    with ProgressBars():
        kernel(1.5)
        assert find_compilation() is None
        kernel(2.5)
    ((compiled, most),) = found
    assert compiled < most
    assert f"compiling kernels, once on this machine: {compiled} of at most {most}" in text.getvalue()
