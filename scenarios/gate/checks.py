"""`velodrome check`: run the gated scenarios in every engine, hold them against the baselines."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache, partial
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from ...engines.engine import Engine, Settings, UnsuitableProblem, why_failed
from ...engines.format_version import VERSION_KEY, read_version
from ...engines.guard import call_engine
from ..error import ScenarioError
from ..files import make_folder, write_json
from ..run import RunWatch, Trace, configure_engine, installed_engines, library_versions, read_json
from ..scenario import (
    OF_THE_MOTION,
    Gate,
    Scenario,
    Simulation,
    format_validation_error,
    library_names,
    load_scenario,
    make_start,
    read_toml,
    refuse_engine,
    show_value,
)
from .exact import find_exact
from .sample import SHORT_HORIZON, take_sample
from .verdict import ABSOLUTE, CHANGES, Verdict, judge_sample, missing_verdict

BASELINES = Path(__file__).parent / "baselines"
GATED_TAG = "gated"
BASELINE_VERSION = 1
_SETTINGS = Path(__file__).parent / "gate.toml"


class _Entry(BaseModel):
    """What a baseline must say of an engine; whatever else it says is kept."""

    model_config = ConfigDict(strict=True, extra="allow", allow_inf_nan=False)

    created: str = ""
    version: str
    settings: dict[str, Any]
    step_noise: float | None = Field(default=None, ge=0)
    quantities: dict[str, float | None]


class _Baseline(BaseModel):
    """A baseline file."""

    model_config = ConfigDict(strict=True, allow_inf_nan=False)

    scenario: str | None = None
    duration: float = Gate.model_fields["duration"].default
    output_rate: float = Gate.model_fields["output_rate"].default
    short_horizon: float = SHORT_HORIZON
    content: dict[str, Any] | None = None
    engines: dict[str, _Entry]


Chosen = Callable[[str, Mapping[str, Any]], tuple[Engine, Settings]]


def gated_names() -> list[str]:
    """Names of the library's gated scenarios."""
    return [name for name in library_names() if GATED_TAG in load_scenario(name)[1].tags]


@cache
def gate_settings() -> dict[str, dict[str, Any]]:
    """Engines' settings on gated rides, by engine, where a scenario has no others."""
    return read_toml(_SETTINGS.read_text(encoding="utf-8"))["engines"]


def check_gate(
    watch: RunWatch,
    sources: Sequence[str] | None = None,
    engines: Sequence[str] | None = None,
    baselines: Path | None = None,
    chosen: Chosen = configure_engine,
    trace: Trace | None = None,
    hold_cpu: bool = False,
) -> tuple[list[tuple[str, Verdict]], dict[str, dict[str, Any]]]:
    """Run the gate.

    Every engine has a verdict on every scenario, but for engines that were not asked for, have no baseline and are
    not made for the motion: one that exits, breaks or is not judged for any other reason did not run, and fails.

    Parameters
    ----------
    watch : callable
        Called with engine, time reached and duration.
    sources : sequence of str, optional
        Scenarios, library names or paths; the library's gated ones if not given.
    engines : sequence of str, optional
        Engines to judge; all that are installed or in a baseline if not given.
    baselines : Path, optional
        Folder of the baselines; the suite's own if not given.
    chosen : callable
        Maps an engine's name and its settings in the scenario to the engine and its settings.
    trace : callable, optional
        Called with an engine that broke and what it raised.
    hold_cpu : bool
        Whether an engine's CPU time, relative to the reference's, is judged too.

    Returns
    -------
    verdicts : list of (scenario, Verdict)
    fresh : dict
        Baseline of every scenario as this run would write it.

    Raises
    ------
    ScenarioError
        If a scenario or a baseline is none, or an engine is neither installed nor in a baseline.
    """
    folder = BASELINES if baselines is None else baselines
    scenarios = [load_gated(source) for source in (sources or gated_names())]
    known = {name: read_baseline(name, folder, scenario) for name, scenario in scenarios}
    judged = _to_judge(engines, known)
    verdicts: list[tuple[str, Verdict]] = []
    fresh: dict[str, dict[str, Any]] = {}
    for name, scenario in scenarios:
        held = _hold(name, scenario, judged, known[name], watch, chosen, trace, bool(engines), hold_cpu)
        verdicts += [(name, verdict) for verdict in [*held.verdicts, *_without_verdict(judged, held)]]
        fresh[name] = {
            VERSION_KEY: BASELINE_VERSION,
            "scenario": name,
            **_ride(scenario),
            "content": gated_content(scenario),
            "libraries": library_versions(),
            "exact_error": held.exact_error,
            "engines": held.entries,
        }
    if not verdicts:
        raise ScenarioError("nothing was judged: no engine and no scenario go together")
    return verdicts, fresh


def load_gated(source: str) -> tuple[str, Scenario]:
    """Name of a scenario, and the scenario as the gate rides it."""
    name, scenario = load_scenario(source)
    gate = scenario.gate or Gate()
    simulation = Simulation(duration=gate.duration, output_rate=gate.output_rate)
    return name, scenario.model_copy(update={"gate": gate, "simulation": simulation})


def _ride(scenario: Scenario) -> dict[str, float]:
    """How a gated scenario is ridden: what of it a baseline holds for."""
    simulation = scenario.simulation
    return {
        "duration": simulation.duration,
        "output_rate": simulation.output_rate,
        "short_horizon": SHORT_HORIZON,
    }


def _to_judge(wanted: Sequence[str] | None, known: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Names of the engines to judge; those of a baseline count too: one that is gone did not run."""
    there = installed_engines()
    names = [*there, *sorted({name for entries in known.values() for name in entries} - set(there))]
    for engine in wanted or []:
        if engine not in names:
            raise ScenarioError(refuse_engine(engine, there))
    return [name for name in names if not wanted or name in wanted]


@dataclass(frozen=True)
class _Held:
    """What came of all engines on one scenario.

    Verdicts, entries of a new baseline, engines that were passed over, and the exact ride's own error.
    """

    verdicts: list[Verdict]
    entries: dict[str, Any]
    passed_over: list[str]
    exact_error: float


def _hold(
    name: str,
    scenario: Scenario,
    engines: Sequence[str],
    baseline: Mapping[str, Any],
    watch: RunWatch,
    chosen: Chosen,
    trace: Trace | None,
    asked: bool,
    hold_cpu: bool,
) -> _Held:
    """Hold the engines on one scenario against the baseline.

    An engine that the motion does not suit is passed over, unless it was ``asked`` for or has a baseline.
    """
    start = make_start(scenario)
    try:
        exact = find_exact(start)
    except ScenarioError as error:
        raise ScenarioError(f"{name}: {error}") from error
    held = _Held([], {}, [], exact.error)
    for engine_name in engines:
        entry = baseline.get(engine_name)
        try:
            values = gate_settings().get(engine_name, {}) | scenario.engines.get(engine_name, {})
            engine, settings = chosen(engine_name, values)
            found = call_engine(
                take_sample,
                start,
                exact,
                scenario.gate or Gate(),
                engine,
                settings,
                watch=partial(_report, watch, engine_name, scenario.simulation.duration),
                known_noise=(entry or {}).get("step_noise"),
                hold_cpu=hold_cpu,
            )
        except Exception as error:  # an engine that breaks in any way did not run
            if entry is None and not asked and isinstance(error, UnsuitableProblem):
                held.passed_over.append(engine_name)
                continue
            own_words = isinstance(error, ScenarioError | UnsuitableProblem)
            why = " ".join(str(error).split()) if own_words else why_failed(error)
            held.verdicts.append(missing_verdict(engine_name, f"did not run: {why}"))
            if trace is not None:
                trace(engine_name, error)
            continue
        held.entries[engine_name] = {
            "created": datetime.now(UTC).date().isoformat(),
            "version": found.version,
            "settings": found.settings,
            "steps": found.steps,
            "step_noise": found.step_noise,
            "quantities": found.values,
        }
        run = (found.settings, found.version, found.reasons)
        held.verdicts.extend(judge_sample(engine_name, found.values, entry, found.limits, *run))
    return held


def _report(watch: RunWatch, engine: str, duration: float, time: float) -> None:
    watch(engine, time, duration)


def _without_verdict(engines: Sequence[str], held: _Held) -> list[Verdict]:
    """Verdicts on engines that should have been judged and were not: nothing that is known of them holds."""
    judged = {verdict.engine for verdict in held.verdicts if verdict.quantity != CHANGES}
    expected = [name for name in engines if name not in held.passed_over]
    return [
        missing_verdict(name, "did not run: none of its quantities was judged")
        for name in expected
        if name not in judged
    ]


def gated_content(scenario: Scenario) -> dict[str, Any]:
    """What of a scenario its motion depends on, as JSON values."""
    return scenario.model_dump(mode="json", exclude_none=True, include={*OF_THE_MOTION})


def read_baseline(name: str, folder: Path | None = None, scenario: Scenario | None = None) -> dict[str, Any]:
    """Committed entries of a scenario, by engine; empty where there is no baseline.

    Parameters
    ----------
    name : str
        Of the scenario.
    folder : Path, optional
    scenario : Scenario, optional
        As the gate rides it: the baseline must be of the same ride of the same motion.

    Raises
    ------
    ScenarioError
        If the file is damaged, of another scenario, or of another ride.
    """
    within = BASELINES if folder is None else folder
    path = within / f"{name}.json"
    if within.exists() and not within.is_dir():
        raise ScenarioError(f"{within}: is no folder of baselines")
    if not path.exists():
        return {}
    try:
        data = read_json(path)
        if isinstance(data, dict):
            read_version(data, BASELINE_VERSION)
        found = _Baseline.model_validate(data)
    except OSError as error:
        raise ScenarioError(f"{path}: cannot be read: {error.strerror}") from error
    except ValueError as error:
        why = format_validation_error(error) if isinstance(error, ValidationError) else " ".join(str(error).split())
        raise ScenarioError(f"{path}: not a baseline: {why}") from error
    if found.scenario not in (None, name):
        raise ScenarioError(f"{path}: not the baseline of {name} but of {show_value(repr(found.scenario))}")
    if scenario is None:
        return data["engines"]
    for field, value in _ride(scenario).items():
        if (came := getattr(found, field)) != value:
            raise ScenarioError(f"{path}: not a baseline of this ride: its {field} is {came!r}, not {value!r}")
    if found.content not in (None, gated_content(scenario)):
        raise ScenarioError(f"{path}: not the baseline of this {name}: its motion, ground or bicycle is another")
    return data["engines"]


def refused_verdicts(verdicts: Sequence[tuple[str, Verdict]]) -> list[tuple[str, Verdict]]:
    """Verdicts on engines that contradict themselves: no baseline is written of their run."""
    return [(name, verdict) for name, verdict in verdicts if verdict.quantity in ABSOLUTE and not verdict.passes]


def update_baselines(
    fresh: Mapping[str, Mapping[str, Any]],
    verdicts: Sequence[tuple[str, Verdict]],
    reason: str | None = None,
    baselines: Path | None = None,
) -> list[Path]:
    """Write new baselines, with why they were written, and return their paths.

    Engines that were not run, or that are refused (`refused_verdicts`), keep their entries, unless they are not
    installed any more.

    Parameters
    ----------
    fresh : mapping
    verdicts : sequence of (scenario, Verdict)
        What the run said of the old baselines.
    reason : str, optional
        In somebody's words; what moved if not given.
    baselines : Path, optional
        Folder, made if need be; the suite's own if not given.

    Raises
    ------
    ScenarioError
        If the folder cannot be made.
    """
    folder = BASELINES if baselines is None else baselines
    make_folder(folder)
    paths, there = [], installed_engines()
    out = {(scenario, verdict.engine) for scenario, verdict in refused_verdicts(verdicts)}
    for name, baseline in fresh.items():
        entries = {engine: entry for engine, entry in baseline["engines"].items() if (name, engine) not in out}
        if baseline["engines"] and not entries:
            continue
        moved = [verdict for scenario, verdict in verdicts if scenario == name and verdict.moved]
        kept = {engine: entry for engine, entry in read_baseline(name, folder).items() if engine in there}
        words = reason or "; ".join(f"{v.engine}: {v.quantity}: {v.status}" for v in moved) or "nothing moved"
        paths.append(folder / f"{name}.json")
        write_json(paths[-1], {**baseline, "reason": words, "engines": kept | entries})
    return paths
