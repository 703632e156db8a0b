"""Calls of an engine's code that protect the suite's process from exits, prints and changes of the folder."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from copy import copy
from dataclasses import dataclass
from pathlib import Path
from traceback import walk_tb
from types import FrameType
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar, cast

if TYPE_CHECKING:
    from .engine import Engine, Problem, Progress, Settings, Trajectory

_P = ParamSpec("_P")
_T = TypeVar("_T")
_LONGEST = 200  # characters that are quoted of an engine's exit message
# Packages between a call and the engine's own code, whose lines are not reported as the place of an engine's error.
_BETWEEN = (
    *("importlib", "importlib_metadata", "pydantic", "velodrome.scenarios", "velodrome.reports"),
    *("velodrome.engines.guard", "velodrome.engines.engine", "velodrome.engines.admission"),
)


class EngineError(RuntimeError):
    """Raised if an engine cannot run a problem at all."""


def call_engine(function: Callable[_P, _T], *arguments: _P.args, **keywords: _P.kwargs) -> _T:
    """Call a function of an engine, or a function that calls one.

    ``SystemExit``, ``KeyboardInterrupt``, ``GeneratorExit`` and other exceptions that are not an `Exception`, such as a
    panic of a Rust extension, would end the process. If an engine raises them, they are treated as its failures. An
    interrupt by the user is raised as such, even if the engine catches it or raises another exception instead.

    Prints of the function go to stderr, since stdout is reserved for the command's document. The current folder and the
    standard streams are restored afterwards.

    Raises
    ------
    EngineError
        If the function raises something that is not an `Exception`. The message says what the engine did, and where.
    KeyboardInterrupt
        If Ctrl-C was pressed during the call.
    Exception
        Any other exception of the function.
    """
    with _record_interrupts() as pressed, _protect_process():
        try:
            result = function(*arguments, **keywords)
        except BaseException as error:
            if pressed and not isinstance(error, KeyboardInterrupt):
                raise KeyboardInterrupt from error
            if pressed or isinstance(error, Exception):
                raise
            place = where_raised(error)
            raise EngineError(_describe_exit(error) + (f" ({place})" if place else "")) from error
        if pressed:
            raise KeyboardInterrupt
        return result


@contextmanager
def _protect_process() -> Iterator[None]:
    """Redirect prints to stderr, and restore the current folder and the standard streams afterwards."""
    output, errors = sys.stdout, sys.stderr
    try:
        folder = os.getcwd()
    except OSError:  # the folder was deleted
        folder = None
    try:
        with redirect_stdout(errors):
            yield
    finally:
        sys.stdout, sys.stderr = output, errors
        if folder is not None:
            os.chdir(folder)


@contextmanager
def _record_interrupts() -> Iterator[list[int]]:
    """Yield a list of the SIGINTs that raise KeyboardInterrupt in the body; the previous handler is still called."""
    pressed: list[int] = []
    previous = signal.getsignal(signal.SIGINT)
    # Only the main thread handles signals. Without a Python handler, no KeyboardInterrupt is raised.
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


def _describe_exit(error: BaseException) -> str:
    """Describe how an engine tried to end the process."""
    if isinstance(error, SystemExit):
        code = "" if error.code is None else repr(error.code)[:_LONGEST]
        return f"it called sys.exit({code})"
    return " ".join(f"it raised {type(error).__name__}: {error}"[:_LONGEST].split()).removesuffix(":")


def where_raised(error: BaseException) -> str | None:
    """Return the file and line of the innermost frame in the engine's own code, or None if there is no such frame.

    Frames of libraries that the engine calls, and of the suite, are ignored.
    """
    found = [(frame, line) for frame, line in walk_tb(error.__traceback__)]
    last = max((i for i, (frame, _) in enumerate(found) if frame.f_code is call_engine.__code__), default=len(found))
    # Code of the suite that the engine calls is ignored too.
    inside = [(frame, line) for frame, line in found[last + 1 :] if not _is_between(frame)]
    if not inside:
        return None
    package = _find_package(inside[0][0])
    frame, line = [entry for entry in inside if _find_package(entry[0]) == package][-1]
    path = Path(frame.f_code.co_filename)
    # The path is relative to the package, so that rows of a sweep are the same on every machine.
    parts = _module_name(frame).count(".") + 1 + (path.name == "__init__.py")
    return f"{'/'.join(path.parts[-parts:])}:{line}"


def _module_name(frame: FrameType) -> str:
    return str(frame.f_globals.get("__name__", ""))


def _find_package(frame: FrameType) -> str:
    """Return the package of a frame's code; each top-level subpackage of the suite counts as a package."""
    names = _module_name(frame).split(".")
    return ".".join(names[: 2 if names[0] == "velodrome" else 1])


def _is_between(frame: FrameType) -> bool:
    name = _module_name(frame)
    return any(name == package or name.startswith(f"{package}.") for package in _BETWEEN)


def simulate_guarded(engine: Engine, problem: Problem, settings: Any, progress: Progress) -> Trajectory:
    """Run a problem in an engine; exceptions of the ``progress`` callback are not treated as failures of the engine.

    Raises
    ------
    BaseException
        Any exception that ``progress`` raises, even if the engine catches it; otherwise as `call_engine`.
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


def find_simulate_many(engine: Engine) -> Callable[[Sequence[Problem], Any, int], list[Any]] | None:
    """Return a function that rides many problems in an engine by its ``simulate_many``; None if it has none.

    The function raises as `call_engine` does, and `EngineError` if there is not one ride for each problem.
    """
    own = engine.inner if isinstance(engine, GuardedEngine) else engine
    inner: Any = getattr(own, "simulate_many", None)
    if inner is None:
        return None

    def simulate_many(problems: Sequence[Problem], settings: Any, threads: int) -> list[Any]:
        rides = call_engine(inner, [_copy_problem(problem) for problem in problems], settings, threads)
        if not isinstance(rides, list) or len(cast("list[Any]", rides)) != len(problems):
            raise EngineError(f"its simulate_many gave no list of {len(problems)} rides")
        return cast("list[Any]", rides)

    return simulate_many


def _copy_problem(problem: Problem) -> Problem:
    """Copy a problem's arrays, since an engine may change them and all engines must start from the same state."""
    copied = copy(problem)  # without checking it again, which takes longer than copying it
    for name in ("q", "qd", "times"):
        object.__setattr__(copied, name, getattr(problem, name).copy())
    return copied


@dataclass(frozen=True)
class GuardedEngine:
    """An engine whose code is called only through `call_engine`; see `velodrome.engines.engine.Engine`.

    Its name, version, fields and settings are read once, when it is loaded.

    Attributes
    ----------
    inner : Engine
        The engine that the package announces.
    name, version : str
    gives : tuple of str
    settings : type of Settings
    takes_inputs : bool
        Whether the engine says that it applies a problem's inputs.
    """

    inner: Engine
    name: str
    version: str
    gives: tuple[str, ...]
    settings: type[Settings]
    takes_inputs: bool = False

    def check(self, problem: Problem, settings: Any) -> None:
        """Refuse a problem that the engine cannot run, and inputs that it does not apply."""
        self._refuse_ignored_inputs(problem)
        call_engine(self.inner.check, _copy_problem(problem), settings)

    def step_noise(self, settings: Any) -> float:
        """Return the relative error that one step may add."""
        return call_engine(self.inner.step_noise, settings)

    def simulate(self, problem: Problem, settings: Any, progress: Progress) -> Trajectory:
        """Run a problem; inputs that the engine does not apply are refused."""
        self._refuse_ignored_inputs(problem)
        return simulate_guarded(self.inner, problem, settings, progress)

    def _refuse_ignored_inputs(self, problem: Problem) -> None:
        from .engine import UnsuitableProblem, find_ignored_inputs  # that module imports this one

        ignored = find_ignored_inputs(self, problem)
        if ignored is not None:
            raise UnsuitableProblem(ignored)
