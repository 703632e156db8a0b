"""`velodrome precision`: every engine at halved steps, and about the motion its own linear system."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...engines.admission import ride_engine
from ...engines.engine import REFERENCE, Engine, Problem, Settings, Trajectory, why_failed
from ...engines.guard import call_engine
from ...reference.stability import linearise
from ...reference.surface import SurfaceOfRevolution
from ...reports.measure import IDENTIFY_LEVELS as IDENTIFY_LEVELS
from ...reports.measure import Identified, Level, comparison_horizon, eigenvalue_document, engine_document, identify
from ..error import ScenarioError
from ..files import make_folder, write_json
from ..run import RunPlan, RunWatch, Trace, claimed_noise, library_versions, measure_one, plan_run
from ..scenario import Scenario, Start

COARSEST = 4.0  # times the scenario's step
STEP_LEVELS = 5
_LONGEST_INTERVAL = 200  # output intervals of the scenario merged so that the coarsest steps divide them


@dataclass(frozen=True)
class Study:
    """Study of one engine.

    Attributes
    ----------
    levels : list of Level
        Those that ran to the end.
    failures : list of dict
        ``step`` and ``reason`` of those that did not.
    ran : bool
        Whether any level rode at all, or there was none to ride.
    identified : Identified, str or None
        Its own linear system, or why there is none.
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
        Engines beside the reference; all that are installed if None.
    levels : int
        Steps, each half the one before, from `COARSEST` times the scenario's on.
    eigenvalues : bool
        Whether to measure each engine's linear system too.
    watch : callable
        Called with what is run, the simulated time reached and the duration.
    trace : callable, optional
        Called with an engine that broke and what it raised.

    Returns
    -------
    dict
        The JSON document of `velodrome precision`.

    Raises
    ------
    ScenarioError
        If the scenario cannot be run, no output interval fits all steps, or the reference does not get through.
    """
    plan = plan_run(name, scenario, wanted)
    factors = [COARSEST / 2**level for level in range(levels)]
    # The reference is the yardstick: its own levels are coarser than itself.
    coarser = [2.0 ** (levels - level) for level in range(levels)]
    ladders = {
        engine: _ladder(settings, coarser if engine == REFERENCE else factors)
        for engine, (_, settings) in plan.engines.items()
    }
    problem = _sampled(plan, ladders)
    engine, settings = plan.engines[REFERENCE]
    watch(REFERENCE, 0.0, _duration(problem))
    try:
        reference = ride_engine(engine, problem, settings, lambda t: watch(REFERENCE, t, _duration(problem)))
    except Exception as error:  # without it there is nothing to measure against
        raise ScenarioError(f"{name}: the reference did not run: {why_failed(error)}") from error
    if reference.ended is not None:
        raise ScenarioError(f"{name}: the reference ends at {reference.time[-1]:.6g} s: {reference.ended}")
    studies = {}
    q, qd = plan.start.undisturbed
    undisturbed = replace(plan.start.problem, q=q, qd=qd)
    for engine_name, (engine, settings) in plan.engines.items():
        runs = list(_runs(engine, ladders[engine_name], plan.start, problem, reference, watch, trace))
        found = [run for run in runs if isinstance(run, Level)]
        failures = [run.as_json() for run in runs if isinstance(run, _Failure)]
        ran = not runs or not all(isinstance(run, _Failure) and run.broke for run in runs)
        identified = _identified(engine, settings, undisturbed, watch, trace) if eigenvalues else None
        studies[engine_name] = Study(found, failures, ran, identified)
    return _document(name, plan.start, problem, reference, undisturbed, studies)


def all_ran(document: Mapping[str, Any]) -> bool:
    """Whether every engine of a document of `velodrome precision` rode at one step at least."""
    return all(entry["ran"] for entry in document["engines"].values())


@dataclass(frozen=True)
class _Failure:
    """A level without a result: its step, why, and whether the engine broke instead of riding."""

    step: float | None
    reason: str
    broke: bool

    def as_json(self) -> dict[str, Any]:
        return {"step": self.step, "reason": self.reason}


def _duration(problem: Problem) -> float:
    return float(problem.times[-1])


def _ladder(settings: Settings, factors: list[float]) -> list[Settings]:
    """Settings of all levels that are in range."""
    found = []
    for factor in factors:
        try:
            found.append(call_engine(settings.refined, factor))
        except ValueError:
            continue  # beyond what the engine allows: fewer levels
    return found


def _refinable(settings: Settings) -> Settings:
    """These settings, or as much coarser as it takes for them to be halved as often as eigenvalues need."""
    for factor in (2.0**coarser for coarser in range(IDENTIFY_LEVELS)):
        try:
            settings.refined(factor * 0.5 ** (IDENTIFY_LEVELS - 1))
            return settings.refined(factor)
        except ValueError:
            continue
    return settings


def _sampled(plan: RunPlan, ladders: Mapping[str, list[Settings]]) -> Problem:
    """The scenario's problem, sampled at the shortest interval that all steps divide."""
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
    """Whether an engine takes a problem with the settings of all levels."""
    try:
        for settings in ladder:
            engine.check(problem, settings)
    except ValueError:
        return False
    except Exception as error:  # an engine may break here as well
        raise ScenarioError(f"engines.{name}: its check failed: {why_failed(error)}") from error
    return True


def _runs(
    engine: Engine,
    ladder: list[Settings],
    start: Start,
    problem: Problem,
    reference: Trajectory,
    watch: RunWatch,
    trace: Trace | None,
) -> Iterator[Level | _Failure]:
    for settings in ladder:
        step = getattr(settings, "step", None)
        try:
            trajectory = ride_engine(engine, problem, settings, lambda t: watch(engine.name, t, _duration(problem)))
        except Exception as error:  # whatever an engine raises must not cost the others' results
            yield _Failure(step, why_failed(error), broke=True)
            if trace is not None:
                trace(engine.name, error)
            continue
        measured = measure_one(start, trajectory, reference, step_noise=claimed_noise(engine, settings))
        if trajectory.ended is not None:
            yield _Failure(step, f"ended at {trajectory.time[-1]:.6g} s: {trajectory.ended}", broke=False)
        elif measured["fell_at"] is not None:
            yield _Failure(step, f"fell at {measured['fell_at']:.6g} s", broke=False)
        else:
            yield Level(_duration(problem) / trajectory.steps, trajectory, measured)


def _identified(
    engine: Engine, settings: Settings, undisturbed: Problem, watch: RunWatch, trace: Trace | None
) -> Identified | str:
    if not isinstance(undisturbed.surface, SurfaceOfRevolution):
        return "the ground is no surface of revolution, so that the motion is not steady"
    label = f"{engine.name} modes"
    try:
        return call_engine(identify, engine, _refinable(settings), undisturbed, lambda done: watch(label, done, 1.0))
    except (ArithmeticError, ValueError) as error:  # numpy's LinAlgError among them: there may be no such system
        return " ".join(str(error).split())
    except Exception as error:
        if trace is not None:
            trace(engine.name, error)
        return why_failed(error)


def _document(
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
            exact = linearise(undisturbed.bicycle, undisturbed.surface, undisturbed.q, undisturbed.qd)
            entry["eigenvalues"] = eigenvalue_document(found, exact.eigenvalues)
        elif found is not None:
            entry["failures"].append({"step": None, "reason": f"no eigenvalues: {found}"})
        engines[engine] = entry
    return {
        "scenario": name,
        "duration": _duration(problem),
        "horizon": horizon,
        "growth_rate": start.growth_rate,
        "engines": engines,
        "libraries": library_versions(),
    }


def write_precision(document: Mapping[str, Any], out: Path) -> list[Path]:
    """Write the document and its figure into a folder, which is made if need be.

    Raises
    ------
    ScenarioError
        If the folder cannot be made.
    """
    from ...reports.figures import precision_figure

    make_folder(out)
    files = [out / f"precision-{document['scenario']}.json", out / f"precision-{document['scenario']}.png"]
    write_json(files[0], document)
    precision_figure(files[1], document)
    return files
