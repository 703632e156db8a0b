"""From a sweep file to its tasks, which are found by number; what is wrong with the file is found before any runs."""

from __future__ import annotations

import hashlib
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, overload

from ...engines.engine import REFERENCE
from ...engines.names import suggest_name
from ...engines.registry import load_engine
from ..error import ScenarioError
from ..run import library_versions
from ..scenario import choose_engines, fits_engine, join_complaints, list_engine_faults
from .check import PointChecker, SweepFileError, canonical_text
from .file import SweepFile, read_sweep
from .points import Points, find_engine

MOST_TASKS = 100_000_000  # tasks; a byte each in the memory of a sweep that runs
LARGEST_CHECKED = 1000  # tasks of a sweep each of which is validated before any runs, in half a second
_LARGEST_COMPLAINT_COUNT = 20  # with more complaints, the remaining points are not checked


@dataclass(frozen=True)
class Task:
    """One run: an engine at a point.

    Attributes
    ----------
    index : int
        Index in the sweep.
    key : str
        Index and digest of all that determines the run.
    engine : str
    changes : dict
        Values by dotted key, of the changes that concern this engine.
    """

    index: int
    key: str
    engine: str
    changes: dict[str, Any]


class LazyTasks(Sequence[Task], ABC):
    """Tasks each of which is made when it is asked for."""

    @abstractmethod
    def make_task(self, place: int) -> Task:
        """Make the task at a place, from 0 up to ``len``, exclusive."""

    @overload
    def __getitem__(self, index: int) -> Task: ...

    @overload
    def __getitem__(self, index: slice) -> list[Task]: ...

    def __getitem__(self, index: int | slice) -> Task | list[Task]:
        places = range(len(self))[index]
        return self.make_task(places) if isinstance(places, int) else [self.make_task(place) for place in places]


class TaskSequence(LazyTasks):
    """The tasks of a sweep.

    Parameters
    ----------
    sweep : SweepFile
        With the names of its engines, no patterns.
    base : mapping
        The base scenario as resolved.
    """

    def __init__(self, sweep: SweepFile, base: Mapping[str, Any]) -> None:
        self._sweep, self._base = sweep, base
        self.points = Points(sweep, base)
        self._digest = hashlib.sha256(canonical_text(_select_riding(base, sweep)).encode())
        self._width = max(7, len(str(len(self.points) - 1)))  # digits, so that keys are in the order of the tasks

    def as_json(self) -> dict[str, Any]:
        """Return JSON values from which `from_json` makes the same tasks."""
        return {"sweep": self._sweep.model_dump(mode="json"), "base": dict(self._base)}

    @classmethod
    def from_json(cls, found: Mapping[str, Any]) -> TaskSequence:
        """Return the tasks of a sweep from JSON values of `as_json`."""
        return cls(SweepFile.model_validate(found["sweep"]), found["base"])

    def __len__(self) -> int:
        return len(self.points)

    def make_task(self, place: int) -> Task:
        """Make a task from its index in the sweep."""
        engine, changes = self.points.at(place)
        digest = self._digest.copy()
        digest.update(canonical_text([engine, changes]).encode())
        return Task(place, f"{place:0{self._width}d}-{digest.hexdigest()[:12]}", engine, changes)

    def find_engine_of(self, index: int) -> str:
        """Return the engine of a task, which takes less time than the task."""
        return self.points.engine_at(index)


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
    tasks : TaskSequence
    """

    name: str
    path: Path
    file: SweepFile
    base: dict[str, Any]
    tasks: TaskSequence

    @cached_property
    def parameters(self) -> dict[str, set[type]]:
        """All keys that runs change, in the order of the file, with the types of their values."""
        return self.tasks.points.value_types()

    def facts(self) -> dict[str, Any]:
        """Return what must be the same for rows of two sessions to belong to one data set."""
        runs = canonical_text([_select_riding(self.base, self.file), self.tasks.points.describe()])
        return {
            "tasks": len(self.tasks),
            "hash": hashlib.sha256(runs.encode()).hexdigest(),
            "engines": {name: load_engine(name).version for name in self.file.engines},
            "libraries": library_versions(),
        }


def plan_sweep(path: Path) -> SweepPlan:
    """Read a sweep file, check it and number its runs.

    Settings of one engine do not multiply the runs of another, and equal values count once. Every run of a sweep of up
    to `LARGEST_CHECKED` is validated. Of a larger one, runs are validated that have every row of the list and every
    value of the grid at least once, so that planning takes a time and memory that do not grow with the number of runs.
    An impossible combination, or a drawn point such as an inertia that no rigid body has, is a task that the worker
    refuses.

    Raises
    ------
    ScenarioError
        If the file is wrong, in one line: an unknown name, a stated value that is impossible, too many runs, or, where
        every run is validated, only runs of an engine that are refused.
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
    # By complaint, the complaint with the first point that it concerns.
    at_points = {line: line for line in _name_other_engines(sweep)}
    points = Points(sweep, base)
    if len(points) > MOST_TASKS:
        raise ScenarioError(f"{path}: {len(points)} runs; at most {MOST_TASKS} fit one sweep")
    checker = PointChecker(base, drawn=sweep.latin_hypercube.ranges if sweep.latin_hypercube else ())
    checked_all = len(points) <= LARGEST_CHECKED
    refusals: dict[str, str] = {}  # by engine, of its first run if all are refused
    possible: set[str] = set()
    for engine, changes in map(points.at, range(len(points))) if checked_all else points.vary_each():
        try:
            refused = checker.find_refusal(engine, changes, ask_engine=checked_all)
        except SweepFileError as error:
            for line in error.complaints:
                at_points.setdefault(line, f"{point_text(changes)}{line}")
            if len(at_points) > _LARGEST_COMPLAINT_COUNT:
                break
            continue
        if refused is None:
            possible.add(engine)
        else:
            refusals.setdefault(engine, f"{path}: {point_text(changes)}{refused}")
    faults += at_points.values()
    if faults:
        raise ScenarioError(f"{path}: {join_complaints(faults)}")
    for engine in sweep.engines:
        if checked_all and engine in choice.named and engine not in possible:
            raise ScenarioError(refusals[engine])
    return SweepPlan(path.stem, path, sweep, base, TaskSequence(sweep, base))


def _select_riding(base: Mapping[str, Any], sweep: SweepFile) -> dict[str, Any]:
    """Return the base scenario with the settings of the sweep's engines and the reference only."""
    settings = base.get("engines", {})
    return {**base, "engines": {name: settings[name] for name in (REFERENCE, *sweep.engines) if name in settings}}


def _name_other_engines(sweep: SweepFile) -> Iterator[str]:
    """Yield a complaint about every changed setting of an engine that the sweep does not use."""
    riding = dict.fromkeys((*sweep.engines, REFERENCE))
    drawn = sweep.latin_hypercube.ranges if sweep.latin_hypercube else ()
    for key in dict.fromkeys((*(key for row in sweep.list for key in row), *drawn, *sweep.grid)):
        engine = find_engine(key)
        if engine is not None and engine not in riding:
            yield f"{key}: {engine!r} is not among the sweep's engines ({suggest_name(engine, riding)})"


def point_text(changes: Mapping[str, Any]) -> str:
    """Return the beginning of a complaint about a point; empty where the point changes nothing."""
    at = ", ".join(f"{key} = {value!r}" for key, value in changes.items())
    return f"at {at}: " if at else ""
