"""What float32 costs: rides in single precision against the same engine's rides in double precision, and why."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ...engines.admission import ride_engine
from ...engines.engine import (
    REFERENCE,
    Engine,
    Problem,
    Settings,
    Trajectory,
    UnsuitableProblem,
    why_failed,
)
from ...engines.guard import call_engine
from ...engines.registry import load_engine
from ...engines.single_precision import (
    AdvanceStates,
    SinglePrecision,
    SinglePrecisionVariant,
    find_single_precision,
    make_advance,
)
from ...reports.measure import (
    LastDigits,
    Sensitivity,
    carry_errors,
    disturb_states,
    find_deviations,
    measure_sensitivity,
    measure_step_errors,
)
from ..error import ScenarioError
from ..files import DEFAULT_FIGURES, FigureOutput, make_folder, write_json
from ..run import RunPlan, RunWatch, Trace, configure_engine, installed_engines, library_versions, plan_run
from ..scenario import Scenario, choose_engines, join_complaints, make_start, name_bicycle

_TIMES = (1.0, 3.0, 10.0, 20.0)  # at which distances are given, as far as a ride reaches, beside its end [s]
_INTERVAL = 0.1  # between times at which distances can be given; in the first of it contacts form [s]
# Of a block of the sensitivity [s]. The modes of a bicycle, of some rad/s, turn by some hundredths in it, and errors
# that contacts undo are off by a twelfth of the square of that.
_BLOCK = 0.01
_LAST_DIGIT = 2.0**-23  # relative spacing of float32
_MOST_STEPS = 200_000  # whose states are kept, some hundred megabytes


@dataclass(frozen=True)
class Float32Point:
    """Distances of D from the ride in double precision at a time; see `velodrome.reports.measure.float32`.

    Attributes
    ----------
    time : float
        [s].
    distance : float
        From the scenario's own start [m].
    rms_distance, largest_distance : float
        Over all starts [m].
    start : float
        What the states after the first 0.1 s, by which contacts have formed, lead to: root mean square over all
        starts [m].
    unrelated_digits, repeated_digits : float
        What the last digits of the state lead to, by the ride in double precision alone: two parts [m].
    measured_to_predicted : float or None
        Root mean square of the distances, relative to that of both parts together; None where both are zero.
    step_errors : float
        What the errors of the own ride's steps lead to [m].
    measured_to_step_errors : float or None
        The own distance relative to it.
    unexplained : float
        The part of the own deviation, a vector, that the errors of the own ride's steps do not lead to [m].
    """

    time: float
    distance: float
    rms_distance: float
    largest_distance: float
    start: float
    unrelated_digits: float
    repeated_digits: float
    measured_to_predicted: float | None
    step_errors: float
    measured_to_step_errors: float | None
    unexplained: float


@dataclass(frozen=True)
class _Double:
    """Rides in double precision, with the steps of one engine at one choice of settings."""

    engine: Engine
    settings: Settings
    rides: list[Trajectory]
    problems: list[Problem]
    sensitivity: Sensitivity
    advance: AdvanceStates

    @property
    def interval(self) -> int:
        """Number of steps of an interval: that in which contacts form, and those between samples."""
        return self.sensitivity.forming * self.sensitivity.block

    @property
    def interval_time(self) -> float:
        """Length of an interval [s]."""
        return self.interval * float(self.problems[0].times[1])


def study_float32(
    name: str,
    scenario: Scenario,
    wanted: list[str] | None,
    starts: int,
    watch: RunWatch,
    trace: Trace | None = None,
) -> dict[str, Any]:
    """Ride a scenario in single and in double precision.

    Parameters
    ----------
    name : str
    scenario : Scenario
    wanted : list of str or None
        Engines: names, patterns, or ``all``; all installed ones that compute in single precision if None.
    starts : int
        Number of rides, the first from the scenario's start, the others from starts that differ in the last digits.
    watch : callable
        Called with the name of the running part, the simulated time reached and the duration [s].
    trace : callable, optional
        Called with the name of an engine that failed and its exception.

    Returns
    -------
    dict
        The JSON document of `velodrome float32`.

    Raises
    ------
    ScenarioError
        If an engine has no single precision, the scenario cannot be run, or its ride in double precision ends early.
    """
    chosen, named = _choose_engines(wanted)
    left_out = _list_unsuitable(scenario, [engine for engine in chosen if engine not in named])
    plan = plan_run(name, scenario, [engine for engine in chosen if engine not in left_out] or [REFERENCE])
    doubles: dict[str, _Double] = {}
    entries: dict[str, Any] = {}
    for engine_name, single in chosen.items():
        if engine_name in left_out:
            entries[engine_name] = {"reason": left_out[engine_name], "ran": True, "variants": {}, "failures": []}
            continue
        engine, settings = plan.engines[engine_name]
        settings = _tighten(settings, single)
        double, key = _find_counterpart(plan, engine_name, single, settings)
        if key not in doubles:
            doubles[key] = _ride_double(plan, *double, starts, watch)
        entries[engine_name] = _study_engine(engine, settings, single, doubles[key], watch, trace)
    return {
        "scenario": name,
        **name_bicycle(plan.start.problem.bicycle),
        "duration": scenario.simulation.duration,
        "growth_rate": plan.start.growth_rate,
        "starts": starts,
        "engines": entries,
        "double": [
            {
                "engine": found.engine.name,
                "version": found.engine.version,
                "settings": found.settings.model_dump(mode="json"),
            }
            for found in doubles.values()
        ],
        "reference_distance": _measure_reference(plan, next(iter(doubles.values())), watch) if doubles else [],
        "libraries": library_versions(),
    }


def all_rode_float32(document: Mapping[str, Any]) -> bool:
    """Return whether every variant of every engine of a document of `velodrome float32` gave a ride."""
    return all(
        entry["ran"] and all(found["ended"] is None or found["points"] for found in entry["variants"].values())
        for entry in document["engines"].values()
    )


def _list_unsuitable(scenario: Scenario, names: list[str]) -> dict[str, str]:
    """Return those of some engines that a scenario does not suit, with the reason."""
    problem, found = make_start(scenario).problem, {}
    for name in names:
        engine, settings = configure_engine(name, scenario.engines.get(name, {}))
        try:
            engine.check(problem, settings)
        except UnsuitableProblem as error:
            found[name] = " ".join(str(error).split())
        except Exception:  # `plan_run` says what it is
            continue
    return found


def _choose_engines(wanted: list[str] | None) -> tuple[dict[str, SinglePrecision], frozenset[str]]:
    """Return the chosen engines with what they say of their single precision, and those chosen by name.

    Raises
    ------
    ScenarioError
        If an engine is not installed, or one that was named computes in double precision alone.
    """
    choice, unknown = choose_engines(wanted or ["all"])
    if unknown:
        raise ScenarioError(join_complaints(list(unknown.values())))
    found = {}
    for name in choice.names:
        try:
            single = find_single_precision(load_engine(name))
        except ValueError as error:
            if name in choice.named:
                raise ScenarioError(str(error)) from error
            continue  # broken, and not asked for by its name
        if single is not None:
            found[name] = single
    lacking = [name for name in choice.names if name in choice.named and name not in found and name != REFERENCE]
    if lacking or not found:
        able = [name for name in installed_engines() if _is_able(name)]
        does = "does" if len(lacking) == 1 else "do"
        what = f"{' and '.join(lacking)} {does}" if lacking else "these engines do"
        raise ScenarioError(
            f"--engine: {what} not say with which engine in float64 to compare a float32; those that do are "
            f"{', '.join(able)}"
        )
    return found, choice.named


def _is_able(name: str) -> bool:
    try:
        return find_single_precision(load_engine(name)) is not None
    except ValueError:
        return False


def _tighten(settings: Settings, single: SinglePrecision) -> Settings:
    """Return settings with those that both precisions are compared with, where the scenario sets no others."""
    common = {key: value for key, value in single.common.items() if key not in settings.model_fields_set}
    return type(settings).model_validate(settings.model_dump() | common)


def _find_counterpart(
    plan: RunPlan, name: str, single: SinglePrecision, settings: Settings
) -> tuple[tuple[Engine, Settings], str]:
    """Return the engine in double precision with the same settings, and a text that tells it from others."""
    if single.counterpart == name:
        pair = plan.engines[name][0], settings
    else:
        engine, defaults = configure_engine(single.counterpart, plan.scenario.engines.get(single.counterpart, {}))
        shared = {key: value for key, value in settings.model_dump().items() if key in defaults.model_dump()}
        pair = engine, type(defaults).model_validate(defaults.model_dump() | shared)
    return pair, f"{single.counterpart} {pair[1].model_dump_json()}"


def _ride_double(plan: RunPlan, engine: Engine, settings: Settings, starts: int, watch: RunWatch) -> _Double:
    step, duration = _read_step(engine, settings), plan.scenario.simulation.duration
    block = max(1, round(_BLOCK / step))
    forming = max(1, round(_INTERVAL / (block * step)))
    interval = forming * block
    if duration < 2 * interval * step:
        least = 2 * interval * step
        raise ScenarioError(f"{plan.name}: the duration is {duration:g} s; it must be at least {least:g} s")
    steps = int(duration / step * (1 + 1e-9)) // interval * interval
    if steps > _MOST_STEPS:
        raise ScenarioError(
            f"{plan.name}: the duration of {duration:g} s has {steps} steps; every step is looked at, so that it "
            f"must be at most {_MOST_STEPS * step:g} s"
        )
    problems = _make_problems(plan.start.problem, step, steps, interval, starts)
    rides = []
    for number, problem in enumerate(problems):
        label = f"{engine.name}, float64" + (f", start {number + 1}" if number else "")
        try:
            engine.check(problem, settings)
            ride = ride_engine(engine, problem, settings, _report(watch, label, duration))
        except Exception as error:  # nothing can be compared without it
            raise ScenarioError(f"{plan.name}: {engine.name} did not ride in float64: {why_failed(error)}") from error
        if ride.ended is not None:
            raise ScenarioError(
                f"{plan.name}: {engine.name} ends at {ride.time[-1]:.6g} s in float64: {ride.ended}; choose a shorter "
                "--duration"
            )
        rides.append(ride)
    watch(f"{engine.name}, sensitivity", 0.0, 1.0)
    try:
        advance = call_engine(make_advance, engine, plan.start.problem, settings)
        sensitivity = call_engine(measure_sensitivity, rides[0].q, rides[0].qd, block, forming, advance)
    except Exception as error:
        raise ScenarioError(f"{plan.name}: {engine.name} cannot step from its states: {why_failed(error)}") from error
    return _Double(engine, settings, rides, problems, sensitivity, advance)


def _read_step(engine: Engine, settings: Settings) -> float:
    step = getattr(settings, "step", None)
    if step is None:
        raise ScenarioError(f"engine {engine.name!r} has no step, whose errors could be measured")
    return float(step)


def _make_problems(problem: Problem, step: float, steps: int, interval: int, starts: int) -> list[Problem]:
    """Return the problem with a sample at every step, and with other starts and a sample after every interval."""
    times = np.arange(steps + 1) * step
    found = [replace(problem, times=times)]
    numbers = np.random.default_rng(starts)
    for _ in range(starts - 1):
        # Some last digits of a number of size 1: rides from these starts are rounded in unrelated ways.
        q, qd = disturb_states(problem.q[None], problem.qd[None], 3 * _LAST_DIGIT * numbers.uniform(-1, 1, (1, 18)))
        found.append(replace(problem, q=q[0], qd=qd[0], times=times[::interval]))
    return found


def _report(watch: RunWatch, label: str, duration: float) -> Callable[[float], None]:
    return lambda t: watch(label, t, duration)


def _study_engine(
    engine: Engine,
    settings: Settings,
    single: SinglePrecision,
    double: _Double,
    watch: RunWatch,
    trace: Trace | None,
) -> dict[str, Any]:
    variants, failures = {}, []
    for variant in single.variants:
        try:
            variants[variant.title] = _study_variant(engine, settings, single, variant, double, watch)
        except Exception as error:  # an engine may raise anything; the other variants still ride
            failures.append({"variant": variant.title, "reason": why_failed(error)})
            if trace is not None:
                trace(engine.name, error)
    return {
        "version": engine.version,
        "counterpart": double.engine.name,
        "settings": settings.model_dump(mode="json"),
        "reason": None,
        "ran": not failures,
        "variants": variants,
        "failures": failures,
    }


def _study_variant(
    engine: Engine,
    settings: Settings,
    single: SinglePrecision,
    variant: SinglePrecisionVariant,
    double: _Double,
    watch: RunWatch,
) -> dict[str, Any]:
    rider: Engine = engine if variant.engine is None else variant.engine
    chosen = rider.settings.model_validate(settings.model_dump() | dict(variant.changes))
    duration, rides = float(double.problems[0].times[-1]), []
    for number, problem in enumerate(double.problems):
        label = f"{engine.name}, {variant.title}" + (f", start {number + 1}" if number else "")
        rides.append(ride_engine(rider, problem, chosen, _report(watch, label, duration)))
    # A start that ends early shortens what can be compared.
    reached = min(float(ride.time[-1]) for ride in rides)
    end = int(reached / double.interval_time * (1 + 1e-9))
    errors = _find_errors(rides[0], double, end)
    digits = LastDigits(double.sensitivity, single.store, variant.rounded)
    ended = next((ride.ended for ride in rides if ride.ended is not None), None)
    return {
        "ended": None if ended is None else f"at {reached:.6g} s: {ended}",
        "points": [asdict(point) for point in _make_points(rides, double, digits, errors, end)],
    }


def _find_errors(own: Trajectory, double: _Double, end: int) -> np.ndarray:
    """Return the errors (n, 18) of the steps of a ride up to an interval."""
    formed, last, exact = double.interval, end * double.interval, double.rides[0]
    errors = np.zeros((last + 1, 18))
    if end:
        # In the first interval contacts form, with errors that are not small; it is taken as it ended.
        errors[formed] = _find_deviation(own, exact, formed)
        samples = slice(formed, last + 1)
        errors[formed + 1 :] = call_engine(measure_step_errors, own.q[samples], own.qd[samples], double.advance)
    return errors


def _find_deviation(own: Trajectory, exact: Trajectory, sample: int) -> np.ndarray:
    here = slice(sample, sample + 1)
    return find_deviations(own.q[here], own.qd[here], exact.q[here], exact.qd[here])[0]


def _make_points(
    rides: list[Trajectory], double: _Double, digits: LastDigits, errors: np.ndarray, end: int
) -> Iterator[Float32Point]:
    """Return the points at `_TIMES` and after the last of ``end`` intervals."""
    interval, sensitivity = double.interval_time, double.sensitivity
    rates = [double.interval, *[1] * (len(rides) - 1)]  # samples of an interval
    pairs = list(zip(rates, rides, double.rides, strict=True))
    if not end:
        return
    begun = np.array([_find_deviation(ride, exact, rate) for rate, ride, exact in pairs])
    for k in dict.fromkeys([*(round(t / interval) for t in _TIMES if t < interval * (end - 0.5)), end]):
        distances = np.array([np.linalg.norm((ride.q - exact.q)[k * rate, :3]) for rate, ride, exact in pairs])
        blocks = k * sensitivity.forming
        unrelated, repeated = digits.predict_unrelated(blocks), digits.predict_repeated(blocks)
        formed = begun @ sensitivity.carry_to(blocks)[sensitivity.forming].T
        led_to = carry_errors(sensitivity, errors, blocks)
        deviation = _find_deviation(rides[0], double.rides[0], k * double.interval)[:3]
        carried = float(np.linalg.norm(led_to))
        rms, predicted = _root_mean_square(distances), float(np.hypot(unrelated, repeated))
        yield Float32Point(
            time=k * interval,
            distance=float(distances[0]),
            rms_distance=rms,
            largest_distance=float(distances.max()),
            start=_root_mean_square(np.linalg.norm(formed, axis=1)),
            unrelated_digits=unrelated,
            repeated_digits=repeated,
            measured_to_predicted=rms / predicted if predicted > 0 else None,
            step_errors=carried,
            measured_to_step_errors=float(distances[0]) / carried if carried > 0 else None,
            unexplained=float(np.linalg.norm(deviation - led_to)),
        )


def _root_mean_square(numbers: np.ndarray) -> float:
    return float(np.sqrt(np.mean(numbers**2)))


def _measure_reference(plan: RunPlan, double: _Double, watch: RunWatch) -> list[dict[str, float]]:
    """Return the distances of the ride in double precision from the reference: what the steps cost anyway."""
    rate, ride = double.interval, double.rides[0]
    times = double.problems[0].times[::rate]
    engine, settings = plan.engines[REFERENCE]
    problem = replace(plan.start.problem, times=times)
    try:
        exact = ride_engine(engine, problem, settings, _report(watch, REFERENCE, float(times[-1])))
    except Exception as error:
        raise ScenarioError(f"{plan.name}: the reference did not run: {why_failed(error)}") from error
    interval, last = float(times[1]), len(exact.time) - 1
    ends = dict.fromkeys([*(round(t / interval) for t in _TIMES if t < interval * (last - 0.5)), last])
    return [
        {"time": float(times[k]), "distance": float(np.linalg.norm(ride.q[k * rate, :3] - exact.q[k, :3]))}
        for k in filter(None, ends)
    ]


def write_float32(document: Mapping[str, Any], out: Path, output: FigureOutput = DEFAULT_FIGURES) -> list[Path]:
    """Write the document and its figure into a folder, which is made if it does not exist.

    Raises
    ------
    ScenarioError
        If the folder cannot be made.
    """
    from ...reports.figures import float32_figure, write_formats

    make_folder(out)
    name = f"float32-{document['scenario']}"
    write_json(out / f"{name}.json", document)
    draw = partial(float32_figure, document)
    return [out / f"{name}.json", *write_formats(out / name, draw, output.formats, output.columns)]
