"""Run a scenario from Python, with the same code as the command `velodrome run`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, cast

import numpy as np

from ...engines.engine import REFERENCE, Settings
from ..error import ScenarioError
from ..run import RunPlan, RunResult, measure_run, plan_run, ride_plan, store_run, write_run_recording
from ..scenario import Scenario, load_scenario
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
    progress: Callable[[str, float, float], None] | None = None,
) -> Run:
    """Run a scenario in every engine from the same computed start and compare the results with the reference.

    Parameters
    ----------
    scenario : str or Path
        Name of a scenario of the library (`scenario_names`), or path to a TOML file.
    engines : str or iterable of str, optional
        Engines to run in addition to the reference, which always runs; by default all installed engines that support
        the problem.
    duration : float, optional
        Simulated time [s]; the scenario's own if not given.
    out : str or Path, optional
        Folder in which a run folder is made, as with `velodrome run --out`. Nothing is written if not given.
    settings : mapping, optional
        Settings by engine, as a mapping or an instance of its `Settings`. They override the scenario's.
    changes : mapping, optional
        Fields of the scenario to override, by dotted key, such as ``{"perturbation.lean_rate": 0.2}``.
    progress : callable, optional
        Called with the running engine, the simulated time that it has reached and the duration [s].

    Returns
    -------
    Run
        The results; engines that failed are in its ``failures``.

    Raises
    ------
    ScenarioError
        If the scenario, an engine's name or a setting is wrong, or the motion does not exist.
    KeyboardInterrupt
        If Ctrl-C was pressed. With ``out``, the engines that had finished are in the run folder.

    Examples
    --------
    >>> import velodrome
    >>> run = velodrome.run("q2-plus", engines=["mujoco-multipliers"], duration=0.5)
    >>> list(run.trajectories)
    ['reference', 'mujoco-multipliers']
    >>> run.trajectories["mujoco-multipliers"].q.shape
    (51, 9)
    """
    fields = {key: _to_plain(value) for key, value in (changes or {}).items()}
    if duration is not None:
        fields["simulation.duration"] = _to_plain(duration)
    name, resolved = load_scenario(str(scenario), fields)
    plan = plan_run(name, _override_settings(resolved, settings or {}), _list_wanted(engines))
    watch = progress if progress is not None else _ignore_progress
    if out is None:
        folder, result = None, measure_run(plan, ride_plan(plan, watch, _ignore_progress))
    else:
        folder, result = store_run(plan, Path(out), watch, _ignore_progress)
    if result.interrupted:
        raise KeyboardInterrupt
    return _make_run(plan, result, folder)


def _ignore_progress(*_: Any) -> None:
    """Ignore progress and notes; failures are reported in the result."""


def _list_wanted(engines: str | Iterable[str] | None) -> list[str] | None:
    if engines is None:
        return None
    return [engines] if isinstance(engines, str) else list(engines) or [REFERENCE]


def _to_plain(value: Any) -> Any:
    """Convert a numpy value to a Python value, which a TOML file can contain."""
    given: Any = value
    return given.tolist() if isinstance(value, np.generic | np.ndarray) else value


def _override_settings(scenario: Scenario, settings: Mapping[str, Any]) -> Scenario:
    """Return the scenario with some of its engine settings overridden.

    Raises
    ------
    ScenarioError
        If the settings of an engine are neither a mapping nor an instance of `Settings`.
    """
    engines = dict(scenario.engines)
    for name, given in settings.items():
        if isinstance(given, Settings):
            values = given.model_dump(mode="json", exclude_none=True)
        elif isinstance(given, Mapping):
            table = cast("Mapping[str, Any]", given)
            values = {key: _to_plain(value) for key, value in table.items()}
        else:
            raise ScenarioError(f"settings of {name!r} are {given!r}; they must be a mapping such as {{'step': 0.001}}")
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
