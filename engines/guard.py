"""Calls into the code of an engine, which may come from anywhere: nothing that it raises ends the suite's process."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass, replace
from pathlib import Path
from traceback import walk_tb
from types import FrameType
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

if TYPE_CHECKING:
    from .engine import Engine, Problem, Progress, Settings, Trajectory

_P = ParamSpec("_P")
_T = TypeVar("_T")
_LONGEST = 200  # letters of what an engine says as it exits
# Packages that stand between a call and the engine's own code: none of their lines is where an engine is wrong.
_BETWEEN = (
    *("importlib", "importlib_metadata", "pydantic", "velodrome.scenarios", "velodrome.reports"),
    *("velodrome.engines.guard", "velodrome.engines.engine", "velodrome.engines.admission"),
)


class EngineError(RuntimeError):
    """An engine could not run a problem at all."""


def call_engine(function: Callable[_P, _T], *arguments: _P.args, **keywords: _P.kwargs) -> _T:
    """Call a function of an engine, or one that calls such.

    Python takes ``SystemExit``, ``KeyboardInterrupt``, ``GeneratorExit`` and whatever else is no `Exception` (a panic
    of a Rust extension, for one) for a wish to end the process. An engine has no say in that: they are failures of
    the engine. An interrupt from the user stays one, also where the engine swallows it or makes another error of it.

    What the function prints goes to stderr: stdout belongs to the command's own document. The current folder and the
    standard streams are as before afterwards, whatever the function does to them.

    Raises
    ------
    EngineError
        In place of what is no `Exception`: what the engine did, and where.
    KeyboardInterrupt
        If Ctrl-C was pressed meanwhile.
    Exception
        Whatever else the function raises.
    """
    with _interrupts() as pressed, _surroundings_kept():
        try:
            result = function(*arguments, **keywords)
        except BaseException as error:
            if pressed and not isinstance(error, KeyboardInterrupt):
                raise KeyboardInterrupt from error
            if pressed or isinstance(error, Exception):
                raise
            place = where_raised(error)
            raise EngineError(_deed(error) + (f" ({place})" if place else "")) from error
        if pressed:
            raise KeyboardInterrupt
        return result


@contextmanager
def _surroundings_kept() -> Iterator[None]:
    """Keep the current folder and the standard streams, and let prints go to stderr meanwhile."""
    output, errors = sys.stdout, sys.stderr
    try:
        folder = os.getcwd()
    except OSError:  # deleted meanwhile
        folder = None
    try:
        with redirect_stdout(errors):
            yield
    finally:
        sys.stdout, sys.stderr = output, errors
        if folder is not None:
            os.chdir(folder)


@contextmanager
def _interrupts() -> Iterator[list[int]]:
    """List the SIGINTs that raise KeyboardInterrupt meanwhile; they are handled as before."""
    pressed: list[int] = []
    previous = signal.getsignal(signal.SIGINT)
    # Signals reach the main thread only. A handler that is not Python's, or none, raises nothing.
    if threading.current_thread() is not threading.main_thread() or not callable(previous):
        yield pressed
        return

    def handle(number: int, frame: FrameType | None) -> None:
        try:
            previous(number, frame)
        except KeyboardInterrupt:
            pressed.append(number)
            raise

    signal.signal(signal.SIGINT, handle)
    try:
        yield pressed
    finally:
        signal.signal(signal.SIGINT, previous)


def _deed(error: BaseException) -> str:
    """Describe in a few words what an engine did that would have ended the process."""
    if isinstance(error, SystemExit):
        code = "" if error.code is None else repr(error.code)[:_LONGEST]
        return f"it called sys.exit({code})"
    return " ".join(f"it raised {type(error).__name__}: {error}"[:_LONGEST].split()).removesuffix(":")


def where_raised(error: BaseException) -> str | None:
    """Name file and line of the innermost frame in the engine's own code; None if no frame is the engine's.

    Libraries that the engine calls do not count, nor does the suite: the line named is the one to look at first.
    """
    found = [(frame, line) for frame, line in walk_tb(error.__traceback__)]
    last = max((i for i, (frame, _) in enumerate(found) if frame.f_code is call_engine.__code__), default=len(found))
    # The suite's code that an engine calls back is not its own either.
    inside = [(frame, line) for frame, line in found[last + 1 :] if not _is_between(frame)]
    if not inside:
        return None
    package = _package(inside[0][0])
    frame, line = [one for one in inside if _package(one[0]) == package][-1]
    path = Path(frame.f_code.co_filename)
    # As the package has it, wherever it is installed: rows of a sweep are the same on every machine.
    parts = _module(frame).count(".") + 1 + (path.name == "__init__.py")
    return f"{'/'.join(path.parts[-parts:])}:{line}"


def _module(frame: FrameType) -> str:
    return str(frame.f_globals.get("__name__", ""))


def _package(frame: FrameType) -> str:
    """Return the package that a frame's code belongs to; a floor of the suite counts as one of its own."""
    names = _module(frame).split(".")
    return ".".join(names[: 2 if names[0] == "velodrome" else 1])


def _is_between(frame: FrameType) -> bool:
    name = _module(frame)
    return any(name == package or name.startswith(f"{package}.") for package in _BETWEEN)


def simulate_guarded(engine: Engine, problem: Problem, settings: Any, progress: Progress) -> Trajectory:
    """Run a problem in an engine; what the ``progress`` callback raises is not the engine's failure.

    Raises
    ------
    BaseException
        Whatever ``progress`` raises, also where the engine swallows it; else as `call_engine`.
    """
    raised: list[BaseException] = []

    def report(time: float) -> None:
        reached = float(time)
        try:
            progress(reached)
        except BaseException as error:
            raised.append(error)
            raise

    try:
        trajectory = call_engine(engine.simulate, _copy_problem(problem), settings, report)
    except Exception:
        if not raised:
            raise
    else:
        if not raised:
            return trajectory
    # Outside the handler, so that the exception keeps its own cause and context.
    raise raised[0]


def _copy_problem(problem: Problem) -> Problem:
    """Copy a problem's arrays: an engine may write into its own, and all engines must start from the same state."""
    return replace(problem, q=problem.q.copy(), qd=problem.qd.copy(), times=problem.times.copy())


@dataclass(frozen=True)
class GuardedEngine:
    """An engine whose code is called through `call_engine` only; see `velodrome.engines.engine.Engine`.

    What it says of itself is asked once, when it is loaded.

    Attributes
    ----------
    inner : Engine
        As its package announces it.
    name, version : str
    gives : tuple of str
    settings : type of Settings
    """

    inner: Engine
    name: str
    version: str
    gives: tuple[str, ...]
    settings: type[Settings]

    def check(self, problem: Problem, settings: Any) -> None:
        """Refuse a problem that the engine cannot run."""
        call_engine(self.inner.check, _copy_problem(problem), settings)

    def step_noise(self, settings: Any) -> float:
        """Relative error that one step may add."""
        return call_engine(self.inner.step_noise, settings)

    def simulate(self, problem: Problem, settings: Any, progress: Progress) -> Trajectory:
        """Run a problem."""
        return simulate_guarded(self.inner, problem, settings, progress)
