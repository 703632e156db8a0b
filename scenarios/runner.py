"""Scenario to run folder: every engine from the same start, compared, recorded."""

from __future__ import annotations

import platform
import signal
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import ValidationError

from engines.engine import (
    REFERENCE,
    Engine,
    EngineError,
    Settings,
    Trajectory,
    UnsuitableProblem,
    engine_names,
    load_engine,
)
from engines.storage import write_trajectory
from reports.fall import until_fall
from reports.metrics import metrics
from reports.summary import summary

from .error import ScenarioError
from .files import write_json, write_text
from .scenario import Scenario
from .start import Start, make_start
from .table import one_line, refuse_unknown

LIBRARIES = ("velodrome", "numpy", "scipy", "numba", "exudyn", "mujoco", "rerun-sdk", "pyarrow")

# (engine, simulated time reached, duration)
Watch = Callable[[str, float, float], None]


@dataclass(frozen=True)
class Plan:
    """A run that has been checked: everything bad input could break is behind it.

    Attributes
    ----------
    name : str
    scenario : Scenario
    start : Start
    engines : dict
        Name to (engine, its settings), the reference first.
    left_out : dict
        Engines that were not asked for by name and are not made for this problem, with the reason.
    """

    name: str
    scenario: Scenario
    start: Start
    engines: dict[str, tuple[Engine, Settings]]
    left_out: dict[str, str]


@dataclass(frozen=True)
class Outcome:
    """What a run came to.

    Attributes
    ----------
    folder : Path
    metrics : dict
        Per engine, as in ``metrics.json``.
    failures : dict
        Engines that gave no trajectory, with the reason.
    verdicts : list of dict
        Per engine and criterion: ``engine, quantity, value, limit, holds``.
    interrupted : bool
    """

    folder: Path
    metrics: dict[str, dict[str, Any]]
    failures: dict[str, str]
    verdicts: list[dict[str, Any]]
    interrupted: bool


def plan_run(name: str, scenario: Scenario, wanted: list[str] | None = None) -> Plan:
    """Check engines and settings and compute the start.

    Parameters
    ----------
    name : str
    scenario : Scenario
    wanted : list of str, optional
        Engines to run beside the reference; all that are installed and made for the problem if not given.

    Raises
    ------
    ScenarioError
        If an engine is not installed, a setting is wrong, or the motion does not exist.
    """
    installed = engine_names()
    for engine in [*(wanted or []), *scenario.engines]:
        if engine not in installed:
            raise ScenarioError(f"engine {engine!r} is not installed; there are {', '.join(installed)}")
    names = [engine for engine in installed if engine == REFERENCE or not wanted or engine in wanted]
    chosen = {engine: configure(engine, scenario.engines.get(engine, {})) for engine in names}
    start = make_start(scenario)
    left_out: dict[str, str] = {}
    for engine, (library, settings) in chosen.items():
        try:
            library.check(start.problem, settings)
        except ValueError as error:
            if wanted or not isinstance(error, UnsuitableProblem):
                raise ScenarioError(f"engines.{engine}: {error}") from error
            left_out[engine] = str(error)
    chosen = {engine: pair for engine, pair in chosen.items() if engine not in left_out}
    return Plan(name, scenario, start, chosen, left_out)


def configure(name: str, values: Mapping[str, Any]) -> tuple[Engine, Settings]:
    """Load an engine and validate its settings.

    Raises
    ------
    ScenarioError
        If a setting is unknown or out of range.
    """
    engine = load_engine(name)
    try:
        refuse_unknown(values, engine.settings.model_fields)
        return engine, engine.settings.model_validate(dict(values), strict=True)
    except ValidationError as error:
        raise ScenarioError(f"engines.{name}.{one_line(error)}") from error
    except ValueError as error:
        raise ScenarioError(f"engines.{name}: {error}") from error


def run(plan: Plan, out: Path, watch: Watch, note: Callable[[str], None]) -> Outcome:
    """Run every engine of a plan and write the run folder.

    Each engine's trajectory is written when it is done; Ctrl-C ends the engine at work and leaves the
    finished ones compared and recorded.

    Parameters
    ----------
    plan : Plan
    out : Path
        Folder that the run folder is made in.
    watch : callable
        Called with engine, time reached and duration.
    note : callable
        Called with a line when something needs saying.

    Returns
    -------
    Outcome
    """
    folder = _new_folder(out, plan.name)
    write_text(folder / "scenario.toml", tomli_w.dumps(plan.scenario.model_dump(exclude_none=True)))
    trajectories: dict[str, Trajectory] = {}
    failures: dict[str, str] = {}
    interrupted = False
    _write_manifest(folder, plan, trajectories, failures, complete=False)
    problem, duration = plan.start.problem, plan.scenario.simulation.duration
    try:
        for name, (engine, settings) in plan.engines.items():
            try:
                trajectory = engine.simulate(problem, settings, lambda t, name=name: watch(name, t, duration))
            except Exception as error:  # whatever an engine raises must not cost the others' results
                failures[name] = _reason(error)
                note(f"{name}: {failures[name]}")
            else:
                write_trajectory(trajectory, folder / f"{name}.parquet")
                trajectories[name] = trajectory
            _write_manifest(folder, plan, trajectories, failures, complete=False)
    except KeyboardInterrupt:
        interrupted = True
        note("interrupted: finished engines are kept")
    with _deaf_to_interrupts():
        measured = measure(plan, trajectories)
        verdicts = judge(plan, measured)
        write_json(folder / "metrics.json", measured)
        _record(folder, plan, trajectories, measured, failures, verdicts)
        _write_manifest(folder, plan, trajectories, failures, complete=not interrupted)
    return Outcome(folder, measured, failures, verdicts, interrupted)


def _reason(error: Exception) -> str:
    """One line on why an engine failed; its own words where it chose them."""
    words = str(error) if isinstance(error, EngineError) else f"{type(error).__name__}: {error}"
    return " ".join(words.split())


def measure_one(start: Start, trajectory: Trajectory, reference: Trajectory | None) -> dict[str, Any]:
    """Metrics of a trajectory from a start, against a reference where there is one."""
    problem, circular = start.problem, start.motion is not None
    where = (problem.bicycle, problem.surface, start.growth_rate, start.size)
    return metrics(trajectory, reference, *where, circular)


def measure(plan: Plan, trajectories: Mapping[str, Trajectory]) -> dict[str, dict[str, Any]]:
    """Metrics of every trajectory against the reference's; without a reference, of each by itself."""
    reference = trajectories.get(REFERENCE)
    return {
        name: measure_one(plan.start, trajectory, None if name == REFERENCE else reference)
        for name, trajectory in trajectories.items()
    }


def judge(plan: Plan, measured: Mapping[str, Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Verdicts on the scenario's criterion, one an engine; an engine that cannot show it does not hold it."""
    if plan.scenario.criterion is None:
        return []
    limit = plan.scenario.criterion.energy_variation
    verdicts = []
    for name in plan.engines:
        value = measured.get(name, {}).get("energy_variation")
        # A bicycle that fell, or a run that ended, has not done the manoeuvre.
        done = name in measured and measured[name]["fell_at"] is None and measured[name]["ended"] is None
        holds = done and value is not None and value < limit
        verdicts.append(
            {"engine": name, "quantity": "energy_variation", "value": value, "limit": limit, "holds": holds}
        )
    return verdicts


def _record(
    folder: Path,
    plan: Plan,
    trajectories: Mapping[str, Trajectory],
    measured: Mapping[str, Mapping[str, Any]],
    failures: Mapping[str, str],
    verdicts: Sequence[Mapping[str, Any]],
) -> None:
    if not trajectories:
        return
    # rerun takes a second to load; only a run needs it.
    from reports.recording import write_recording

    problem = plan.start.problem
    shown = {name: _as_shown(plan, run) for name, run in trajectories.items()}
    facts = (plan.start.growth_rate, plan.scenario.simulation.duration)
    text = summary(plan.scenario.title, measured, failures, verdicts, *facts)
    write_recording(folder / "comparison.rrd", plan.scenario.title, problem.bicycle, problem.surface, shown, text)


def _as_shown(plan: Plan, trajectory: Trajectory) -> Trajectory:
    """The ride up to its fall, and one sample more than what is measured: there it lies."""
    problem = plan.start.problem
    shown = until_fall(trajectory, problem.bicycle, problem.surface, 1)
    return shown if len(shown.time) == len(trajectory.time) else replace(shown, ended="the bicycle fell")


def _new_folder(out: Path, name: str) -> Path:
    """Make a fresh folder named after the scenario and the time; an older run is never touched."""
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%S")
    for attempt in range(1, 1000):
        folder = out / (f"{name}-{stamp}" if attempt == 1 else f"{name}-{stamp}-{attempt}")
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            continue
        except OSError as error:
            raise ScenarioError(f"{out}: the run folder cannot be made: {error.strerror}") from error
        return folder
    raise ScenarioError(f"{out}: too many runs of {name} in one second")


def _write_manifest(
    folder: Path, plan: Plan, trajectories: Mapping[str, Trajectory], failures: Mapping[str, str], complete: bool
) -> None:
    start = plan.start
    engines: dict[str, Any] = {}
    for name, (engine, settings) in plan.engines.items():
        entry: dict[str, Any] = {"version": engine.version, "settings": settings.model_dump()}
        if name in trajectories:
            done = trajectories[name]
            entry |= {"cpu_time": done.cpu_time, "steps": done.steps, "ended": done.ended}
        if name in failures:
            entry["failed"] = failures[name]
        engines[name] = entry
    manifest = {
        "scenario": plan.name,
        "title": plan.scenario.title,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "complete": complete,
        "engines": engines,
        "left_out": plan.left_out,
        "libraries": library_versions(),
        "platform": {"system": platform.platform(), "machine": platform.machine(), "python": platform.python_version()},
        "start": {
            "family": start.family,
            "growth_rate": start.growth_rate,
            "q": start.problem.q.tolist(),
            "qd": start.problem.qd.tolist(),
        },
    }
    write_json(folder / "manifest.json", manifest)


def library_versions() -> dict[str, str]:
    """Versions of the libraries that results depend on, of those installed."""
    found = {}
    for library in LIBRARIES:
        try:
            found[library] = version(library)
        except PackageNotFoundError:
            continue
    return found


@contextmanager
def _deaf_to_interrupts():
    """Let no Ctrl-C tear the files of the finished engines; writing them takes a second."""
    if threading.current_thread() is not threading.main_thread():
        yield  # signals reach the main thread only
        return
    previous = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, previous)
