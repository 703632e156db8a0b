"""`velodrome check`: run the gated scenarios in every engine, hold them against the baselines."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

import reports
from engines.engine import Engine, EngineError, Settings, engine_names
from engines.steady import steady_trajectory
from reference.kinematics import REAR_ANGLE
from reports.drift import Scale, Verdict, judge, limits, missing, quantities
from reports.metrics import position_errors

from .error import ScenarioError
from .files import write_json
from .runner import Watch, configure, library_versions, measure_one
from .scenario import library_names, load_scenario
from .start import Start, make_start

BASELINES = Path(next(iter(reports.__path__))) / "baselines"
GATED_TAG = "gated"
DURATION = 3.0  # a turn of q2 and a bit: seconds of work in the slowest engine
OUTPUT_RATE = 50.0  # an interval that doubled steps divide as well: a coarser step is judged, not refused
SHORT_HORIZON = 1.0


@dataclass(frozen=True)
class Sample:
    """What one engine measured on one gated scenario."""

    values: dict[str, float | None]
    steps: int
    version: str
    settings: dict[str, Any]


def gated_names() -> list[str]:
    """Names of the library's gated scenarios."""
    return [name for name in library_names() if GATED_TAG in load_scenario(name)[1].tags]


def sample(start: Start, engine: Engine, settings: Settings, watch: Callable[[float], None]) -> Sample:
    """Run an engine on a circular motion and measure it against the exact one.

    Raises
    ------
    EngineError, ValueError
        If the engine does not run, or not to the end.
    """
    problem, motion = start.problem, start.motion
    if motion is None:
        raise ValueError("only a circular motion can be gated: its exact solution is known")
    trajectory = engine.simulate(problem, settings, watch)
    if trajectory.ended is not None:
        raise EngineError(trajectory.ended)
    exact = steady_trajectory(problem.bicycle, motion, problem.times)
    measured = measure_one(start, trajectory, exact)
    errors = position_errors(trajectory, exact)
    short = float(errors[np.searchsorted(problem.times, SHORT_HORIZON)])
    values = quantities(measured, short)
    return Sample(values, trajectory.steps, engine.version, settings.model_dump(mode="json"))


def scale_of(start: Start) -> Scale:
    """Sizes of a gated start."""
    qd = start.problem.qd
    speed, rear_rate = float(np.hypot(qd[0], qd[1])), float(abs(qd[REAR_ANGLE]))
    return Scale(start.size, speed, rear_rate, start.growth_rate, float(start.problem.times[-1]))


def check(
    watch: Watch,
    chosen: Callable[[str, Mapping[str, Any]], tuple[Engine, Settings]] = configure,
) -> tuple[list[tuple[str, Verdict]], dict[str, dict[str, Any]]]:
    """Run the gate.

    Parameters
    ----------
    watch : callable
        Called with engine, time reached and duration.
    chosen : callable
        Maps an engine's name and its settings in the scenario to the engine and its settings.

    Returns
    -------
    verdicts : list of (scenario, Verdict)
    fresh : dict
        Baseline of every scenario as this run would write it.
    """
    verdicts: list[tuple[str, Verdict]] = []
    fresh: dict[str, dict[str, Any]] = {}
    for name in gated_names():
        _, scenario = load_scenario(name, {"simulation.duration": DURATION, "simulation.output_rate": OUTPUT_RATE})
        start = make_start(scenario)
        baseline = read_baseline(name)
        entries: dict[str, Any] = {}
        # Engines of the baseline count too: one that is gone did not run.
        for engine_name in [*engine_names(), *sorted(set(baseline) - set(engine_names()))]:
            try:
                engine, settings = chosen(engine_name, scenario.engines.get(engine_name, {}))
                found = sample(start, engine, settings, lambda t, e=engine_name: watch(e, t, DURATION))
            except Exception as error:  # an engine that breaks in any way did not run
                verdicts.append((name, missing(engine_name, f"did not run: {error}")))
                continue
            allowed = limits(scale_of(start), engine.step_noise(settings), found.steps)
            entries[engine_name] = {
                "version": found.version,
                "settings": found.settings,
                "steps": found.steps,
                "quantities": found.values,
            }
            entry = baseline.get(engine_name)
            judged = judge(engine_name, found.values, entry, allowed, found.settings, found.version)
            verdicts += [(name, verdict) for verdict in judged]
        fresh[name] = {
            "scenario": name,
            "duration": DURATION,
            "short_horizon": SHORT_HORIZON,
            "created": datetime.now(UTC).date().isoformat(),
            "libraries": library_versions(),
            "engines": entries,
        }
    return verdicts, fresh


def read_baseline(scenario: str) -> dict[str, Any]:
    """Committed entries of a scenario, by engine; empty where there is no baseline.

    Raises
    ------
    ScenarioError
        If the file is damaged.
    """
    path = BASELINES / f"{scenario}.json"
    if not path.exists():
        return {}
    try:
        return json.loads(path.read_text(encoding="utf-8"))["engines"]
    except (json.JSONDecodeError, KeyError, TypeError) as error:
        raise ScenarioError(f"{path}: not a baseline: {error!r}") from error


def update(fresh: Mapping[str, Mapping[str, Any]]) -> list[Path]:
    """Write new baselines and return their paths."""
    BASELINES.mkdir(exist_ok=True)
    paths = []
    for name, baseline in fresh.items():
        paths.append(BASELINES / f"{name}.json")
        write_json(paths[-1], baseline)
    return paths
