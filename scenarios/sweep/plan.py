"""From a sweep file to its tasks; all bad input is found before anything runs."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from ...engines.engine import REFERENCE, UnsuitableProblem, load_engine
from ..error import ScenarioError
from ..run import configure_engine, installed_engines, library_versions
from ..scenario import Scenario, UnknownName, format_validation_error, list_kinds, make_start, place_error
from .file import SweepFile, read_sweep
from .points import count_points, make_points

MOST_TASKS = 5_000_000  # tasks; about 2 GB in the planning process
# Types of pydantic's errors that a value of the right type may have.
_OF_A_POINT = ("value_error", "greater_than", "greater_than_equal", "less_than", "less_than_equal", "finite_number")
_CHECKED = 50  # kinds of runs whose engine is asked beforehand; each may need a motion, a tenth of a second


@dataclass(frozen=True)
class Task:
    """One run: an engine at a point.

    Attributes
    ----------
    index : int
        Index in the sweep.
    key : str
        Index and hash of the resolved run.
    engine : str
    changes : dict
        Values by dotted key, of the changes that concern this engine.
    refused : str or None
        Why this point cannot be run; None if it can.
    """

    index: int
    key: str
    engine: str
    changes: dict[str, Any]
    refused: str | None = None


@dataclass(frozen=True)
class SweepPlan:
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
        """Return what must be the same for rows of two sessions to belong to one data set."""
        digest = hashlib.sha256()
        for task in self.tasks:
            digest.update(f"{task.key} {task.engine}\n".encode())
        return {
            "tasks": len(self.tasks),
            "hash": digest.hexdigest(),
            "engines": {name: load_engine(name).version for name in self.file.engines},
            "libraries": library_versions(),
        }


def plan_sweep(path: Path) -> SweepPlan:
    """Read a sweep file, validate all its runs and number them.

    Settings of one engine do not multiply the runs of another: equal runs are one task. An impossible point, such as a
    drawn inertia that no rigid body has, becomes a task that is refused.

    Raises
    ------
    ScenarioError
        If the file is wrong, in one line: an unknown name, a stated value that is impossible, or only points that
        are refused.
    """
    sweep, base = read_sweep(path)
    names = installed_engines()
    for engine in sweep.engines:
        if engine not in names:
            raise ScenarioError(f"{path}: engine {engine!r} is not installed; there are {', '.join(names)}")
    if count_points(sweep) * len(sweep.engines) > MOST_TASKS:
        raise ScenarioError(
            f"{path}: {count_points(sweep) * len(sweep.engines)} runs; at most {MOST_TASKS} fit one sweep"
        )
    checker = _Checker(path, base, drawn=sweep.latin_hypercube.ranges if sweep.latin_hypercube else ())
    tasks: list[Task] = []
    seen: set[tuple[str, str]] = set()
    for changes in make_points(sweep):
        _refuse_other_engines(path, sweep, changes)
        for engine in sweep.engines:
            own = concerning(engine, changes)
            digest, refused = checker.resolve(engine, own)
            if (engine, digest) not in seen:
                seen.add((engine, digest))
                tasks.append(Task(len(tasks), f"{len(tasks):07d}-{digest[:12]}", engine, own, refused))
    for engine in sweep.engines:
        if all(task.refused for task in tasks if task.engine == engine):
            raise ScenarioError(checker.first_refusal[engine])
    return SweepPlan(path.stem, path, sweep, base, tasks)


def concerning(engine: str, changes: Mapping[str, Any]) -> dict[str, Any]:
    """Select the changes without settings of other engines; the reference's concern all, which are compared with it."""
    return {key: value for key, value in changes.items() if _engine_of(key) in (None, engine, REFERENCE)}


def prune_settings(data: dict[str, Any], engine: str) -> dict[str, Any]:
    """Return a scenario's data with the settings of this engine and the reference only."""
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


class _FileError(ScenarioError):
    """What is wrong with the file itself, not with a point of it."""


class _Checker:
    """Validate runs, each part only once.

    Parameters
    ----------
    path : Path
    base : dict
        The base scenario as resolved.
    drawn : collection of str
        Dotted keys of values that are not in the file but drawn.
    """

    def __init__(self, path: Path, base: dict[str, Any], drawn: Collection[str]) -> None:
        self._path, self._base, self._drawn = path, base, drawn
        self._settings: set[str] = set()
        self._kinds: dict[str, str | None] = {}
        self.first_refusal: dict[str, str] = {}

    def resolve(self, engine: str, changes: Mapping[str, Any]) -> tuple[str, str | None]:
        """Validate a run; return the hash of the resolved run, and why it is refused, or None if it is not.

        Raises
        ------
        ScenarioError
            If the file is wrong.
        """
        try:
            data = prune_settings(place_error(self._base, changes), engine)
        except ValueError as error:
            raise ScenarioError(f"{self._where(changes)}: {error}") from error
        refused = None
        try:
            data = self._resolved(engine, data, changes)
        except ScenarioError as error:
            line = f"{self._where(changes)}: {error}"
            if isinstance(error, _FileError):
                raise ScenarioError(line) from error
            self.first_refusal.setdefault(engine, line)
            refused = str(error)
        return hashlib.sha256(canonical_text([engine, data]).encode()).hexdigest(), refused

    def _where(self, changes: Mapping[str, Any]) -> str:
        at = ", ".join(f"{key} = {value!r}" for key, value in changes.items())
        return f"{self._path}: at {at}" if at else str(self._path)

    def _resolved(self, engine: str, data: dict[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
        stated = [key for key in changes if key not in self._drawn]
        try:
            scenario = Scenario.model_validate(data)
        except ValidationError as error:
            raise _complaint(format_validation_error(error), error, stated) from error
        resolved = scenario.model_dump(mode="json", exclude_none=True)
        for name in {engine, REFERENCE}:
            self._configure(name, resolved["engines"].get(name, {}), stated)
        self._ask(engine, scenario, resolved)
        return resolved

    def _configure(self, engine: str, settings: dict[str, Any], stated: Collection[str]) -> None:
        text = canonical_text([engine, settings])
        if text not in self._settings:
            try:
                configure_engine(engine, settings)
            except ScenarioError as error:
                raise _complaint(str(error), error.__cause__, stated, ("engines", engine)) from error
            self._settings.add(text)

    def _ask(self, engine: str, scenario: Scenario, data: Mapping[str, Any]) -> None:
        """Raise what the engine refuses, such as a step that does not divide the output interval."""
        kind = canonical_text([engine, data["engines"].get(engine, {}), data["simulation"]])
        if kind not in self._kinds and len(self._kinds) < _CHECKED:
            self._kinds[kind] = _why_refused(engine, scenario)
        if refused := self._kinds.get(kind):
            raise ScenarioError(refused)


def _why_refused(engine: str, scenario: Scenario) -> str | None:
    """Return why an engine refuses a run, None if it does not; errors that only the run can show do not count."""
    try:
        problem = make_start(scenario).problem
    except ScenarioError:
        return None  # a motion that does not exist becomes a row
    library, settings = configure_engine(engine, scenario.engines.get(engine, {}))
    try:
        library.check(problem, settings)
    except UnsuitableProblem:
        return None  # so does ground that is unsuitable for the engine
    except ValueError as error:
        return f"engines.{engine}: {error}"
    except Exception:
        return None  # and an engine that breaks
    return None


def _complaint(
    line: str, cause: BaseException | None, stated: Collection[str], place: tuple[str, ...] = ()
) -> ScenarioError:
    """Tell what is wrong with the file from what is wrong with a point.

    Of a point are values that do not go together, and a drawn value out of its range. Of the file are names that are
    none, values of another type, and values out of range that the file itself states.
    """
    if not isinstance(cause, ValidationError):
        return _FileError(line)
    for error in cause.errors():
        where = ".".join(str(part) for part in (*place, *error["loc"]) if part not in list_kinds())
        ours = any(where == key or where.startswith(f"{key}.") for key in stated)
        unknown = isinstance(error.get("ctx", {}).get("error"), UnknownName)
        if ours or unknown or error["type"] not in _OF_A_POINT:
            return _FileError(line)
    return ScenarioError(line)


def canonical_text(data: Any) -> str:
    """Return JSON that is the same for equal data."""
    return json.dumps(data, sort_keys=True, separators=(",", ":"), allow_nan=False)
