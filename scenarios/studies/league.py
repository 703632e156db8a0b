"""All engines side by side: the same rides, each engine with settings that do not depend on the ride.

What an engine's row says does not depend on which other engines take part. All rows of a scenario are taken over the
same time, which is the scenario's duration or, for an unstable motion, the time in which the motion itself multiplies
an error by `GROWTH`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ...engines.admission import ride_engine
from ...engines.engine import (
    REFERENCE,
    SHAPES,
    Engine,
    Problem,
    Settings,
    Trajectory,
    UnsuitableProblem,
    describe_engine,
    describe_settings_source,
    list_bit_variants,
    why_failed,
)
from ...engines.registry import load_engine
from ...engines.releases import find_reach
from ...reports.drawing import make_remarks
from ...reports.measure import Level, engine_document, measure_creep
from ..error import MissingMotionError, ScenarioError
from ..files import make_folder, write_json, write_text
from ..run import RunPlan, RunWatch, Trace, claimed_noise, describe_run_environment, measure_one
from ..scenario import Scenario, Start, choose_engines, configure_engine, join_complaints, make_start, output_times
from .league_settings import LeagueSettings
from .precision import LevelFailure, make_ladder, run_levels, sample_problem

# The level plane; an upright manoeuvre of the IFToMM benchmark, which is stable; a disturbed stable circle in a flat
# bowl; an unstable circle in a steep bowl. Tangent planes, true surfaces, transients and growth are all there.
LEAGUE_SCENARIOS = ("plane-circle", "iftomm-2", "q2-plus", "p2")
LEAGUE_LEVELS = 3  # the default step, its half and its quarter: the fewest that show an order
# An error counts as small up to a hundredth of the motion's size (`velodrome.reports.measure.metrics.find_horizon`).
# Grown by this factor it is as large as the motion: later figures of an unstable motion say nothing of most engines.
GROWTH = 100.0
_ROUND_INTERVALS = 10  # the time of an unstable ride is a multiple of so many output intervals, which steps divide

Status = Literal["rode", "fell", "ended", "failed", "unsuitable"]


@dataclass(frozen=True)
class LeagueRide:
    """One engine's figures in one scenario, at the step of its settings; None where there is no such figure.

    Attributes
    ----------
    status : str
        ``rode`` to the end; ``fell``; ``ended`` early; ``failed``: it gave no ride; ``unsuitable``: it is not made for
        the ground or the inputs.
    reason : str or None
        Why it ended, failed or is unsuitable.
    position_error, rate_error, energy_drift, radius_drift_rate, mean_slip, contact_force_error, settled_force_error
        As in ``metrics.json``; of an engine that fell or ended early up to there.
    horizon, fell_at : float or None
        As in ``metrics.json`` [s].
    observed_order : float or None
        Order of convergence of the levels.
    order_range : list of float or None
        Least and largest order over parts of the ride.
    limit_error : float or None
        Distance of the limit of small steps from the reference [m].
    step : float or None
        Mean step [s].
    cpu_per_second : float or None
        CPU time of a simulated second, the least of two rides [s].
    creep : dict or None
        ``time``, ``share`` and ``slip_time`` of `velodrome.reports.measure.creep.Creep`.
    same_bits_twice : bool or None
        Whether a second ride was the same to the last bit.
    same_bits_elsewhere : dict
        The same by variant, for the engine's ``bit_variants``.
    points : list of dict
        The levels that rode to the end, as in `velodrome precision`, with ``cpu_per_second`` and ``creep``.
    failures : list of dict
        Levels that did not, ``step`` and ``reason``.
    remarks : list of str
        What a reader must know before trusting the figures.
    """

    status: Status
    reason: str | None = None
    position_error: float | None = None
    rate_error: float | None = None
    energy_drift: float | None = None
    radius_drift_rate: float | None = None
    mean_slip: float | None = None
    contact_force_error: float | None = None
    settled_force_error: float | None = None
    horizon: float | None = None
    fell_at: float | None = None
    observed_order: float | None = None
    order_range: list[float] | None = None
    limit_error: float | None = None
    step: float | None = None
    cpu_per_second: float | None = None
    creep: dict[str, float] | None = None
    same_bits_twice: bool | None = None
    same_bits_elsewhere: dict[str, bool | None] = field(default_factory=dict)
    points: list[dict[str, Any]] = field(default_factory=list)
    failures: list[dict[str, Any]] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)

    def as_json(self) -> dict[str, Any]:
        """Return the figures as JSON values."""
        return asdict(self)


@dataclass(frozen=True)
class LeagueEngine:
    """An engine of a league with its settings; of one that cannot be loaded the reason alone."""

    engine: Engine | None
    settings: Settings | None
    settings_source: str | None
    fault: str | None = None

    def as_json(self, rides: Mapping[str, LeagueRide]) -> dict[str, Any]:
        """Return the engine's part of the document."""
        reach = None if self.engine is None else find_reach(self.engine)
        return {
            **({} if reach is None else reach.list_adaptations()),
            "version": None if self.engine is None else self.engine.version,
            "description": None if self.engine is None else describe_engine(self.engine),
            "settings": None if self.settings is None else self.settings.model_dump(mode="json"),
            "settings_source": self.settings_source,
            "fault": self.fault,
            "scenarios": {name: ride.as_json() for name, ride in rides.items()},
        }


@dataclass(frozen=True)
class LeagueScenario:
    """A scenario of a league, cut to the time over which engines are compared, and its start."""

    name: str
    scenario: Scenario
    start: Start

    def as_json(self) -> dict[str, Any]:
        """Return the scenario's part of the document."""
        tables = self.scenario.model_dump(mode="json")
        return {
            "title": self.scenario.title,
            "duration": self.scenario.simulation.duration,
            "growth_rate": self.start.growth_rate,
            "size": self.start.size,
            **{key: tables[key] for key in ("surface", "motion", "perturbation")},
        }


@dataclass(frozen=True)
class League:
    """A league whose scenarios, engines and settings have been checked."""

    scenarios: tuple[LeagueScenario, ...]
    engines: dict[str, LeagueEngine]
    levels: int
    settings_file: str | None


def plan_league(
    scenarios: Sequence[tuple[str, Scenario]],
    wanted: Sequence[str] | None,
    chosen: LeagueSettings | None,
    levels: int = LEAGUE_LEVELS,
) -> League:
    """Check scenarios, engines and settings, and compute the starts.

    Parameters
    ----------
    scenarios : sequence of (str, Scenario)
    wanted : sequence of str or None
        Engines beside the reference: names, patterns or ``all``; all that are installed if None.
    chosen : LeagueSettings or None
        Settings that replace defaults.
    levels : int
        Number of steps; each is half of the one before, and the first is that of the settings.

    Raises
    ------
    ScenarioError
        If an engine is unknown, a scenario has settings of engines, or a motion does not exist. An engine that cannot
        be loaded is part of the league, with the reason.
    """
    choice, unknown = choose_engines(wanted or ["all"])
    faults = list(unknown.values())
    names = [name for name, _ in scenarios]
    faults += [f"{name}: two scenarios have this name" for name in dict.fromkeys(names) if names.count(name) > 1]
    faults += [
        f"{name}: engines.{', engines.'.join(scenario.engines)}: engines have the same settings in all rides of a "
        "league; put them into a file for --settings"
        for name, scenario in scenarios
        if scenario.engines
    ]
    if faults:
        raise ScenarioError(join_complaints(faults))
    engines = {name: _admit_engine(name, chosen) for name in choice.names}
    starts = tuple(_cut_scenario(name, scenario) for name, scenario in scenarios)
    return League(starts, engines, levels, None if chosen is None else chosen.file)


def _admit_engine(name: str, chosen: LeagueSettings | None) -> LeagueEngine:
    try:
        load_engine(name)
    except ValueError as error:  # of another package, which must not keep the others from riding
        return LeagueEngine(None, None, None, " ".join(str(error).split()))
    values = None if chosen is None else chosen.engines.get(name)
    engine, settings = configure_engine(name, values or {})
    source = describe_settings_source(engine) if values is None or chosen is None else chosen.describe_source(name)
    return LeagueEngine(engine, settings, source)


def _cut_scenario(name: str, scenario: Scenario) -> LeagueScenario:
    """Compute a scenario's start, and cut an unstable ride where its own growth reaches `GROWTH`."""
    try:
        start = make_start(scenario)
    except MissingMotionError as error:
        raise MissingMotionError(f"{name}: {error}", error.reason) from error
    except ScenarioError as error:
        raise ScenarioError(f"{name}: {error}") from error
    simulation = scenario.simulation
    samples = round(simulation.duration * simulation.output_rate)
    if start.growth_rate > 0:
        grown = int(math.log(GROWTH) / start.growth_rate * simulation.output_rate)
        samples = min(samples, max(1, grown // _ROUND_INTERVALS) * _ROUND_INTERVALS)
    cut = simulation.model_copy(update={"duration": samples / simulation.output_rate})
    problem = replace(start.problem, times=output_times(cut))
    return LeagueScenario(name, scenario.model_copy(update={"simulation": cut}), replace(start, problem=problem))


def run_league(
    league: League, watch: RunWatch, store: Callable[[Mapping[str, Any]], None], trace: Trace | None = None
) -> dict[str, Any]:
    """Ride every scenario in every engine.

    Parameters
    ----------
    league : League
    watch : callable
        Called with the name of the running engine, the simulated time reached and the duration [s].
    store : callable
        Called with the document so far, after every engine in every scenario.
    trace : callable, optional
        Called with the name of an engine that failed and its exception.

    Returns
    -------
    dict
        The JSON document of `velodrome league`; after Ctrl-C the finished rides, and ``complete`` is False.

    Raises
    ------
    ScenarioError
        If the reference does not reach the end of a scenario.
    """
    rides: dict[str, dict[str, LeagueRide]] = {name: {} for name in league.engines}
    document = _make_document(league, rides, complete=False)
    try:
        for stage in league.scenarios:
            references = _References(stage, league.engines[REFERENCE], watch)
            for name, entry in league.engines.items():
                if entry.engine is None or entry.settings is None:
                    rides[name][stage.name] = LeagueRide("failed", entry.fault)
                else:
                    rides[name][stage.name] = _ride(
                        stage, entry.engine, entry.settings, league.levels, references, watch, trace
                    )
                document = _make_document(league, rides, complete=False)
                store(document)
    except KeyboardInterrupt:
        return document
    document = _make_document(league, rides, complete=True)
    store(document)
    return document


class _References:
    """The reference's rides of a scenario, one for each set of output times that engines need."""

    def __init__(self, stage: LeagueScenario, entry: LeagueEngine, watch: RunWatch) -> None:
        if entry.engine is None or entry.settings is None:
            raise ScenarioError(f"the reference cannot be loaded: {entry.fault}")
        self._stage, self._engine, self._settings, self._watch = stage, entry.engine, entry.settings, watch
        self._rides: dict[int, Trajectory] = {}

    def ride(self, problem: Problem) -> Trajectory:
        """Return the reference's ride of the scenario's problem at these output times."""
        duration, count = float(problem.times[-1]), len(problem.times)
        if count not in self._rides:
            where = f"{self._stage.name}: the reference"
            try:
                ride = ride_engine(self._engine, problem, self._settings, lambda t: self._watch(REFERENCE, t, duration))
            except Exception as error:  # errors cannot be measured without the reference
                raise ScenarioError(f"{where} did not run: {why_failed(error)}") from error
            if ride.ended is not None:
                raise ScenarioError(f"{where} ends at {ride.time[-1]:.6g} s: {ride.ended}")
            self._rides[count] = ride
        return self._rides[count]


def _ride(
    stage: LeagueScenario,
    engine: Engine,
    settings: Settings,
    levels: int,
    references: _References,
    watch: RunWatch,
    trace: Trace | None,
) -> LeagueRide:
    """Ride a scenario in an engine with all steps, and once more with the first."""
    halves = [0.5**level for level in range(1, levels)]
    ladder = [settings] if engine.name == REFERENCE else [settings, *make_ladder(settings, halves)]
    plan = RunPlan(stage.name, stage.scenario, stage.start, {engine.name: (engine, settings)}, {})
    refused = _find_refusal(engine, stage.start.problem, settings)
    if isinstance(refused, UnsuitableProblem):
        return LeagueRide("unsuitable", " ".join(str(refused).split()))
    try:
        problem = sample_problem(plan, {engine.name: ladder})
    except ScenarioError as error:
        return LeagueRide("failed", " ".join(str(refused or error).split()))
    start, reference = stage.start, references.ride(problem)
    if engine.name == REFERENCE:
        return _describe_reference(stage, engine, settings, problem, reference, watch)
    runs = list(run_levels(engine, ladder, start, problem, reference, watch, trace))
    found = [run for run in runs if isinstance(run, Level)]
    failures = [run.as_json() for run in runs if isinstance(run, LevelFailure)]
    first = runs[0] if isinstance(runs[0], Level) else runs[0].level
    if first is None:
        return LeagueRide("failed", failures[0]["reason"], failures=failures)
    again = _ride_again(engine, problem, settings, watch)
    study = engine_document(found, failures, reference, start.size, None)
    measured = first.metrics
    creep = [_measure_creep(level.trajectory, problem) for level in (first, *found)]
    costs = [cost for cost in (_cost(first.trajectory), again and _cost(again)) if cost]
    return LeagueRide(
        status=_find_status(measured),
        reason=measured["ended"],
        position_error=measured["position_error"]["max"],
        **{
            key: measured[key]
            for key in ("rate_error", "energy_drift", "radius_drift_rate", "mean_slip", "contact_force_error")
        },
        settled_force_error=measured["settled_force_error"],
        horizon=measured["horizon"],
        fell_at=measured["fell_at"],
        observed_order=study["observed_order"],
        order_range=study["order_range"],
        limit_error=study["richardson_error"],
        step=first.step,
        cpu_per_second=min(costs, default=None),
        creep=creep[0],
        same_bits_twice=None if again is None else equal_to_the_bit(first.trajectory, again),
        same_bits_elsewhere=_compare_variants(engine, settings, problem, first.trajectory, watch),
        points=[
            {**point, "cpu_per_second": _cost(level.trajectory), "creep": one}
            for point, level, one in zip(study["points"], found, creep[1:], strict=True)
        ],
        failures=study["failures"],
        remarks=make_remarks(engine.name, measured, float(problem.times[-1])),
    )


def _find_refusal(engine: Engine, problem: Problem, settings: Settings) -> Exception | None:
    """Return what an engine's check raises."""
    try:
        engine.check(problem, settings)
    except Exception as error:  # an engine's check may raise anything
        return error
    return None


def _describe_reference(
    stage: LeagueScenario,
    engine: Engine,
    settings: Settings,
    problem: Problem,
    ride: Trajectory,
    watch: RunWatch,
) -> LeagueRide:
    """Return what there is to say of the reference itself: what it keeps, its cost, and whether it repeats itself."""
    measured = measure_one(stage.start, ride, None, step_noise=claimed_noise(engine, settings))
    again = _ride_again(engine, problem, settings, watch)
    costs = [cost for cost in (_cost(ride), again and _cost(again)) if cost]
    return LeagueRide(
        status=_find_status(measured),
        energy_drift=measured["energy_drift"],
        mean_slip=measured["mean_slip"],
        fell_at=measured["fell_at"],
        step=float(problem.times[-1]) / max(ride.steps, 1),
        cpu_per_second=min(costs, default=None),
        same_bits_twice=None if again is None else equal_to_the_bit(ride, again),
    )


def _find_status(measured: Mapping[str, Any]) -> Status:
    if measured["fell_at"] is not None:
        return "fell"
    return "rode" if measured["ended"] is None else "ended"


def _ride_again(engine: Engine, problem: Problem, settings: Settings, watch: RunWatch) -> Trajectory | None:
    """Ride a problem once more; None if the engine fails."""
    duration = float(problem.times[-1])
    try:
        return ride_engine(engine, problem, settings, lambda t: watch(engine.name, t, duration))
    except Exception:  # an engine may raise anything; its first ride stands
        return None


def _compare_variants(
    engine: Engine, settings: Settings, problem: Problem, first: Trajectory, watch: RunWatch
) -> dict[str, bool | None]:
    """Compare rides with the engine's own variants of settings; None for a variant that did not ride."""
    found: dict[str, bool | None] = {}
    for text, changes in list_bit_variants(engine).items():
        try:
            varied = type(settings).model_validate(settings.model_dump() | changes)
        except ValueError:
            found[text] = None
            continue
        other = _ride_again(engine, problem, varied, watch)
        found[text] = None if other is None else equal_to_the_bit(first, other)
    return found


def equal_to_the_bit(one: Trajectory, other: Trajectory) -> bool:
    """Return whether all arrays of two rides, their numbers of steps and their ends are equal."""
    for name in SHAPES:
        a, b = getattr(one, name), getattr(other, name)
        if (a is None) != (b is None):
            return False
        if a is not None and not (a.shape == b.shape and np.array_equal(a, b, equal_nan=True)):
            return False
    return one.steps == other.steps and one.ended == other.ended


def _cost(trajectory: Trajectory) -> float | None:
    """Return the CPU time of a simulated second [s]; None where it is too short to be measured."""
    simulated = float(trajectory.time[-1])
    return trajectory.cpu_time / simulated if simulated > 0 and trajectory.cpu_time > 0 else None


def _measure_creep(trajectory: Trajectory, problem: Problem) -> dict[str, float] | None:
    found = measure_creep(trajectory, problem.bicycle, problem.surface)
    return None if found is None else asdict(found)


def _make_document(league: League, rides: Mapping[str, Mapping[str, LeagueRide]], complete: bool) -> dict[str, Any]:
    return {
        "complete": complete,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "levels": league.levels,
        "settings_file": league.settings_file,
        "scenarios": {stage.name: stage.as_json() for stage in league.scenarios},
        "engines": {name: entry.as_json(rides[name]) for name, entry in league.engines.items()},
        **describe_run_environment(),
    }


def all_rode(document: Mapping[str, Any]) -> bool:
    """Return whether every engine of a league gave a ride in every scenario that suits it."""
    rides = [ride for entry in document["engines"].values() for ride in entry["scenarios"].values()]
    return document["complete"] and all(ride["status"] != "failed" for ride in rides)


class LeagueFolder:
    """The files of a league: ``league.json``, written after every ride, and the page ``league.html``."""

    def __init__(self, out: Path) -> None:
        make_folder(out)
        self.document, self.page = out / "league.json", out / "league.html"

    def store(self, document: Mapping[str, Any]) -> None:
        """Write the document so far."""
        write_json(self.document, document)

    def finish(self, document: Mapping[str, Any]) -> Iterable[Path]:
        """Write the document and the page; return their paths."""
        from ...reports.page import make_league_page

        self.store(document)
        write_text(self.page, make_league_page(document))
        return [self.document, self.page]
