"""Comparison of two stored run folders, as `velodrome diff` makes it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from textwrap import shorten
from typing import Any

import numpy as np

from ...engines.engine import REFERENCE, Trajectory, why_failed
from ...engines.names import suggest_name
from ...engines.registry import load_engine
from ...reports.drawing import assign_colours, find_unsteadiness
from ...reports.measure import ROUND_OFF, START_ERROR, Scale, cut_at_fall, evaluate_ride, position_errors
from ..error import ScenarioError
from ..files import make_folder, write_json, write_text
from ..run import (
    configure_engine,
    installed_engines,
    read_document,
    read_ride,
    read_start_state,
    read_stored_scenario,
)
from ..scenario import OF_THE_MOTION, CircularTable, Scenario, make_start
from .differences import DIFFERS, TO_THE_BIT, StoredGround, StoredRun, diff_document
from .markdown import diff_markdown, diff_remarks, diff_summary, diff_verdict
from .reasons import format_value


@dataclass(frozen=True)
class Pair:
    """Two runs of one scenario from one start.

    Attributes
    ----------
    scenario : Scenario
    before, after : StoredRun
    ground : StoredGround
    """

    scenario: Scenario
    before: StoredRun
    after: StoredRun
    ground: StoredGround

    @cached_property
    def followed(self) -> list[dict[str, Trajectory]]:
        """What follows from the coordinates of both runs' rides, by engine, up to their falls."""
        where = self.ground.bicycle, self.ground.surface
        return [
            {name: cut_at_fall(evaluate_ride(ride, *where), *where) for name, ride in run.trajectories.items()}
            for run in (self.before, self.after)
        ]


def read_pair(first: Path, second: Path, engines: Sequence[str] | None = None) -> Pair:
    """Read two run folders that can be compared.

    Parameters
    ----------
    first, second : Path
        The earlier run and the later one.
    engines : sequence of str, optional
        Names of the engines to compare, besides the reference; all if not given.

    Raises
    ------
    ScenarioError
        If a folder is not a run folder, or they differ in scenario, output times or start, or share no engine.
    """
    names = (first.resolve().name, second.resolve().name)
    if names[0] == names[1]:
        names = (str(first), str(second))
    manifests = [read_document(folder, "manifest.json") for folder in (first, second)]
    scenarios = [read_stored_scenario(*pair) for pair in zip((first, second), manifests, strict=True)]
    _same_scenario(scenarios[0], scenarios[1], first, second)
    runs = [
        _read(folder, name, manifest, engines)
        for folder, name, manifest in zip((first, second), names, manifests, strict=True)
    ]
    _same_start(runs[0], runs[1], first, second)
    common = [name for name in runs[1].manifest["engines"] if name in runs[0].manifest["engines"]]
    if not common:
        raise ScenarioError(f"{first} and {second} have no engine in common")
    for engine in engines or []:
        if engine not in common:
            raise ScenarioError(f"engine {engine!r} is not in both runs ({suggest_name(engine, common)})")
    return Pair(scenarios[1], runs[0], runs[1], _ground(scenarios[1], runs[1]))


def _same_scenario(before: Scenario, after: Scenario, first: Path, second: Path) -> None:
    for name in (*OF_THE_MOTION, "simulation"):
        tables = [_dump_table(scenario, name) for scenario in (before, after)]
        for key in dict.fromkeys(table_key for table in tables for table_key in table):
            values = [table.get(key) for table in tables]
            if values[0] != values[1]:
                what = "different output times" if name == "simulation" else "different scenarios"
                # A height field has thousands of numbers.
                said = " against ".join(shorten(repr(value), 60, placeholder=" ...") for value in values)
                raise ScenarioError(f"{first} and {second}: {what}: {name}.{key} {said}")


def _dump_table(scenario: Scenario, name: str) -> dict[str, Any]:
    """A table of a scenario; the bicycle's with all parameters, which folders of earlier versions do not state."""
    return asdict(scenario.make_bicycle()) if name == "bicycle" else scenario.model_dump(include={name})[name]


def _read(folder: Path, name: str, manifest: Mapping[str, Any], engines: Sequence[str] | None) -> StoredRun:
    metrics = read_document(folder, "metrics.json")
    try:
        entries = {engine: manifest["engines"][engine] for engine in manifest["engines"] if _chosen(engine, engines)}
        _ = [manifest[key] for key in ("title", "scenario", "created", "complete", "libraries", "platform")]
        _ = [(entry["version"], dict(entry["settings"])) for entry in entries.values()]
        _ = [float(manifest["start"]["growth_rate"]), *read_start_state(manifest)]
        rides = {engine: read_ride(folder, manifest, metrics, engine) for engine in entries if engine in metrics}
    except ScenarioError:
        raise
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        # A ValueError has a sentence; the others have a single word, which says little without the error's type.
        kind = "" if isinstance(error, ValueError) else f"{type(error).__name__}: "
        raise ScenarioError(f"{folder}: not the files of one run: {kind}{error}") from error
    return StoredRun(name, {**manifest, "engines": entries}, metrics, rides)


def _chosen(engine: str, engines: Sequence[str] | None) -> bool:
    return not engines or engine == REFERENCE or engine in engines


def _same_start(before: StoredRun, after: StoredRun, first: Path, second: Path) -> None:
    for a, b, what in zip(
        read_start_state(before.manifest), read_start_state(after.manifest), ("coordinates", "rates"), strict=True
    ):
        apart = np.abs(b - a)
        # Each start is a root known to this accuracy; the stored numbers do not show which of them is right.
        if np.any(apart > START_ERROR * (1 + np.abs(a))):
            raise ScenarioError(
                f"{first} and {second}: different starts: {what} differ by up to {apart.max():.2g}; "
                "they were computed by different versions of the suite, or on other data"
            )
    for engine in set(before.trajectories) & set(after.trajectories):
        times = [run.trajectories[engine].time for run in (before, after)]
        samples = min(len(time) for time in times)
        if not np.array_equal(times[0][:samples], times[1][:samples]):
            raise ScenarioError(f"{first} and {second}: different output times of {engine}")


def _ground(scenario: Scenario, run: StoredRun) -> StoredGround:
    bicycle, (q, qd) = scenario.make_bicycle(), read_start_state(run.manifest)
    circular = isinstance(scenario.motion, CircularTable)
    radius = float(np.hypot(q[0], q[1])) if circular else bicycle.wheelbase
    growth_rate = float(run.manifest["start"]["growth_rate"])
    scale = Scale.of(bicycle, qd, radius, growth_rate, scenario.simulation.duration)
    return StoredGround(bicycle, scenario.surface.make(), scale)


def diff_runs(pair: Pair) -> dict[str, Any]:
    """Return the JSON document of `velodrome diff`; ``notes`` say where a limit does not come from the engine."""
    noises, notes = {}, []
    for name, entry in pair.after.manifest["engines"].items():
        if name not in pair.before.manifest["engines"]:
            continue
        settings = [pair.before.manifest["engines"][name]["settings"], entry["settings"]]
        known = [_step_noise(name, values) for values in settings]
        reasons = dict.fromkeys(value for value in known if isinstance(value, str))
        notes += [f"{name} {reason}; its steps are allowed round-off only" for reason in reasons]
        noises[name] = max(ROUND_OFF if isinstance(value, str) else value for value in known)
    return diff_document(pair.before, pair.after, pair.ground, noises) | {"notes": notes}


def _step_noise(name: str, settings: Mapping[str, Any]) -> float | str:
    """Return the relative error that a step of an engine may add, or why the installed engine cannot say it."""
    if name not in installed_engines():
        return "is not installed here"
    try:
        load_engine(name)
        engine, chosen = configure_engine(name, settings)
        return float(engine.step_noise(chosen))
    except ScenarioError:
        return "is not installed here with such settings"
    except Exception as error:  # another package's code may raise anything
        return f"cannot be asked here: {why_failed(error)}"


def write_diff(pair: Pair, found: Mapping[str, Any], out: Path) -> list[Path]:
    """Write ``diff.json``, ``diff.md``, the page ``diff.html`` and the recording ``diff.rrd``, and return their paths.

    Raises
    ------
    ScenarioError
        If the folder cannot be made.
    """
    make_folder(out)
    paths = [out / name for name in ("diff.json", "diff.md", "diff.html", "diff.rrd")]
    write_json(paths[0], found)
    write_text(paths[1], diff_markdown(found))
    write_text(paths[2], _make_page(pair, found))
    if not pair.before.trajectories and not pair.after.trajectories:
        return paths[:3]
    record_pair(paths[3], pair, found)
    return paths


def _make_page(pair: Pair, found: Mapping[str, Any]) -> str:
    """Write the page of two runs, with the distances of their rides over time."""
    from ...reports.page import describe_stop, make_diff_page

    distances, stops = {}, {}
    for engine in found["engines"]:
        before, after = (rides.get(engine) for rides in pair.followed)
        if before is None or after is None:
            continue
        apart = position_errors(after, before)
        distances[engine] = after.time[: len(apart)], apart
        told = {
            when: stop
            for when, run, ride in (("before", pair.before, before), ("after", pair.after, after))
            if (stop := describe_stop(run.metrics[engine], float(ride.time[-1])))
        }
        if told:
            both = len(told) == 2 and len(set(told.values())) == 1
            stops[engine] = told["after"] if both else ", ".join(f"{when}: {stop}" for when, stop in told.items())
    remarks = {engine: diff_remarks(entry) for engine, entry in found["engines"].items()}
    machine = {part: pair.after.manifest[part] for part in ("libraries", "platform")}
    return make_diff_page(found, distances, remarks, stops, machine)


def record_pair(path: Path, pair: Pair, found: Mapping[str, Any]) -> str | None:
    """Write the recording of two runs, with both rides of every engine; one that is the same to the bit once.

    Parameters
    ----------
    path : Path
    pair : Pair
    found : mapping
        Document of `diff_runs`.

    Returns
    -------
    str or None
        What the recording leaves out; None if it holds every sample.

    Raises
    ------
    ScenarioError
        If no engine of both runs has a ride.
    """
    # Imported here: rerun takes a second to load.
    from ...reports.recording import brighten, write_recording

    ground, hues = pair.ground, assign_colours(found["engines"])
    rides: dict[str, Trajectory] = {}
    paint, earlier = {}, {}
    for engine, entry in found["engines"].items():
        labels = _label_rides(engine, entry)
        # The later run has the engine's own colour, the earlier one a pale one.
        for followed, label, hue in zip(pair.followed, labels, (brighten(hues[engine]), hues[engine]), strict=True):
            if engine in followed:
                rides[label] = followed[engine]
                paint[label] = hue
        if labels[0] != labels[1] and all(label in rides for label in labels):
            earlier[labels[1]] = labels[0]
    if not rides:
        raise ScenarioError(f"{pair.before.name} and {pair.after.name}: no engine of both runs has a ride to show")
    inputs, circular = pair.scenario.make_inputs(), isinstance(pair.scenario.motion, CircularTable)
    steady = find_unsteadiness(ground.surface, inputs, circular) is None
    return write_recording(
        path,
        f"{pair.scenario.title}: {pair.before.name} against {pair.after.name}",
        ground.bicycle,
        ground.surface,
        rides,
        diff_verdict(found),
        diff_summary(found),
        undisturbed=make_start(pair.scenario).undisturbed if steady else None,
        before=earlier,
        paint=paint,
        inputs=inputs,
    )


_MOST_MARKS = 2  # settings in a label


def _label_rides(engine: str, entry: Mapping[str, Any]) -> tuple[str, str]:
    """Name an engine's rides in both runs by what tells them apart: versions, settings, or the runs.

    A ride that is the same to the bit is named once, and so is a reference that is the same within round-off, since the
    other engines are compared with it.
    """
    if entry["verdict"] == TO_THE_BIT or (engine == REFERENCE and entry["verdict"] != DIFFERS):
        return engine, engine
    before, after = entry["version"]
    if before != after:
        return f"{engine} @ {before}", f"{engine} @ {after}"
    settings = list(entry["settings"].items())
    if 0 < len(settings) <= _MOST_MARKS:
        marks = (", ".join(f"{name} {format_value(pair[k])}" for name, pair in settings) for k in (0, 1))
        first, second = (f"{engine} @ {mark}" for mark in marks)
        return first, second
    return f"{engine} @ before", f"{engine} @ after"
