"""Ordinary runs of scenarios with one release of an engine's package, in the release's own environment."""

from __future__ import annotations

import json
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..error import ScenarioError
from ..run import RunOutcome, RunWatch
from ..scenario import EngineChoice, Scenario, choose_engines
from .children import Children
from .companions import describe_registry_companions
from .environments import ReleaseEnvironment
from .one_release import open_named_environment, parse_one_release, require_one_release
from .plan import choose_package_engines, find_versions
from .process import LaidOverProcess
from .protocol import describe_exit
from .releases import Release, order_releases, read_wheel_releases
from .run_process import RunSetup

_OPTION = "--release"
_PROGRAM = "velodrome.scenarios.history.run_process"


class RunEnded(RuntimeError):
    """Raised where the process of a run ends before it is done; the message is one line."""


@dataclass(frozen=True)
class ReleaseRunPlan:
    """The release of a run, and the engines that run with it.

    Attributes
    ----------
    release : Release
    engines : EngineChoice
        Of the release's package.
    remarks : tuple of str
        Lines for the user, such as that the registry could not be asked.
    """

    release: Release
    engines: EngineChoice
    remarks: tuple[str, ...]


@dataclass(frozen=True)
class OpenedRelease:
    """A release in its environment, which stays as it is meanwhile.

    Attributes
    ----------
    plan : ReleaseRunPlan
    environment : ReleaseEnvironment
    children : Children
    """

    plan: ReleaseRunPlan
    environment: ReleaseEnvironment
    children: Children


def plan_release_run(
    wanted: str, engines: Sequence[str], wheels: Sequence[Path], *, cache: Path, children: Children
) -> ReleaseRunPlan:
    """Find the release with which scenarios are to run, and its engines.

    Parameters
    ----------
    wanted : str
        ``PACKAGE==VERSION``, or the package alone where a wheel is given.
    engines : sequence of str
        Engines of the package by name or pattern; all installed ones without any.
    wheels : sequence of Path
        The release, if it is a build: its wheel and those of its companions.
    cache : Path
        Folder of environments.
    children : Children

    Raises
    ------
    ScenarioError
        If anything of it is wrong, in one line, or it is more or less than one release.
    """
    asked = parse_one_release(wanted, wheels, _OPTION)
    names = choose_package_engines(asked.package, engines)
    own = read_wheel_releases(wheels, asked.package)
    versions, remarks = find_versions(asked, cache, children)
    release = require_one_release(order_releases(asked.package, versions, own), wanted, _OPTION)
    named = choose_engines(engines)[0].named if engines else frozenset[str]()
    return ReleaseRunPlan(release, EngineChoice(tuple(names), named), tuple(remarks))


@contextmanager
def open_release(
    plan: ReleaseRunPlan, note: Callable[[str], None], *, cache: Path, children: Children
) -> Iterator[OpenedRelease]:
    """Yield a release in its environment, made if it is not in the cache.

    Parameters
    ----------
    plan : ReleaseRunPlan
    note : callable
        Called with lines for the user.
    cache : Path
        Folder of environments.
    children : Children

    Raises
    ------
    ScenarioError
        If it cannot be installed.
    """
    with open_named_environment(plan.release, _OPTION, cache, children) as environment:
        for line in (*plan.remarks, describe_registry_companions(plan.release, environment.packages)):
            if line is not None:
                note(line)
        yield OpenedRelease(plan, environment, children)


def run_in_release(
    opened: OpenedRelease,
    name: str,
    scenario: Scenario,
    out: Path,
    watch: RunWatch,
    note: Callable[[str], None],
    trace: Callable[[str], None] | None = None,
    *,
    recording: bool = True,
    record_rate: float | None = None,
) -> RunOutcome:
    """Run a scenario in the engines of a release, and write an ordinary run folder.

    As `velodrome.scenarios.run.run_plan` does it, in a process over whose environment the release is laid. Engines that
    were not named and do not ride with the release are left out.

    Parameters
    ----------
    opened : OpenedRelease
    name : str
    scenario : Scenario
    out : Path
        Folder in which the run folder is made.
    watch, note : callable
        As for `velodrome.scenarios.run.run_plan`.
    trace : callable, optional
        Called with the traceback of an engine that failed.
    recording, record_rate
        As for `velodrome.scenarios.run.run_plan`.

    Raises
    ------
    ScenarioError
        If an engine that was named refuses the release, a setting or the scenario, or all do.
    RunEnded
        If the process ends before it is done.
    KeyboardInterrupt
        If Ctrl-C is pressed before an engine runs; later it ends the engine that runs, as ever.
    """
    release, environment = opened.plan.release, opened.environment
    setup = RunSetup(
        parent=os.getpid(),
        folder=str(environment.folder),
        version=release.version,
        release={
            "package": release.package,
            "release": release.label,
            "packages": environment.packages,
            "installed": environment.installed,
        },
        name=name,
        scenario=scenario.model_dump(mode="json", exclude_none=True),
        engines=[*opened.plan.engines.names],
        named=sorted(opened.plan.engines.named),
        out=str(out.absolute()),
        recording=recording,
        record_rate=record_rate,
    )
    process = LaidOverProcess(_PROGRAM, environment.folder, opened.children)
    try:
        with _passing_interrupts_on(process):
            process.send(setup.line())
            outcome = _follow(process, f"{release.package} {release.label}", watch, note, trace)
    finally:
        process.end()
    folder = out / Path(outcome.pop("folder")).name
    return RunOutcome(folder, **outcome)


def _follow(
    process: LaidOverProcess,
    release: str,
    watch: RunWatch,
    note: Callable[[str], None],
    trace: Callable[[str], None] | None,
) -> dict[str, Any]:
    """Pass messages on until the outcome is there, and return it."""
    while True:
        try:
            message = json.loads(process.read_line() or b"")
        except ValueError:
            how = describe_exit(process.end())
            raise RunEnded(f"{release}: the process of the run ended by {how} before it was done") from None
        if message.get("trace") is not None and trace is not None:
            trace(message["trace"])
        if "outcome" in message:
            return message["outcome"]
        if "refused" in message:
            raise ScenarioError(f"{_OPTION} {release}: {message['refused']}")
        if "interrupted" in message:
            raise KeyboardInterrupt
        if "progress" in message:
            watch(*message["progress"])
        if "note" in message:
            note(message["note"])


@contextmanager
def _passing_interrupts_on(process: LaidOverProcess) -> Iterator[None]:
    """Let Ctrl-C interrupt the process, which belongs to no terminal, and not this one."""
    if threading.current_thread() is not threading.main_thread():
        yield  # signals reach the main thread only
        return
    previous = signal.signal(signal.SIGINT, lambda *_: process.interrupt(signal.SIGINT))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, previous)
