"""One task of a sweep as a worker does it: from a scenario to a row."""

from __future__ import annotations

import errno
import json
import math
import time
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from ...engines.admission import ride_engine
from ...engines.engine import REFERENCE, Engine, Settings, Trajectory, UnsuitableProblem, why_failed
from ...engines.guard import call_engine
from ...engines.many import ride_in_batches
from ...reference.bicycle import Bicycle
from ...reports.measure import flatten_metrics
from ..error import ScenarioError
from ..run import claimed_noise, configure_engine, measure_one
from ..scenario import Scenario, ScenarioTemplate, Start, make_starts
from .check import canonical_text, prune_settings
from .rows import METRICS, REFUSED, reason_line

_SOURCE = "task"  # what errors of a scenario begin with
_KEPT_STARTS = 64  # starts that are kept for the other engines at the same points


@dataclass(frozen=True)
class _Prepared:
    """A task that is ready to ride.

    Attributes
    ----------
    engine : Engine
    settings : Settings
    step_noise : float
        See `velodrome.scenarios.run.claimed_noise`.
    scenario : Scenario
    start : Start
    facts : dict
        The part of its row that does not depend on the ride.
    """

    engine: Engine
    settings: Settings
    step_noise: float
    scenario: Scenario
    start: Start
    facts: dict[str, Any]


class Tasks:
    """Do the tasks of one sweep; neighbours share their start and the reference's ride.

    Parameters
    ----------
    base : mapping
        The base scenario as resolved.
    """

    def __init__(self, base: Mapping[str, Any]) -> None:
        self._base = base
        self._templates: dict[str, ScenarioTemplate] = {}
        self._starts: OrderedDict[str, Start | str] = OrderedDict()
        self._references: dict[str, Trajectory | str] = {}

    def do(self, engine: str, changes: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
        """Run an engine at a point.

        Parameters
        ----------
        engine : str
        changes : mapping
            Values by dotted key.

        Returns
        -------
        row : dict
            Version, status, reason and metrics, which are the same whenever and wherever the task is done.
        timing : dict
            Values that are not.
        """
        return self.do_many(engine, [changes])[0]

    def do_many(self, engine: str, points: Sequence[Mapping[str, Any]]) -> list[tuple[dict[str, Any], dict[str, Any]]]:
        """Run an engine at points.

        Parameters
        ----------
        engine : str
            The reference rides all points in a few calls of compiled code, other engines one after the other.
        points : sequence of mapping
            Values by dotted key.

        Returns
        -------
        list of (row, timing)
            As `do` returns them for each point: the rows are equal to the bit.
        """
        if engine == REFERENCE:
            return self._ride_reference_at(points)
        return [self._do_one(engine, changes) for changes in points]

    def _do_one(self, engine: str, changes: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
        begin = time.process_time()
        timing: dict[str, Any] = {}
        try:
            row = call_engine(self._run_engine, engine, changes, timing)
        except Exception as error:  # an engine may raise anything; the row says what
            row = _failed_row(error)
        return _row_and_timing(row, timing, time.process_time() - begin)

    def _ride_reference_at(self, points: Sequence[Mapping[str, Any]]) -> list[tuple[dict[str, Any], dict[str, Any]]]:
        """Ride the reference at points; those with the same settings share batches."""
        found: dict[int, tuple[dict[str, Any], dict[str, Any]]] = {}
        batches: dict[str, dict[int, tuple[_Prepared, float]]] = {}
        begin = time.process_time()
        scenarios = self._find_starts(REFERENCE, points)
        share = (time.process_time() - begin) / len(points) if points else 0.0
        for i, changes in enumerate(points):
            begin = time.process_time() - share
            try:
                ready = self._prepare(REFERENCE, changes, scenarios.get(i))
            except Exception as error:
                ready = _failed_row(error)
            if not isinstance(ready, _Prepared):
                found[i] = _row_and_timing(ready, {}, time.process_time() - begin)
            else:
                text = canonical_text(ready.scenario.engines.get(REFERENCE, {}))
                batches.setdefault(text, {})[i] = (ready, time.process_time() - begin)
        for batch in batches.values():
            try:
                found |= self._measure_batch(points, batch)
            except MemoryError:  # too little for a batch; one by one each row says whether it is too little for it
                found |= {i: self._do_one(REFERENCE, points[i]) for i in batch}
        return [found[i] for i in range(len(points))]

    def _measure_batch(
        self, points: Sequence[Mapping[str, Any]], batch: Mapping[int, tuple[_Prepared, float]]
    ) -> dict[int, tuple[dict[str, Any], dict[str, Any]]]:
        """Return rows and timings by index of the point; ``batch`` has the tasks with their time so far [s]."""
        indices, found = list(batch), dict[int, tuple[dict[str, Any], dict[str, Any]]]()
        first, _ = batch[indices[0]]
        problems = [batch[i][0].start.problem for i in indices]
        for k, ride in ride_in_batches(first.engine, problems, first.settings):
            if isinstance(ride, MemoryError):
                raise ride
            (ready, spent), begin = batch[indices[k]], time.process_time()
            timing: dict[str, Any] = {}
            if isinstance(ride, Trajectory):
                timing["engine_time"] = ride.cpu_time
            self._keep_reference(ready, points[indices[k]], ride)
            try:
                row = _measured_row(ready, ride, None, timing)
            except Exception as error:
                row = _failed_row(error)
            spent += timing.get("engine_time", 0.0) + time.process_time() - begin
            found[indices[k]] = _row_and_timing(row, timing, spent)
        return found

    def _keep_reference(self, ready: _Prepared, changes: Mapping[str, Any], ride: Trajectory | Exception) -> None:
        """Keep the reference's ride at a point for the other engines."""
        chosen = canonical_text(ready.scenario.engines.get(REFERENCE, {}))
        kept = reason_line(why_failed(ride)) if isinstance(ride, Exception) else ride
        self._references = {f"{_start_text(changes)} {chosen}": kept}

    def _apply(self, name: str, changes: Mapping[str, Any]) -> Scenario:
        """Return the scenario of an engine at a point."""
        if name not in self._templates:
            self._templates[name] = ScenarioTemplate(self._base, _SOURCE, lambda data: prune_settings(data, name))
        return self._templates[name].apply(changes)

    def _prepare(
        self, name: str, changes: Mapping[str, Any], scenario: Scenario | None = None
    ) -> _Prepared | dict[str, Any]:
        """Return a task ready to ride, or its row where there is nothing to ride; ``scenario`` if it is known."""
        try:
            scenario = self._apply(name, changes) if scenario is None else scenario
            text = canonical_text(scenario.engines.get(name, {}))
            engine, version, settings, noise = _load_configured_engine(name, text)
        except ScenarioError as error:  # values that contradict one another, or a drawn one out of range
            return {"status": REFUSED, "reason": reason_line(str(error).removeprefix(f"{_SOURCE}: "))}
        facts: dict[str, Any] = {"version": version}
        start = self._find_start(scenario, changes)
        if isinstance(start, str):
            return facts | {"status": "no-motion", "reason": reason_line(start)}
        facts |= {"family": start.family, "growth_rate": start.growth_rate, "size": start.size}
        facts["warnings"] = _list_warnings(start.problem.bicycle)
        try:
            engine.check(start.problem, settings)
        except UnsuitableProblem:
            raise
        except ValueError as error:  # a step that does not divide the output interval, and the like
            return facts | {"status": REFUSED, "reason": reason_line(f"engines.{name}: {error}")}
        return _Prepared(engine, settings, noise, scenario, start, facts)

    def _run_engine(self, name: str, changes: Mapping[str, Any], timing: dict[str, Any]) -> dict[str, Any]:
        ready = self._prepare(name, changes)
        if not isinstance(ready, _Prepared):
            return ready
        begin = time.process_time()
        reference: Trajectory | str | None = None
        ride: Trajectory | Exception
        try:
            if name != REFERENCE:
                reference = self._run_reference(ready, changes)
            ride = ride_engine(ready.engine, ready.start.problem, ready.settings, lambda _: None)
        except MemoryError:
            raise
        except Exception as error:
            ride = error
        finally:
            timing["engine_time"] = time.process_time() - begin
        return _measured_row(ready, ride, reference, timing)

    def _run_reference(self, ready: _Prepared, changes: Mapping[str, Any]) -> Trajectory | str:
        """Return the reference's ride at this point, or why there is none."""
        chosen = canonical_text(ready.scenario.engines.get(REFERENCE, {}))
        text = f"{_start_text(changes)} {chosen}"
        if text not in self._references:
            engine, _, settings, _ = _load_configured_engine(REFERENCE, chosen)
            try:
                engine.check(ready.start.problem, settings)
                ride: Trajectory | Exception = ride_engine(engine, ready.start.problem, settings, lambda _: None)
            except MemoryError:
                raise
            except Exception as error:
                ride = error
            self._keep_reference(ready, changes, ride)
        return self._references[text]

    def _find_starts(self, name: str, points: Sequence[Mapping[str, Any]]) -> dict[int, Scenario]:
        """Find the starts at points together, and keep them; return the scenarios of valid points by their index."""
        found: dict[int, Scenario] = {}
        for i, changes in enumerate(points):
            try:
                found[i] = self._apply(name, changes)
            except Exception:  # the point's own row says what is wrong
                continue
        texts = {i: _start_text(points[i]) for i in found}
        missing = {texts[i]: scenario for i, scenario in found.items() if texts[i] not in self._starts}
        with suppress(Exception):  # as a lack of memory; the rows find their starts one by one, and say what is wrong
            self._keep_starts(missing, most=len(points))
        return found

    def _find_start(self, scenario: Scenario, changes: Mapping[str, Any]) -> Start | str:
        """Return the start of a scenario, or why there is none; the last ones are kept for the other engines."""
        text = _start_text(changes)
        if text not in self._starts:
            self._keep_starts({text: scenario})
        return self._starts[text]

    def _keep_starts(self, missing: Mapping[str, Scenario], most: int = 0) -> None:
        """Find starts and keep them, together with the last ones of before: ``most`` of them, or more."""
        for text, start in zip(missing, make_starts(list(missing.values())), strict=True):
            self._starts[text] = str(start) if isinstance(start, ScenarioError) else start
        while len(self._starts) > max(_KEPT_STARTS, most):
            self._starts.popitem(last=False)


def _start_text(changes: Mapping[str, Any]) -> str:
    """Return the changes that may concern a start: all but the engines' settings."""
    return canonical_text({key: value for key, value in changes.items() if key.partition(".")[0] != "engines"})


def _measured_row(
    ready: _Prepared, ride: Trajectory | Exception, reference: Trajectory | str | None, timing: dict[str, Any]
) -> dict[str, Any]:
    """Return the row of a ride; ``reference`` is the trajectory to compare with, or why there is none."""
    facts = ready.facts
    if isinstance(ride, Exception):
        if ready.engine.name == REFERENCE:
            return facts | {"status": "failed", "reason": reason_line(why_failed(ride))}
        return facts | _failed_row(ride)
    known = None if isinstance(reference, str) else reference
    measured = flatten_metrics(measure_one(ready.start, ride, known, step_noise=ready.step_noise))
    timing |= {key: measured.get(key) for key in ("cpu_time", "real_time_factor")}
    row = facts | {key: measured.get(key) for key in METRICS if key not in facts}
    reason = f"nothing to compare with: the reference: {reference}" if isinstance(reference, str) else None
    return row | _describe_outcome(measured, reason)


def _row_and_timing(
    row: Mapping[str, Any], timing: dict[str, Any], task_time: float
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return a row and its timing as JSON values."""
    timing["task_time"] = task_time
    timing["finished"] = time.time()
    return _to_json_values(row), _to_json_values(timing)


@lru_cache(maxsize=1024)
def _load_configured_engine(name: str, settings: str) -> tuple[Engine, str, Settings, float]:
    """Return an engine, its version, settings and step noise; looking them up takes longer than a short ride."""
    engine, chosen = configure_engine(name, json.loads(settings))
    return engine, engine.version, chosen, claimed_noise(engine, chosen)


@lru_cache(maxsize=64)
def _list_warnings(bicycle: Bicycle) -> str | None:
    """Return the warnings about a bicycle as one text."""
    return "; ".join(bicycle.warnings()) or None


def _describe_outcome(measured: Mapping[str, Any], reason: str | None) -> dict[str, Any]:
    if measured["fell_at"] is not None:
        reason_of_fall = f"fell at {measured['fell_at']!r} s"
        return {"status": "fell", "reason": "; ".join(filter(None, (reason_of_fall, measured["ended"], reason)))}
    if measured["ended"] is not None:
        return {"status": "ended", "reason": "; ".join(filter(None, (measured["ended"], reason)))}
    return {"status": "done", "reason": reason}


def _failed_row(error: Exception) -> dict[str, Any]:
    """Return the row of a failed run; Python, C++ and the system report a lack of memory in different ways."""
    short = isinstance(error, MemoryError) or (isinstance(error, OSError) and error.errno == errno.ENOMEM)
    if short or "bad_alloc" in str(error):
        return {"status": "memory", "reason": "more memory than the sweep's memory_limit, or than there is"}
    return {"status": "failed", "reason": reason_line(why_failed(error))}


def _to_json_values(values: Mapping[str, Any]) -> dict[str, Any]:
    """Convert values to what JSON can carry: Python's numbers, and None for those that are not finite."""
    plain = {name: value.item() if isinstance(value, np.generic) else value for name, value in values.items()}
    return {
        name: None if isinstance(value, float) and not math.isfinite(value) else value for name, value in plain.items()
    }
