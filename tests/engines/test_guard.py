"""Calls into an engine's code: what it raises is told from what the user and the suite raise."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from velodrome.engines import guard
from velodrome.engines.engine import EngineError, Problem, why_failed
from velodrome.engines.guard import GuardedEngine, call_engine, where_raised
from velodrome.engines.registry import load_engine
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.surface import Plane

PROBLEM = Problem(Bicycle(), Plane(), np.zeros(9), np.zeros(9), np.array([0.0, 1.0]))


def raising(error: BaseException) -> Callable[[], None]:
    def function() -> None:
        raise error

    return function


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (SystemExit(), "it called sys.exit()"),
        (SystemExit(0), "it called sys.exit(0)"),
        (SystemExit("two\nlines"), r"it called sys.exit('two\nlines')"),
        (KeyboardInterrupt(), "it raised KeyboardInterrupt"),
        (GeneratorExit("over"), "it raised GeneratorExit: over"),
    ],
)
def test_what_would_end_the_process_is_an_error_of_the_engine(error: BaseException, words: str) -> None:
    with pytest.raises(EngineError) as caught:
        call_engine(raising(error))
    assert str(caught.value).startswith(f"{words} (test_guard.py:")
    assert caught.value.__cause__ is error


@pytest.mark.parametrize("error", [ValueError("no"), StopIteration(3), MemoryError(), EngineError("own words")])
def test_other_errors_are_passed_on_as_they_are(error: Exception) -> None:
    with pytest.raises(type(error)) as caught:
        call_engine(raising(error))
    assert caught.value is error


def test_an_interrupt_of_the_user_stays_one_whatever_becomes_of_it() -> None:
    def swallow() -> None:
        with suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)

    def alter() -> None:
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            raise ValueError("callback failed") from None

    before = signal.getsignal(signal.SIGINT)
    for function in (lambda: signal.raise_signal(signal.SIGINT), swallow, alter):
        with pytest.raises(KeyboardInterrupt):
            call_engine(function)
        with pytest.raises(KeyboardInterrupt):
            call_engine(call_engine, function)
        assert signal.getsignal(signal.SIGINT) is before


def test_a_handler_that_an_engine_leaves_behind_is_taken_away() -> None:
    before = signal.getsignal(signal.SIGINT)
    call_engine(signal.signal, signal.SIGINT, signal.SIG_IGN)
    assert signal.getsignal(signal.SIGINT) is before


def test_it_works_in_a_thread_too() -> None:
    said: list[str] = []

    def work() -> None:
        try:
            call_engine(raising(KeyboardInterrupt()))
        except EngineError as error:
            said.append(str(error))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert said[0].startswith("it raised KeyboardInterrupt")


class Reporting:
    """An engine that reports something, and swallows or passes on what comes of it."""

    def __init__(self, time: Any, swallows: bool = False) -> None:
        self.time, self.swallows = time, swallows

    def simulate(self, problem: Any, settings: Any, progress: Callable[[float], None]) -> str:
        try:
            progress(self.time)
        except BaseException:
            if not self.swallows:
                raise
        return "trajectory"


@pytest.mark.parametrize("swallows", [False, True])
@pytest.mark.parametrize("error", [OSError("the terminal has gone"), SystemExit(1)])
def test_what_the_callback_raises_is_no_failure_of_the_engine(error: BaseException, swallows: bool) -> None:
    engine: Any = Reporting(0.5, swallows)
    with pytest.raises(type(error)) as caught:
        guard.simulate_guarded(engine, PROBLEM, None, lambda _: raising(error)())
    assert caught.value is error


def test_a_time_that_is_none_is_a_failure_of_the_engine() -> None:
    engine: Any = Reporting("soon")
    with pytest.raises(ValueError, match="could not convert string to float") as caught:
        guard.simulate_guarded(engine, PROBLEM, None, lambda _: None)
    place = where_raised(caught.value)
    assert place is not None
    assert place.startswith("test_guard.py:")


def test_the_line_that_is_named_is_the_engines_own() -> None:
    def function() -> None:
        int("x".join(["one"]))

    def through_a_library() -> None:
        import json

        json.loads("{")

    for bad in (function, through_a_library):
        with pytest.raises(ValueError, match=r".") as caught:
            call_engine(bad)
        line = bad.__code__.co_firstlineno + (1 if bad is function else 3)
        assert where_raised(caught.value) == f"test_guard.py:{line}"
        assert why_failed(caught.value).endswith(f"(test_guard.py:{line})")
    assert where_raised(ValueError("raised nowhere")) is None
    assert why_failed(ValueError("raised nowhere")) == "ValueError: raised nowhere"
    assert why_failed(EngineError("own\nwords")) == "own words"


def test_engines_are_loaded_behind_the_guard() -> None:
    assert isinstance(load_engine("reference"), GuardedEngine)


def test_an_engine_changes_neither_the_folder_nor_the_streams(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, output = Path.cwd(), sys.stdout

    def wander() -> None:
        print("solver done")
        os.chdir(tmp_path)
        sys.stdout = sys.stderr

    call_engine(wander)
    assert Path.cwd() == folder
    assert sys.stdout is output
    said = capsys.readouterr()
    assert (said.out, said.err) == ("", "solver done\n")
