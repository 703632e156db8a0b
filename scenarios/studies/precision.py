"""Work-precision study: every engine with halved steps, and its own linear system about the motion."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ...engines.admission import ride_engine
from ...engines.engine import REFERENCE, Engine, Problem, Settings, Trajectory, why_failed
from ...engines.guard import call_engine
from ...reference.stability import linearise
from ...reports.drawing import find_unsteadiness
from ...reports.measure import IDENTIFY_LEVELS as IDENTIFY_LEVELS
from ...reports.measure import Identified, Level, comparison_horizon, eigenvalue_document, engine_document, identify
from ..error import ScenarioError
from ..files import DEFAULT_FIGURES, FigureOutput, make_folder, write_json, write_text
from ..run import RunPlan, RunWatch, Trace, claimed_noise, library_versions, measure_one, plan_run
from ..scenario import Scenario, Start, name_bicycle

COARSEST = 4.0  # factor on the scenario's step
STEP_LEVELS = 5
_LONGEST_INTERVAL = 200  # number of output intervals that may be merged so that the coarsest steps divide them


@dataclass(frozen=True)
class Study:
    """Study of one engine.

    Attributes
    ----------
    levels : list of Level
        Levels that ran to the end.
    failures : list of dict
        ``step`` and ``reason`` of the other levels.
    ran : bool
        True if the engine ran on at least one level, or there were no levels to run.
    identified : Identified, str or None
        The engine's own linear system, or the reason why there is none; None if it was not requested.
    """

    levels: list[Level]
    failures: list[dict[str, Any]]
    ran: bool
    identified: Identified | str | None


def study_precision(
    name: str,
    scenario: Scenario,
    wanted: list[str] | None,
    levels: int,
    eigenvalues: bool,
    watch: RunWatch,
    trace: Trace | None = None,
) -> dict[str, Any]:
    """Study the engines of a scenario.

    Parameters
    ----------
    name : str
    scenario : Scenario
    wanted : list of str or None
        Engines in addition to the reference: names, patterns, or ``all``; those of the suite's own dependencies if
        None.
    levels : int
        Number of steps, each half of the previous one; the first is `COARSEST` times the scenario's step.
    eigenvalues : bool
        Whether to measure each engine's linear system too.
    watch : callable
        Called with the name of the running part, the simulated time reached and the duration [s].
    trace : callable, optional
        Called with the name of an engine that failed and its exception.

    Returns
    -------
    dict
        The JSON document of `velodrome precision`.

    Raises
    ------
    ScenarioError
        If the scenario cannot be run, no output interval fits all steps, or the reference does not reach the end.
    """
    plan = plan_run(name, scenario, wanted)
    factors = [COARSEST / 2**level for level in range(levels)]
    # Errors are relative to the reference, so its own levels have coarser steps than the reference ride.
    coarser = [2.0 ** (levels - level) for level in range(levels)]
    ladders = {
        engine: make_ladder(settings, coarser if engine == REFERENCE else factors)
        for engine, (_, settings) in plan.engines.items()
    }
    problem = sample_problem(plan, ladders)
    engine, settings = plan.engines[REFERENCE]
    watch(REFERENCE, 0.0, _duration(problem))
    try:
        reference = ride_engine(engine, problem, settings, lambda t: watch(REFERENCE, t, _duration(problem)))
    except Exception as error:  # errors cannot be measured without the reference
        raise ScenarioError(f"{name}: the reference did not run: {why_failed(error)}") from error
    if reference.ended is not None:
        raise ScenarioError(f"{name}: the reference ends at {reference.time[-1]:.6g} s: {reference.ended}")
    studies = {}
    q, qd = plan.start.undisturbed
    undisturbed = replace(plan.start.problem, q=q, qd=qd)
    unsteady = find_unsteadiness(undisturbed.surface, undisturbed.inputs, plan.start.motion is not None)
    for engine_name, (engine, settings) in plan.engines.items():
        runs = list(run_levels(engine, ladders[engine_name], plan.start, problem, reference, watch, trace))
        found = [run for run in runs if isinstance(run, Level)]
        failures = [run.as_json() for run in runs if isinstance(run, LevelFailure)]
        ran = not runs or not all(isinstance(run, LevelFailure) and run.broke for run in runs)
        identified = _identify(engine, settings, undisturbed, unsteady, watch, trace) if eigenvalues else None
        studies[engine_name] = Study(found, failures, ran, identified)
    return _make_document(name, plan.start, problem, reference, undisturbed, studies)


def all_ran(document: Mapping[str, Any]) -> bool:
    """Return whether every engine of a document of `velodrome precision` ran with at least one step."""
    return all(entry["ran"] for entry in document["engines"].values())


@dataclass(frozen=True)
class LevelFailure:
    """A level that has no place in a study of convergence.

    Attributes
    ----------
    step : float or None
        Step of its settings [s].
    reason : str
    level : Level or None
        Its ride up to a fall or an early end; None if the engine raised an exception.
    """

    step: float | None
    reason: str
    level: Level | None = None

    @property
    def broke(self) -> bool:
        """Whether the engine raised an exception."""
        return self.level is None

    def as_json(self) -> dict[str, Any]:
        """Return step and reason, as documents list them."""
        return {"step": self.step, "reason": self.reason}


def _duration(problem: Problem) -> float:
    return float(problem.times[-1])


def make_ladder(settings: Settings, factors: list[float]) -> list[Settings]:
    """Return the settings of all levels whose steps are in range."""
    found = []
    for factor in factors:
        try:
            found.append(call_engine(settings.refined, factor))
        except ValueError:
            continue  # the engine does not allow this step
    return found


def _make_refinable(settings: Settings) -> Settings:
    """Return the settings, with a coarser step if necessary for the number of halvings that eigenvalues need."""
    for factor in (2.0**coarser for coarser in range(IDENTIFY_LEVELS)):
        try:
            settings.refined(factor * 0.5 ** (IDENTIFY_LEVELS - 1))
            return settings.refined(factor)
        except ValueError:
            continue
    return settings


def sample_problem(plan: RunPlan, ladders: Mapping[str, list[Settings]]) -> Problem:
    """Return the scenario's problem, sampled at the shortest interval that all steps divide."""
    simulation = plan.scenario.simulation
    samples = round(simulation.duration * simulation.output_rate)
    for merged in range(1, min(samples, _LONGEST_INTERVAL) + 1):
        if samples % merged:
            continue
        times = np.arange(samples // merged + 1) * merged / simulation.output_rate
        problem = replace(plan.start.problem, times=times)
        if all(_fits(name, plan.engines[name][0], ladder, problem) for name, ladder in ladders.items()):
            return problem
    steps = [(step, name) for name, ladder in ladders.items() for step in map(_step, ladder) if step is not None]
    coarsest = ", the coarsest of which is {:g} s of {}".format(*max(steps)) if steps else ""
    raise ScenarioError(
        f"{plan.name}: no output interval divides {simulation.duration:g} s and is a multiple of all steps{coarsest}; "
        f"{_advise(plan, ladders)}"
    )


def _step(settings: Settings) -> float | None:
    return getattr(settings, "step", None)


def _advise(plan: RunPlan, ladders: Mapping[str, list[Settings]]) -> str:
    """Say which duration all steps fit, or what to do if none does."""
    simulation = plan.scenario.simulation
    for merged in range(1, _LONGEST_INTERVAL + 1):
        interval = merged / simulation.output_rate
        count = int(np.ceil(round(simulation.duration / interval, 9)))
        problem = replace(plan.start.problem, times=np.arange(count + 1) * merged / simulation.output_rate)
        if all(_fits(name, plan.engines[name][0], ladder, problem) for name, ladder in ladders.items()):
            return f"--duration {count * merged / simulation.output_rate:g} fits them"
    return "set steps and an output rate whose intervals are multiples of one another"


def _fits(name: str, engine: Engine, ladder: list[Settings], problem: Problem) -> bool:
    """Return whether an engine accepts a problem with the settings of all levels."""
    try:
        for settings in ladder:
            engine.check(problem, settings)
    except ValueError:
        return False
    except Exception as error:  # an engine's check may raise anything
        raise ScenarioError(f"engines.{name}: its check failed: {why_failed(error)}") from error
    return True


def run_levels(
    engine: Engine,
    ladder: list[Settings],
    start: Start,
    problem: Problem,
    reference: Trajectory,
    watch: RunWatch,
    trace: Trace | None,
) -> Iterator[Level | LevelFailure]:
    """Run an engine with each of the settings of a ladder; a level that fell or ended early is a failure.

    Parameters
    ----------
    engine : Engine
    ladder : list of Settings
    start : Start
    problem : Problem
        That of the start, sampled as `sample_problem` returns it.
    reference : Trajectory
        The reference's ride of the problem.
    watch : callable
        Called with the engine's name, the simulated time reached and the duration [s].
    trace : callable or None
        Called with the engine's name and the exception that it raised.

    Yields
    ------
    Level or LevelFailure
    """
    for settings in ladder:
        step = getattr(settings, "step", None)
        try:
            trajectory = ride_engine(engine, problem, settings, lambda t: watch(engine.name, t, _duration(problem)))
        except Exception as error:  # an engine may raise anything; the other engines still run
            yield LevelFailure(step, why_failed(error))
            if trace is not None:
                trace(engine.name, error)
            continue
        measured = measure_one(start, trajectory, reference, step_noise=claimed_noise(engine, settings))
        simulated = _duration(problem) if trajectory.ended is None else float(trajectory.time[-1])
        level = Level(simulated / max(trajectory.steps, 1), trajectory, measured)
        if measured["fell_at"] is not None:  # what lies may end the ride later
            yield LevelFailure(step, f"fell at {measured['fell_at']:.6g} s", level)
        elif trajectory.ended is not None:
            yield LevelFailure(step, f"ended at {trajectory.time[-1]:.6g} s: {trajectory.ended}", level)
        else:
            yield level


def _identify(
    engine: Engine, settings: Settings, undisturbed: Problem, unsteady: str | None, watch: RunWatch, trace: Trace | None
) -> Identified | str:
    if unsteady == "ground":
        return "the ground is no surface of revolution, so that the motion is not steady"
    if unsteady == "torques":
        return "a straight start with torques is no steady motion"
    label = f"{engine.name} modes"
    try:
        return call_engine(
            identify, engine, _make_refinable(settings), undisturbed, lambda done: watch(label, 100 * done, 100.0, "%")
        )
    except (ArithmeticError, ValueError) as error:  # includes numpy's LinAlgError: the system may not exist
        return " ".join(str(error).split())
    except Exception as error:
        if trace is not None:
            trace(engine.name, error)
        return why_failed(error)


def _make_document(
    name: str,
    start: Start,
    problem: Problem,
    reference: Trajectory,
    undisturbed: Problem,
    studies: Mapping[str, Study],
) -> dict[str, Any]:
    horizons = [comparison_horizon(study.levels) for engine, study in studies.items() if engine != REFERENCE]
    known = [horizon for horizon in horizons if horizon is not None]
    horizon = max(known) if known else None
    engines = {}
    for engine, study in studies.items():
        entry = engine_document(study.levels, study.failures, reference, start.size, horizon)
        entry["ran"] = study.ran
        found = study.identified
        entry["eigenvalues"] = None
        if isinstance(found, Identified):
            exact = linearise(
                undisturbed.bicycle, undisturbed.surface, undisturbed.q, undisturbed.qd, undisturbed.inputs
            )
            entry["eigenvalues"] = eigenvalue_document(found, exact.eigenvalues)
        elif found is not None:
            entry["failures"].append({"step": None, "reason": f"no eigenvalues: {found}"})
        engines[engine] = entry
    return {
        "scenario": name,
        **name_bicycle(problem.bicycle),
        "duration": _duration(problem),
        "horizon": horizon,
        "growth_rate": start.growth_rate,
        "engines": engines,
        "libraries": library_versions(),
    }


def write_precision(document: Mapping[str, Any], out: Path, output: FigureOutput = DEFAULT_FIGURES) -> list[Path]:
    """Write the document, its page and its figure into a folder, which is made if it does not exist.

    Raises
    ------
    ScenarioError
        If the folder cannot be made.
    """
    from ...reports.figures import precision_figure, write_formats
    from ...reports.page import make_precision_page

    make_folder(out)
    name = f"precision-{document['scenario']}"
    document_file, page = out / f"{name}.json", out / f"{name}.html"
    write_json(document_file, document)
    write_text(page, make_precision_page(document))
    draw = partial(precision_figure, document)
    return [document_file, page, *write_formats(out / name, draw, output.formats, output.columns)]
