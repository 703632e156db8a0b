"""From a sweep file to its tasks: everything bad input could break is found before anything runs."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from engines.engine import REFERENCE, UnsuitableProblem, load_engine
from scenarios.error import ScenarioError
from scenarios.installed import installed
from scenarios.run_folder import library_versions
from scenarios.runner import configure
from scenarios.scenario import Scenario, validate
from scenarios.start import make_start
from scenarios.table import placed

from .file import SweepFile, read_sweep
from .points import count, points

MOST = 5_000_000  # tasks; some 2 GB in the planning process
_CHECKED = 50  # kinds of runs whose engine is asked beforehand; each may need a motion, a tenth of a second


@dataclass(frozen=True)
class Task:
    """One run: an engine at a point.

    Attributes
    ----------
    index : int
        Place in the sweep.
    key : str
        Index and hash of the resolved run.
    engine : str
    changes : dict
        Dotted key to value, of those that concern this engine.
    """

    index: int
    key: str
    engine: str
    changes: dict[str, Any]


@dataclass(frozen=True)
class Plan:
    """A sweep that has been checked.

    Attributes
    ----------
    name : str
    path : Path
        The sweep file.
    file : SweepFile
    base : dict
        The base scenario as resolved.
    tasks : list of Task
    """

    name: str
    path: Path
    file: SweepFile
    base: dict[str, Any]
    tasks: list[Task]

    def facts(self) -> dict[str, Any]:
        """What must be the same for rows of two sessions to belong to one data set."""
        digest = hashlib.sha256()
        for task in self.tasks:
            digest.update(f"{task.key} {task.engine}\n".encode())
        digest.update(repr((self.file.time_limit, self.file.memory_limit)).encode())
        return {
            "tasks": len(self.tasks),
            "hash": digest.hexdigest(),
            "engines": {name: load_engine(name).version for name in self.file.engines},
            "libraries": library_versions(),
        }


def plan_sweep(path: Path) -> Plan:
    """Read a sweep file, validate every run of it, number them.

    Settings of one engine do not multiply the runs of another: runs that come out the same are one task.

    Raises
    ------
    ScenarioError
        With one line.
    """
    sweep, base = read_sweep(path)
    names = installed()
    for engine in sweep.engines:
        if engine not in names:
            raise ScenarioError(f"{path}: engine {engine!r} is not installed; there are {', '.join(names)}")
    if count(sweep) * len(sweep.engines) > MOST:
        raise ScenarioError(f"{path}: {count(sweep) * len(sweep.engines)} runs; at most {MOST} fit one sweep")
    checker = _Checker(path)
    tasks: list[Task] = []
    seen: set[tuple[str, str]] = set()
    for changes in points(sweep):
        _refuse_other_engines(path, sweep, changes)
        for engine in sweep.engines:
            own = concerning(engine, changes)
            digest = checker.resolved(engine, base, own)
            if (engine, digest) not in seen:
                seen.add((engine, digest))
                tasks.append(Task(len(tasks), f"{len(tasks):07d}-{digest[:12]}", engine, own))
    return Plan(path.stem, path, sweep, base, tasks)


def concerning(engine: str, changes: Mapping[str, Any]) -> dict[str, Any]:
    """Changes without the settings of other engines; the reference's concern all, who are held against it."""
    return {key: value for key, value in changes.items() if _engine_of(key) in (None, engine, REFERENCE)}


def pruned(data: dict[str, Any], engine: str) -> dict[str, Any]:
    """A scenario's data with the settings of this engine and the reference only."""
    engines = data.get("engines", {})
    if not isinstance(engines, Mapping):
        return data
    return data | {"engines": {name: engines[name] for name in (REFERENCE, engine) if name in engines}}


def _engine_of(key: str) -> str | None:
    table, _, rest = key.partition(".")
    return rest.partition(".")[0] if table == "engines" else None


def _refuse_other_engines(path: Path, sweep: SweepFile, changes: Mapping[str, Any]) -> None:
    for key in changes:
        engine = _engine_of(key)
        if engine is not None and engine not in (*sweep.engines, REFERENCE):
            raise ScenarioError(f"{path}: {key}: {engine!r} is not among the sweep's engines")


class _Checker:
    """Validates runs, each part once."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._settings: set[str] = set()
        self._kinds: set[str] = set()

    def resolved(self, engine: str, base: dict[str, Any], changes: Mapping[str, Any]) -> str:
        """Validate a run and return the hash of what it is resolved to."""
        where = str(self._path)
        if changes:
            where += ": at " + ", ".join(f"{key} = {value!r}" for key, value in changes.items())
        try:
            scenario = validate(pruned(placed(base, changes), engine), where)
        except ScenarioError:
            raise
        except ValueError as error:
            raise ScenarioError(f"{where}: {error}") from error
        data = scenario.model_dump(mode="json", exclude_none=True)
        for name in {engine, REFERENCE}:
            self._configure(where, name, data["engines"].get(name, {}))
        self._ask(where, engine, scenario, data)
        return hashlib.sha256(canonical([engine, data]).encode()).hexdigest()

    def _configure(self, where: str, engine: str, settings: dict[str, Any]) -> None:
        text = canonical([engine, settings])
        if text not in self._settings:
            try:
                configure(engine, settings)
            except ScenarioError as error:
                raise ScenarioError(f"{where}: {error}") from error
            self._settings.add(text)

    def _ask(self, where: str, engine: str, scenario: Scenario, data: Mapping[str, Any]) -> None:
        """Let the engine refuse a step that does not divide the output interval, and the like."""
        kind = canonical([engine, data["engines"].get(engine, {}), data["simulation"]])
        if kind in self._kinds or len(self._kinds) >= _CHECKED:
            return
        self._kinds.add(kind)
        try:
            problem = make_start(scenario).problem
        except ScenarioError:
            return  # a motion that does not exist is a row
        library, settings = configure(engine, scenario.engines.get(engine, {}))
        try:
            library.check(problem, settings)
        except UnsuitableProblem:
            return  # so is ground that the engine does not know
        except ValueError as error:
            raise ScenarioError(f"{where}: engines.{engine}: {error}") from error


def canonical(data: Any) -> str:
    """JSON of which there is one for equal data."""
    return json.dumps(data, sort_keys=True, separators=(",", ":"), allow_nan=False)
