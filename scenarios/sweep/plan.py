"""From a sweep file to its tasks; all bad input is found before anything runs."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from ...engines.engine import REFERENCE, UnsuitableProblem
from ...engines.names import suggest_name
from ...engines.registry import load_engine
from ..error import ScenarioError
from ..run import configure_engine, library_versions
from ..scenario import (
    Scenario,
    choose_engines,
    error_place,
    fits_engine,
    join_complaints,
    list_complaints,
    list_engine_faults,
    make_start,
    set_keys,
)
from .file import SweepFile, read_sweep
from .points import count_points, make_points

MOST_TASKS = 5_000_000  # tasks; about 2 GB in the planning process
# Types of pydantic's errors that a value of the right type may have.
_OF_A_POINT = ("value_error", "greater_than", "greater_than_equal", "less_than", "less_than_equal", "finite_number")
_LARGEST_COMPLAINT_COUNT = 20  # with more complaints, the remaining points are not checked
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
    choice, unknown = choose_engines(sweep.engines)
    # The reference rides at every point; it is an engine of the sweep only where it is chosen.
    engines = [name for name in choice.names if any(fits_engine(entry, name) for entry in sweep.engines)]
    # In the order of the file, by which the tasks are numbered.
    engines.sort(key=lambda name: [fits_engine(entry, name) for entry in sweep.engines].index(True))
    sweep = sweep.model_copy(update={"engines": tuple(engines)})
    riding = {*sweep.engines, REFERENCE}
    # Of engines that ride, a grid may have other settings; those are checked at every point.
    faults = list(unknown.values())
    faults += [f"scenario: {fault}" for fault in list_engine_faults(base.get("engines"), skipped=riding)]
    at_points: dict[str, str] = {}  # by complaint, the complaint with the first point that it concerns
    if count_points(sweep) * len(sweep.engines) > MOST_TASKS:
        raise ScenarioError(
            f"{path}: {count_points(sweep) * len(sweep.engines)} runs; at most {MOST_TASKS} fit one sweep"
        )
    checker = _Checker(path, base, drawn=sweep.latin_hypercube.ranges if sweep.latin_hypercube else ())
    tasks: list[Task] = []
    seen: set[tuple[str, str]] = set()
    for changes in make_points(sweep):
        for line in _name_other_engines(sweep, changes):
            at_points.setdefault(line, line)
        for engine in sweep.engines:
            own = concerning(engine, changes)
            try:
                digest, refused = checker.resolve(engine, own)
            except _FileError as error:
                for line in error.complaints:
                    at_points.setdefault(line, f"{point_text(own)}{line}")
                continue
            if (engine, digest) not in seen:
                seen.add((engine, digest))
                tasks.append(Task(len(tasks), f"{len(tasks):07d}-{digest[:12]}", engine, own, refused))
        if len(at_points) > _LARGEST_COMPLAINT_COUNT:
            break
    faults += at_points.values()
    if faults:
        raise ScenarioError(f"{path}: {join_complaints(faults)}")
    for engine in choice.named & {*sweep.engines}:
        if all(task.refused for task in tasks if task.engine == engine):
            raise ScenarioError(checker.first_refusal[engine])
    return SweepPlan(path.stem, path, sweep, base, tasks)


def concerning(engine: str, changes: Mapping[str, Any]) -> dict[str, Any]:
    """Select the changes without settings of other engines; the reference's concern all, which are compared with it."""
    return {key: value for key, value in changes.items() if _find_engine(key) in (None, engine, REFERENCE)}


def prune_settings(data: dict[str, Any], engine: str) -> dict[str, Any]:
    """Return a scenario's data with the settings of this engine and the reference only."""
    engines = data.get("engines", {})
    if not isinstance(engines, Mapping):
        return data
    return data | {"engines": {name: engines[name] for name in (REFERENCE, engine) if name in engines}}


def _find_engine(key: str) -> str | None:
    """Return the engine to which the setting of a dotted key belongs; None if the key is no engine's setting."""
    table, _, rest = key.partition(".")
    return rest.partition(".")[0] if table == "engines" else None


def _name_other_engines(sweep: SweepFile, changes: Mapping[str, Any]) -> Iterator[str]:
    """Yield a complaint about every changed setting of an engine that the sweep does not use."""
    riding = dict.fromkeys((*sweep.engines, REFERENCE))
    for key in changes:
        engine = _find_engine(key)
        if engine is not None and engine not in riding:
            yield f"{key}: {engine!r} is not among the sweep's engines ({suggest_name(engine, riding)})"


def point_text(changes: Mapping[str, Any]) -> str:
    """Return the beginning of a complaint about a point; empty where the point changes nothing."""
    at = ", ".join(f"{key} = {value!r}" for key, value in changes.items())
    return f"at {at}: " if at else ""


class _FileError(ScenarioError):
    """Error of the sweep file itself, not of one of its points.

    Attributes
    ----------
    complaints : list of str
    """

    def __init__(self, complaints: Sequence[str]) -> None:
        super().__init__(join_complaints(complaints))
        self.complaints = list(complaints)


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
        _FileError
            If the file is wrong.
        """
        try:
            data = prune_settings(set_keys(self._base, changes), engine)
        except ValueError as error:
            raise _FileError([str(error)]) from error
        refused = None
        try:
            data = self._resolved(engine, data, changes)
        except _FileError:
            raise
        except ScenarioError as error:
            self.first_refusal.setdefault(engine, f"{self._path}: {point_text(changes)}{error}")
            refused = str(error)
        return hashlib.sha256(canonical_text([engine, data]).encode()).hexdigest(), refused

    def _resolved(self, engine: str, data: dict[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
        stated = [key for key in changes if key not in self._drawn]
        try:
            scenario = Scenario.model_validate(data)
        except ValidationError as error:
            complaints = list_complaints(error)
            if _is_file_error(error, stated):
                raise _FileError([*complaints, *list_engine_faults(data.get("engines"))]) from error
            raise ScenarioError(join_complaints(complaints)) from error
        resolved = scenario.model_dump(mode="json", exclude_none=True)
        # Not a set, whose order differs between processes.
        for name in dict.fromkeys((engine, REFERENCE)):
            self._configure(name, resolved["engines"].get(name, {}), stated)
        self._check_engine(engine, scenario, resolved)
        return resolved

    def _configure(self, engine: str, settings: dict[str, Any], stated: Collection[str]) -> None:
        text = canonical_text([engine, settings])
        if text not in self._settings:
            try:
                configure_engine(engine, settings)
            except ScenarioError as error:
                if _is_file_error(error.__cause__, stated, ("engines", engine)):
                    raise _FileError([str(error)]) from error
                raise
            self._settings.add(text)

    def _check_engine(self, engine: str, scenario: Scenario, data: Mapping[str, Any]) -> None:
        """Raise an error if the engine refuses the run, such as a step that does not divide the output interval."""
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
        return None  # as does ground that does not suit the engine
    except ValueError as error:
        return f"engines.{engine}: {error}"
    except Exception:
        return None  # as does an engine that breaks
    return None


def _is_file_error(cause: BaseException | None, stated: Collection[str], place: tuple[str, ...] = ()) -> bool:
    """Return whether an error is one of the sweep file itself and not of one of its points.

    Errors of a point are values that contradict one another and drawn values out of range. Errors of the file are
    unknown names, values of another type, and values out of range that the file itself states.
    """
    if not isinstance(cause, ValidationError):
        return True
    for error in cause.errors():
        where = ".".join((*place, *error_place(error)))
        ours = any(where == key or where.startswith(f"{key}.") for key in stated)
        if ours or error["type"] not in _OF_A_POINT:
            return True
    return False


def canonical_text(data: Any) -> str:
    """Return JSON that is the same for equal data."""
    return json.dumps(data, sort_keys=True, separators=(",", ":"), allow_nan=False)
