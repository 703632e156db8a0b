"""`velodrome check`: run the gated scenarios in every engine and compare the results with the baselines."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache, partial
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from ...engines.engine import REFERENCE, Engine, Settings, UnsuitableProblem, why_failed
from ...engines.format_version import VERSION_KEY, read_version
from ...engines.guard import call_engine
from ...engines.registry import uninstalled_engines
from ...reference.inputs import NO_INPUTS
from ..error import ScenarioError
from ..files import make_folder, write_json
from ..run import RunWatch, Trace, configure_engine, installed_engines, library_versions, read_json
from ..scenario import (
    OF_THE_MOTION,
    EngineChoice,
    Gate,
    Scenario,
    Simulation,
    choose_engines,
    fits_engine,
    format_validation_error,
    join_complaints,
    library_names,
    load_scenario,
    make_start,
    read_toml,
    show_value,
)
from .exact import find_exact
from .given import GivenBaselines
from .sample import SHORT_HORIZON, take_sample
from .verdict import ABSOLUTE, CHANGES, NEW, Verdict, judge_sample, missing_verdict

BASELINES = Path(__file__).parent / "baselines"
GATED_TAG = "gated"
BASELINE_VERSION = 1
_SETTINGS = Path(__file__).parent / "gate.toml"


class _EngineEntry(BaseModel):
    """Baseline of one engine, with the fields that the gate needs; further fields are kept."""

    model_config = ConfigDict(strict=True, extra="allow", allow_inf_nan=False)

    created: str = ""
    version: str
    settings: dict[str, Any]
    step_noise: float | None = Field(default=None, ge=0)
    quantities: dict[str, float | None]


class _Baseline(BaseModel):
    """Baseline file of one scenario."""

    model_config = ConfigDict(strict=True, allow_inf_nan=False)

    scenario: str | None = None
    duration: float = Gate.model_fields["duration"].default
    output_rate: float = Gate.model_fields["output_rate"].default
    short_horizon: float = SHORT_HORIZON
    content: dict[str, Any] | None = None
    engines: dict[str, _EngineEntry]


Chosen = Callable[[str, Mapping[str, Any]], tuple[Engine, Settings]]


def gated_names() -> list[str]:
    """Return the names of the library's gated scenarios."""
    return [name for name in library_names() if GATED_TAG in load_scenario(name)[1].tags]


@cache
def gate_settings() -> dict[str, dict[str, Any]]:
    """Return the engines' settings on gated rides, by engine, used where a scenario sets no others."""
    return _read_gate_file()["engines"]


@cache
def gate_scenarios() -> dict[str, list[str]]:
    """Return the scenarios that engines with long rides ride where none is named, by engine; others ride all."""
    return _read_gate_file()["scenarios"]


def _read_gate_file() -> dict[str, Any]:
    return read_toml(_SETTINGS.read_text(encoding="utf-8"))


def list_left_out(baselines: Path | None = None, sources: Sequence[str] | None = None) -> dict[str, str]:
    """Return the engines that have a baseline and are not judged because their library is not installed.

    Parameters
    ----------
    baselines, sources
        As `check_gate` takes them.

    Returns
    -------
    dict of str to str
        The command that installs the library, by engine.
    """
    folder = BASELINES if baselines is None else baselines
    names = [load_gated(source)[0] for source in sources or gated_names()]
    stored = {engine for name in names for engine in read_baseline(name, folder)}
    return {engine: command for engine, command in uninstalled_engines().items() if engine in stored}


def list_unjudged_engines(given: GivenBaselines) -> list[str]:
    """Return the engines that the gate judges by the suite's own baselines, and not by given ones."""
    known = {name: read_baseline(name) for name in gated_names()}
    return [name for name in _engines_to_judge(None, known).names if name not in given.engines]


def check_gate(
    watch: RunWatch,
    sources: Sequence[str] | None = None,
    engines: Sequence[str] | None = None,
    baselines: Path | GivenBaselines | None = None,
    chosen: Chosen = configure_engine,
    trace: Trace | None = None,
    hold_cpu: bool = False,
) -> tuple[list[tuple[str, Verdict]], dict[str, dict[str, Any]]]:
    """Run the gate.

    Every engine gets a verdict on every scenario, except engines that were not asked for, have no baseline and do not
    suit the motion, and those whose rides are long: without named scenarios they ride those of `gate_scenarios` and
    those of which they have a baseline. An engine that exits, breaks or is not judged for any other reason counts as
    not run, and fails.

    Parameters
    ----------
    watch : callable
        Called with engine, time reached and duration.
    sources : sequence of str, optional
        Scenarios, by library name or path; the library's gated ones if not given.
    engines : sequence of str, optional
        Engines to judge, by name or pattern, or ``all``; those of the suite's own dependencies and all that have a
        baseline if not given.
    baselines : Path or GivenBaselines, optional
        Folder of the baselines, or baselines with the engines to judge by them; the suite's own if not given.
    chosen : callable
        Maps an engine's name and its settings in the scenario to the engine and its settings.
    trace : callable, optional
        Called with the name of an engine that broke and the exception.
    hold_cpu : bool
        Whether to judge also an engine's CPU time relative to the reference's.

    Returns
    -------
    verdicts : list of (scenario, Verdict)
    fresh : dict
        Baseline of every scenario as this run would write it.

    Raises
    ------
    ScenarioError
        If a scenario or a baseline is invalid, or an engine is neither installed nor in a baseline.
    """
    scenarios = [load_gated(source) for source in (sources or gated_names())]
    reasons: Mapping[str, Mapping[str, str]] = {}
    known: dict[str, Mapping[str, Any]]
    if isinstance(baselines, GivenBaselines):
        known = {name: baselines.entries.get(name, {}) for name, _ in scenarios}
        choice = EngineChoice(baselines.engines, choose_engines(engines)[0].named & {*baselines.engines})
        reasons = baselines.reasons
    else:
        known = {name: read_baseline(name, baselines, scenario) for name, scenario in scenarios}
        choice = _engines_to_judge(engines, known)
    verdicts: list[tuple[str, Verdict]] = []
    fresh: dict[str, dict[str, Any]] = {}
    for name, scenario in scenarios:
        riding = choice if sources else _choose_for_scenario(choice, name, known[name])
        results = _judge_scenario(
            name, scenario, riding, known[name], reasons.get(name, {}), watch, chosen, trace, hold_cpu
        )
        verdicts += [(name, verdict) for verdict in [*results.verdicts, *_missing_verdicts(riding.names, results)]]
        fresh[name] = {
            VERSION_KEY: BASELINE_VERSION,
            "scenario": name,
            **_ride_parameters(scenario),
            "content": gated_content(scenario),
            "libraries": library_versions(),
            "exact_error": results.exact_error,
            "engines": results.entries,
        }
    if not verdicts:
        raise ScenarioError("nothing was judged: none of the engines suits any of the scenarios")
    return verdicts, fresh


def read_baselines(
    baselines: Path | GivenBaselines | None = None, sources: Sequence[str] | None = None
) -> Mapping[str, Mapping[str, Any]]:
    """Return the entries of baselines by scenario and engine; the arguments are those of `check_gate`."""
    if isinstance(baselines, GivenBaselines):
        return baselines.entries
    names = [load_gated(source)[0] for source in sources or gated_names()]
    return {name: read_baseline(name, baselines) for name in names}


def list_bicycle_warnings(sources: Sequence[str] | None = None) -> dict[str, list[str]]:
    """Return the warnings about the bicycles of gated scenarios, by the name of the scenario.

    Parameters
    ----------
    sources : sequence of str, optional
        As `check_gate` takes them.

    Returns
    -------
    dict
        Without scenarios whose bicycle is not remarkable.
    """
    loaded = (load_gated(source) for source in (sources or gated_names()))
    found = {name: list(scenario.make_bicycle().warnings()) for name, scenario in loaded}
    return {name: lines for name, lines in found.items() if lines}


def load_gated(source: str) -> tuple[str, Scenario]:
    """Return the name of a scenario, and the scenario with the duration and output rate of the gate."""
    name, scenario = load_scenario(source)
    gate = scenario.gate or Gate()
    simulation = Simulation(duration=gate.duration, output_rate=gate.output_rate)
    return name, scenario.model_copy(update={"gate": gate, "simulation": simulation})


def _ride_parameters(scenario: Scenario) -> dict[str, float]:
    """Return the parameters of a gated ride for which a baseline is valid."""
    simulation = scenario.simulation
    return {
        "duration": simulation.duration,
        "output_rate": simulation.output_rate,
        "short_horizon": SHORT_HORIZON,
    }


def _engines_to_judge(wanted: Sequence[str] | None, known: Mapping[str, Mapping[str, Any]]) -> EngineChoice:
    """Choose the engines to judge.

    Without a wish they are those of the suite's own dependencies and all that have a baseline. An engine that has a
    baseline and is not announced any more is judged too, and fails; one whose library alone is missing is not.
    """
    choice, faults = choose_engines(wanted)
    stored = sorted({name for entries in known.values() for name in entries} - uninstalled_engines().keys())
    if not wanted:
        return EngineChoice(tuple(dict.fromkeys([*choice.names, *stored])), frozenset())
    unknown = [fault for entry, fault in faults.items() if entry not in stored]
    if unknown:
        raise ScenarioError(join_complaints(unknown))
    gone = [entry for entry in faults if entry in stored]
    # The reference is judged only where it is chosen.
    chosen = [name for name in choice.names if name != REFERENCE or any(fits_engine(entry, name) for entry in wanted)]
    return EngineChoice((*chosen, *gone), choice.named | {*gone})


def _choose_for_scenario(choice: EngineChoice, scenario: str, baseline: Mapping[str, Any]) -> EngineChoice:
    """Return the chosen engines without those that have long rides and do not ride this scenario."""
    riding = [name for name in choice.names if scenario in gate_scenarios().get(name, [scenario]) or name in baseline]
    return EngineChoice(tuple(riding), choice.named)


@dataclass(frozen=True)
class _ScenarioResults:
    """Results of all engines on one scenario.

    Attributes
    ----------
    verdicts : list of Verdict
    entries : dict
        Entries of a new baseline, by engine.
    passed_over : list of str
        Engines that were not judged because the motion does not suit them.
    exact_error : float
        Error of the exact ride itself, see `velodrome.scenarios.gate.exact.Exact`.
    """

    verdicts: list[Verdict]
    entries: dict[str, Any]
    passed_over: list[str]
    exact_error: float


def _judge_scenario(
    name: str,
    scenario: Scenario,
    engines: EngineChoice,
    baseline: Mapping[str, Any],
    absent: Mapping[str, str],
    watch: RunWatch,
    chosen: Chosen,
    trace: Trace | None,
    hold_cpu: bool,
) -> _ScenarioResults:
    """Judge the engines on one scenario against the baseline.

    An engine that the motion does not suit is passed over, unless it was named or has a baseline. ``absent`` says, by
    engine, why there is no baseline where one was to be.
    """
    start = make_start(scenario)
    try:
        exact = find_exact(start)
    except ScenarioError as error:
        raise ScenarioError(f"{name}: {error}") from error
    results = _ScenarioResults([], {}, [], exact.error)
    for engine_name in engines.names:
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
                watch=partial(_report_progress, watch, engine_name, scenario.simulation.duration),
                known_noise=(entry or {}).get("step_noise"),
                hold_cpu=hold_cpu,
            )
        except Exception as error:  # an engine that raises anything counts as not run
            if entry is None and engine_name not in engines.named and isinstance(error, UnsuitableProblem):
                results.passed_over.append(engine_name)
                continue
            own_words = isinstance(error, ScenarioError | UnsuitableProblem)
            why = " ".join(str(error).split()) if own_words else why_failed(error)
            results.verdicts.append(missing_verdict(engine_name, f"did not run: {why}"))
            if trace is not None:
                trace(engine_name, error)
            continue
        results.entries[engine_name] = {
            "created": datetime.now(UTC).date().isoformat(),
            "version": found.version,
            "settings": found.settings,
            "steps": found.steps,
            "step_noise": found.step_noise,
            "quantities": found.values,
        }
        verdicts = judge_sample(
            engine_name,
            found.values,
            entry,
            found.limits,
            found.settings,
            found.version,
            found.reasons,
            absent.get(engine_name),
        )
        results.verdicts.extend(verdicts)
    return results


def _report_progress(watch: RunWatch, engine: str, duration: float, time: float) -> None:
    watch(engine, time, duration)


def _missing_verdicts(engines: Sequence[str], results: _ScenarioResults) -> list[Verdict]:
    """Return failing verdicts on the engines that should have been judged and were not."""
    judged = {verdict.engine for verdict in results.verdicts if verdict.quantity != CHANGES}
    expected = [name for name in engines if name not in results.passed_over]
    return [
        missing_verdict(name, "did not run: none of its quantities was judged")
        for name in expected
        if name not in judged
    ]


def gated_content(scenario: Scenario) -> dict[str, Any]:
    """Return the parts of a scenario that determine its motion, as JSON values.

    Inputs are left out if all are zero, as baselines of earlier versions have none.
    """
    content = scenario.model_dump(mode="json", exclude_none=True, include={*OF_THE_MOTION})
    if scenario.make_inputs() == NO_INPUTS:
        del content["inputs"]
    return content


def read_baseline(name: str, folder: Path | None = None, scenario: Scenario | None = None) -> dict[str, Any]:
    """Return the committed entries of a scenario, by engine; empty where there is no baseline.

    Parameters
    ----------
    name : str
        Name of the scenario.
    folder : Path, optional
    scenario : Scenario, optional
        The scenario as the gate runs it: the baseline must be of the same ride of the same motion.

    Raises
    ------
    ScenarioError
        If the file is damaged, of another scenario, or of another ride.
    """
    within = BASELINES if folder is None else folder
    path = within / f"{name}.json"
    if within.exists() and not within.is_dir():
        raise ScenarioError(f"{within}: is not a folder of baselines")
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
    for field, expected in _ride_parameters(scenario).items():
        if (value := getattr(found, field)) != expected:
            raise ScenarioError(f"{path}: not a baseline of this ride: its {field} is {value!r}, not {expected!r}")
    if found.content not in (None, gated_content(scenario)):
        raise ScenarioError(f"{path}: not the baseline of this {name}: its motion, ground or bicycle is another")
    return data["engines"]


def refused_verdicts(verdicts: Sequence[tuple[str, Verdict]]) -> list[tuple[str, Verdict]]:
    """Return the verdicts on engines that contradict themselves, whose runs are not written to baselines."""
    return [(name, verdict) for name, verdict in verdicts if verdict.quantity in ABSOLUTE and not verdict.passes]


def update_baselines(
    fresh: Mapping[str, Mapping[str, Any]],
    verdicts: Sequence[tuple[str, Verdict]],
    reason: str | None = None,
    baselines: Path | None = None,
) -> list[Path]:
    """Write new baselines with the reason for the change, and return the paths of the files that changed.

    An engine's entry is written if it is new, a judged quantity moved beyond its limit, or the engine's version or
    settings changed. Every other entry stays as it is, those of engines that were not run or are refused
    (`refused_verdicts`) included; entries of engines that are not announced any more are removed. CPU times that were
    not judged are no reason to write an entry. A file in which no entry changes is not touched.

    Parameters
    ----------
    fresh : mapping
    verdicts : sequence of (scenario, Verdict)
        Verdicts of the run against the old baselines.
    reason : str, optional
        Why the baselines are written; a list of what moved if not given.
    baselines : Path, optional
        Folder, created if needed; the suite's own if not given.

    Raises
    ------
    ScenarioError
        If the folder cannot be created.
    """
    folder = BASELINES if baselines is None else baselines
    make_folder(folder)
    paths: list[Path] = []
    installed = [*installed_engines(), *uninstalled_engines()]
    refused = {(scenario, verdict.engine) for scenario, verdict in refused_verdicts(verdicts)}
    for name, baseline in fresh.items():
        entries = {engine: entry for engine, entry in baseline["engines"].items() if (name, engine) not in refused}
        if baseline["engines"] and not entries:
            continue
        old = read_baseline(name, folder)
        kept = {engine: entry for engine, entry in old.items() if engine in installed}
        told = [verdict for scenario, verdict in verdicts if scenario == name and verdict.told]
        changed = {verdict.engine for verdict in told}
        renewed = {engine: entry for engine, entry in entries.items() if engine in changed or engine not in old}
        if not renewed and kept == old:
            continue
        gone = [f"{engine}: not installed any more" for engine in old if engine not in kept]
        words = reason or "; ".join([_describe_move(verdict) for verdict in told] + gone)
        paths.append(folder / f"{name}.json")
        write_json(paths[-1], {**baseline, "reason": words, "engines": kept | renewed})
    return paths


def _describe_move(verdict: Verdict) -> str:
    """Return the words for what a verdict reports: a new engine, a move, or a change of version or settings."""
    if verdict.status == NEW:
        return f"{verdict.engine}: new"
    what = verdict.reason if verdict.quantity == CHANGES else f"{verdict.quantity}: {verdict.status}"
    return f"{verdict.engine}: {what}"
