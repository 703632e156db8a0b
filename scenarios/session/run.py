"""Run a scenario from Python, with the same code as the command `velodrome run`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from ...engines.engine import Settings
from ...reference.bicycle import Bicycle
from ..run import RunPlan, RunResult, measure_run, plan_run, ride_plan, store_run, write_run_recording
from ..scenario import Scenario, load_scenario
from .arguments import (
    ignore_progress,
    plain_value,
    read_bicycle,
    read_changes,
    read_engines,
    read_path,
    read_progress,
    read_settings,
)
from .result import Run
from .table import MetricsTable


def run(
    scenario: str | Path,
    *,
    engines: str | Iterable[str] | None = None,
    duration: float | None = None,
    out: str | Path | None = None,
    settings: Mapping[str, Mapping[str, Any] | Settings] | None = None,
    changes: Mapping[str, Any] | None = None,
    bicycle: Bicycle | str | Path | None = None,
    progress: Callable[[str, float, float], None] | None = None,
) -> Run:
    """Run a scenario in every engine from the same computed start and compare the results with the reference.

    Parameters
    ----------
    scenario : str or Path
        Name of a scenario of the library (`scenario_names`), or path to a TOML file.
    engines : str or iterable of str, optional
        Engines to run in addition to the reference, which always runs: names, patterns such as ``"mujoco-*"``, or
        ``"all"``; by default the engines of the suite's own dependencies that support the problem.
    duration : float, optional
        Simulated time [s]; the scenario's own if not given.
    out : str or Path, optional
        Folder in which a run folder is made, as with `velodrome run --out`. Nothing is written if not given.
    settings : mapping, optional
        Settings by engine, as a mapping or an instance of its `Settings`. They override the scenario's.
    changes : mapping, optional
        Fields of the scenario to override, by dotted key, such as ``{"perturbation.lean_rate": 0.2}``.
    bicycle : Bicycle, str or Path, optional
        A bicycle, or a bicycle file as `velodrome bicycle` reads it, that replaces the scenario's; ``changes`` of
        single parameters apply to it.
    progress : callable, optional
        Called with the engine at work, the simulated time that it has reached and the duration [s]. An exception that
        it raises ends the run and is raised unchanged, so that a run can be cancelled.

    Returns
    -------
    Run
        The results; engines that failed are in its ``failures``.

    Raises
    ------
    MissingMotionError
        If the motion does not exist.
    ScenarioError
        If an argument has a wrong type or value: one line that names the argument.
    KeyboardInterrupt
        If Ctrl-C was pressed or ``progress`` raised it; with ``out`` the engines that were done are in the run folder.
    Exception
        What ``progress`` raises; with ``out`` a run folder of the engines that were done, without metrics, is left.

    Examples
    --------
    >>> import velodrome
    >>> run = velodrome.run("q2-plus", engines=["mujoco-multipliers"], duration=0.5)
    >>> list(run.trajectories)
    ['reference', 'mujoco-multipliers']
    >>> run.trajectories["mujoco-multipliers"].q.shape
    (51, 9)
    """
    read_path("scenario", scenario)
    wanted, given = read_engines(engines), read_settings(settings)
    into = None if out is None else read_path("out", out)
    watch = read_progress(progress)
    fields = read_changes(changes)
    if duration is not None:
        fields["simulation.duration"] = plain_value(duration)
    other = None if bicycle is None else read_bicycle(bicycle)
    name, resolved = load_scenario(str(scenario), fields, bicycle=other)
    plan = plan_run(name, _with_settings(resolved, given), wanted)
    if into is None:
        folder, result = None, measure_run(plan, ride_plan(plan, watch, ignore_progress))
    else:
        folder, result = store_run(plan, into, watch, ignore_progress)
    if result.interrupted:
        raise KeyboardInterrupt
    return _make_run(plan, result, folder)


def _with_settings(scenario: Scenario, settings: Mapping[str, Mapping[str, Any]]) -> Scenario:
    """Return the scenario with engine settings put on top of its own."""
    engines = dict(scenario.engines)
    for name, values in settings.items():
        engines[name] = {**engines.get(name, {}), **values}
    return scenario.model_copy(update={"engines": engines})


def _make_run(plan: RunPlan, result: RunResult, folder: Path | None) -> Run:
    def record(where: Path) -> None:
        write_run_recording(where, plan, result.shown, result.metrics, result.failures, result.verdicts)

    return Run(
        name=plan.name,
        title=plan.scenario.title,
        start=plan.start.problem,
        growth_rate=plan.start.growth_rate,
        family=plan.start.family,
        trajectories=result.trajectories,
        metrics=MetricsTable(result.metrics, plan.scenario.simulation.duration),
        verdicts=tuple(result.verdicts),
        failures=result.failures,
        left_out=plan.left_out,
        folder=folder,
        complete=not result.interrupted,
        recorder=record,
    )
