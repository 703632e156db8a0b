"""Runs of a scenario: every engine starts from the same state; results are compared and stored in a run folder."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import tomli_w

from ...engines.admission import ride_engine
from ...engines.disk_arrays import release_pages
from ...engines.engine import REFERENCE, Engine, Settings, Trajectory, UnsuitableProblem, why_failed
from ...engines.storage import write_trajectory
from ...reports.measure import ROUND_OFF, compute_metrics, cut_at_fall
from ..error import ScenarioError
from ..files import file_digest, write_sealed, write_text
from ..scenario import (
    EngineChoice,
    Scenario,
    Start,
    choose_engines,
    configure_engine,
    join_complaints,
    list_engine_faults,
    make_start,
)
from .folder import (
    RUN_VERSION,
    SCENARIO_FILE,
    RunPlan,
    new_folder,
    resolve_plan,
    write_manifest,
    write_page,
    write_run_recording,
)
from .long_rides import evaluate_stored_ride


class RunWatch(Protocol):
    """Function that is told how far an engine's ride, or another part of the work, is."""

    def __call__(self, name: str, done: float, total: float, unit: str = "s", /) -> None:
        """Take the amount that is done and the total amount, by default in simulated time [s]."""


# (engine, what it raised)
Trace = Callable[[str, Exception], None]


@dataclass(frozen=True)
class RunOutcome:
    """Results of a run.

    Attributes
    ----------
    folder : Path
    metrics : dict
        Metrics by engine, as in ``metrics.json``.
    failures : dict
        Reasons by engine, for engines that gave no trajectory.
    verdicts : list of dict
        For each engine and criterion: ``engine, quantity, value, limit, holds``.
    interrupted : bool
    left_out : dict
        As in `RunPlan`.
    release : str or None
        Package and release with which the engines ran, where that is not the one of the suite's environment.
    """

    folder: Path
    metrics: dict[str, dict[str, Any]]
    failures: dict[str, str]
    verdicts: list[dict[str, Any]]
    interrupted: bool
    left_out: dict[str, str] = field(default_factory=dict)
    release: str | None = None


@dataclass(frozen=True)
class Rides:
    """Trajectories and failures of the engines of a plan.

    Attributes
    ----------
    trajectories : dict
        By engine, in the order in which the engines ran.
    failures : dict
        Reasons by engine, for engines that gave no trajectory.
    interrupted : bool
    """

    trajectories: dict[str, Trajectory]
    failures: dict[str, str]
    interrupted: bool = False


@dataclass(frozen=True, kw_only=True)
class RunResult:
    """The trajectories of a plan with their metrics and verdicts.

    Attributes
    ----------
    trajectories : dict
        Trajectories by engine, as the engines gave them.
    shown : dict
        Trajectories for plots and recordings: poses and energies follow from the coordinates, and samples after a fall
        are left out.
    metrics, failures, verdicts, interrupted
        As in `RunOutcome`.
    """

    trajectories: dict[str, Trajectory]
    shown: dict[str, Trajectory]
    metrics: dict[str, dict[str, Any]]
    failures: dict[str, str]
    verdicts: list[dict[str, Any]]
    interrupted: bool


def plan_run(
    name: str,
    scenario: Scenario,
    wanted: list[str] | EngineChoice | None = None,
    release: Mapping[str, Any] | None = None,
) -> RunPlan:
    """Check engines and settings and compute the start.

    Parameters
    ----------
    name : str
    scenario : Scenario
    wanted : list of str or EngineChoice, optional
        Engines to run in addition to the reference: names, patterns, or ``all``; by default the engines of the suite's
        own dependencies that support the problem.
    release : mapping, optional
        Facts about the release that is laid over this process; it may be one that the suite's package excludes.

    Raises
    ------
    ScenarioError
        If an engine is not installed, a setting is wrong, or the motion does not exist.
    """
    choice, unknown = (wanted, {}) if isinstance(wanted, EngineChoice) else choose_engines(wanted)
    faults = list(unknown.values())
    chosen: dict[str, tuple[Engine, Settings]] = {}
    cause: BaseException | None = None
    for engine in choice.names:
        try:
            values = scenario.engines.get(engine, {})
            chosen[engine] = configure_engine(engine, values, any_release=release is not None)
        except ScenarioError as error:
            faults.append(str(error))
            cause = cause or error.__cause__ or error  # --traceback shows it
    faults += list_engine_faults(scenario.engines, skipped=choice.names)
    if faults:
        raise ScenarioError(join_complaints(faults)) from cause
    start = make_start(scenario)
    left_out: dict[str, str] = {}
    for engine, (loaded, settings) in chosen.items():
        try:
            loaded.check(start.problem, settings)
        except ValueError as error:
            if engine in choice.named or not isinstance(error, UnsuitableProblem):
                raise ScenarioError(f"engines.{engine}: {error}") from error
            left_out[engine] = str(error)
        except Exception as error:  # an engine's check may raise anything
            raise ScenarioError(f"engines.{engine}: its check failed: {why_failed(error)}") from error
    chosen = {engine: pair for engine, pair in chosen.items() if engine not in left_out}
    return RunPlan(name, scenario, start, chosen, left_out, release)


def run_plan(
    plan: RunPlan,
    out: Path,
    watch: RunWatch,
    note: Callable[[str], None],
    trace: Trace | None = None,
    accept: Callable[[str], None] | None = None,
    say: Callable[[str], None] = lambda _: None,
    *,
    recording: bool = True,
    record_rate: float | None = None,
) -> RunOutcome:
    """Run every engine of a plan and write the run folder.

    Each engine's trajectory is written as soon as the engine has finished. Ctrl-C ends the running engine; the
    finished engines are still compared and recorded.

    Parameters
    ----------
    plan : RunPlan
    out : Path
        Folder in which the run folder is made.
    watch : callable
        Called with the engine, the simulated time reached and the duration [s].
    note : callable
        Called with a line of text for warnings and failures.
    trace : callable, optional
        Called with the name of an engine that failed and its exception.
    accept : callable, optional
        Called with the name of an engine that has finished; what it raises is that engine's failure.
    say : callable
        Called after the rides with what is being done.
    recording : bool
        Whether to write the recording.
    record_rate : float, optional
        Largest number of samples a second in the recording [Hz]; by default long rides are thinned. A line says what
        is left out.

    Returns
    -------
    RunOutcome
    """
    folder, result = store_run(plan, out, watch, note, trace, accept, say, recording=recording, record_rate=record_rate)
    return RunOutcome(
        folder,
        result.metrics,
        result.failures,
        result.verdicts,
        result.interrupted,
        plan.left_out,
        None if plan.release is None else f"{plan.release['package']} {plan.release['release']}",
    )


def store_run(
    plan: RunPlan,
    out: Path,
    watch: RunWatch,
    note: Callable[[str], None],
    trace: Trace | None = None,
    accept: Callable[[str], None] | None = None,
    say: Callable[[str], None] = lambda _: None,
    *,
    recording: bool = True,
    record_rate: float | None = None,
) -> tuple[Path, RunResult]:
    """Run every engine of a plan and write the run folder; return the folder and all results.

    See `run_plan` for the parameters.
    """
    folder = new_folder(out, plan.name)
    write_text(folder / SCENARIO_FILE, tomli_w.dumps(resolve_plan(plan).model_dump(exclude_none=True)))
    digest = file_digest(folder / SCENARIO_FILE)
    write_manifest(folder, plan, digest, {}, {})

    def store(name: str, rides: Rides) -> None:
        if name in rides.trajectories:
            write_trajectory(rides.trajectories[name], folder / f"{name}.parquet")
            release_pages(rides.trajectories[name])
        write_manifest(folder, plan, digest, rides.trajectories, rides.failures)

    rides = ride_plan(plan, watch, note, trace, store, accept, folder)
    with _block_interrupts():
        say("measuring the rides")
        result = measure_run(plan, rides, folder)
        say("writing the recording and the report")
        write_sealed(folder / "metrics.json", result.metrics, RUN_VERSION)
        recorded = None
        if recording and result.shown:
            parts = (result.shown, result.metrics, result.failures, result.verdicts)
            recorded = {"leaves_out": write_run_recording(folder, plan, *parts, rate=record_rate)}
            if recorded["leaves_out"] is not None:
                note(recorded["leaves_out"])
        manifest = write_manifest(
            folder,
            plan,
            digest,
            result.trajectories,
            result.failures,
            result.verdicts,
            complete=not result.interrupted,
            recording=recorded,
        )
        write_page(folder, plan, result.shown, result.metrics, manifest)
    return folder, result


def ride_plan(
    plan: RunPlan,
    watch: RunWatch,
    note: Callable[[str], None],
    trace: Trace | None = None,
    store: Callable[[str, Rides], None] | None = None,
    accept: Callable[[str], None] | None = None,
    folder: Path | None = None,
) -> Rides:
    """Simulate the problem of a plan with every engine.

    Parameters
    ----------
    plan : RunPlan
    watch, note, trace, accept : callable
        As `run_plan` takes them.
    store : callable, optional
        Called after each engine with its name and the rides so far.
    folder : Path, optional
        Folder for the temporary files of long rides; by default every ride is kept in memory.

    Returns
    -------
    Rides
        Of the engines that were done before Ctrl-C was pressed, if it was.

    Raises
    ------
    BaseException
        What ``watch`` raises, unchanged. A KeyboardInterrupt is handled like Ctrl-C.
    """
    rides = Rides({}, {})
    for line in plan.start.problem.bicycle.warnings():
        note(line)
    problem, duration = plan.start.problem, plan.scenario.simulation.duration
    # What `watch` raises, for example to cancel the run, is not a failure of the engine that called it.
    raised: list[BaseException] = []

    def report(name: str, time: float) -> None:
        try:
            watch(name, time, duration)
        except BaseException as error:
            raised.append(error)
            raise

    try:
        for name, (engine, settings) in plan.engines.items():
            try:
                trajectory = ride_engine(engine, problem, settings, lambda time, name=name: report(name, time), folder)
                if accept is not None:
                    accept(name)
            except Exception as error:  # whatever an engine raises must not cost the others' results
                if raised:
                    raise
                rides.failures[name] = why_failed(error)
                note(f"{name}: {rides.failures[name]}")
                if trace is not None:
                    trace(name, error)
            else:
                rides.trajectories[name] = trajectory
            if store is not None:
                store(name, rides)
    except KeyboardInterrupt:
        note("interrupted: finished engines are kept")
        return Rides(rides.trajectories, rides.failures, interrupted=True)
    return rides


def measure_run(plan: RunPlan, rides: Rides, folder: Path | None = None) -> RunResult:
    """Compute the metrics and verdicts of the rides of a plan, one ride after the other.

    Parameters
    ----------
    plan : RunPlan
    rides : Rides
    folder : Path, optional
        Folder for the temporary files of long rides, as `ride_plan` takes it.

    Returns
    -------
    RunResult
    """
    where = (plan.start.problem.bicycle, plan.start.problem.surface)
    shown: dict[str, Trajectory] = {}
    metrics: dict[str, dict[str, Any]] = {}
    reference: Trajectory | None = None  # the first of the rides, if it is among them
    for name, trajectory in rides.trajectories.items():
        followed = evaluate_stored_ride(trajectory, *where, folder)
        noise = claimed_noise(*plan.engines[name])
        metrics[name] = measure_one(plan.start, trajectory, reference, step_noise=noise, followed=followed)
        shown[name] = cut_at_fall(followed, *where)
        release_pages(trajectory, followed)
        reference = followed if name == REFERENCE else reference
    return RunResult(
        trajectories=rides.trajectories,
        shown=shown,
        metrics=metrics,
        failures=rides.failures,
        verdicts=judge_run(plan, metrics),
        interrupted=rides.interrupted,
    )


def measure_one(
    start: Start,
    trajectory: Trajectory,
    reference: Trajectory | None,
    *,
    step_noise: float = ROUND_OFF,
    followed: Trajectory | None = None,
) -> dict[str, Any]:
    """Compute the metrics of a trajectory; errors are relative to the reference trajectory if one is given."""
    return compute_metrics(
        trajectory,
        reference,
        start.problem.bicycle,
        start.problem.surface,
        start.growth_rate,
        start.size,
        start.motion is not None,
        inputs=start.problem.inputs,
        step_noise=step_noise,
        followed=followed,
    )


def claimed_noise(engine: Engine, settings: Settings) -> float:
    """Return the step noise that an engine states, or round-off if the stated value is not usable."""
    try:
        value = float(engine.step_noise(settings))
    except Exception:  # an engine may raise anything; its finished ride is still measured
        return ROUND_OFF
    return value if np.isfinite(value) and value >= 0 else ROUND_OFF


def judge_run(plan: RunPlan, measured: Mapping[str, Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return the verdicts on the scenario's criterion, one per engine.

    An engine whose value cannot be computed does not meet the criterion.
    """
    if plan.scenario.criterion is None:
        return []
    limit = plan.scenario.criterion.energy_variation
    verdicts = []
    for name in plan.engines:
        value = measured.get(name, {}).get("energy_variation")
        # If the bicycle fell or the run ended early, the manoeuvre was not completed.
        done = name in measured and measured[name]["fell_at"] is None and measured[name]["ended"] is None
        holds = done and value is not None and value < limit
        verdicts.append(
            {"engine": name, "quantity": "energy_variation", "value": value, "limit": limit, "holds": holds}
        )
    return verdicts


@contextmanager
def _block_interrupts():
    """Ignore Ctrl-C in the body, so that the files of the finished engines are written completely (about a second)."""
    if threading.current_thread() is not threading.main_thread():
        yield  # signals reach the main thread only
        return
    previous = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, previous)
