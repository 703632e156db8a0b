"""One task of a sweep as a worker does it: from a scenario to a row."""

from __future__ import annotations

import errno
import json
import math
import time
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from ...engines.admission import ride_engine
from ...engines.engine import REFERENCE, Engine, Settings, Trajectory, UnsuitableProblem, why_failed
from ...engines.guard import call_engine
from ...reports.measure import flatten_metrics
from ..error import ScenarioError
from ..run import claimed_noise, configure_engine, measure_one
from ..scenario import OF_THE_MOTION, Scenario, Start, make_start, set_keys, validate_scenario
from .plan import canonical_text, prune_settings
from .rows import METRICS, REFUSED, reason_line


class Tasks:
    """Do the tasks of one sweep, one after the other; neighbours share their start and the reference's ride.

    Parameters
    ----------
    base : mapping
        The base scenario as resolved.
    """

    def __init__(self, base: Mapping[str, Any]) -> None:
        self._base = base
        self._starts: Callable[[str], Start | str] = lru_cache(maxsize=64)(_make_start_or_reason)
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
        begin = time.process_time()
        timing: dict[str, Any] = {}
        try:
            row = call_engine(self._run_engine, engine, changes, timing)
        except Exception as error:  # an engine may raise anything; the row says what
            row = _failed_row(error)
        timing["task_time"] = time.process_time() - begin
        timing["finished"] = time.time()
        return _to_json_values(row), _to_json_values(timing)

    def _run_engine(self, name: str, changes: Mapping[str, Any], timing: dict[str, Any]) -> dict[str, Any]:
        scenario = validate_scenario(prune_settings(set_keys(self._base, changes), name), "task")
        engine, version, settings = _load_configured_engine(name, canonical_text(scenario.engines.get(name, {})))
        facts: dict[str, Any] = {"version": version}
        start = self._starts(_start_parameters(scenario))
        if isinstance(start, str):
            return facts | {"status": "no-motion", "reason": reason_line(start)}
        facts |= {"family": start.family, "growth_rate": start.growth_rate, "size": start.size}
        facts["warnings"] = "; ".join(start.problem.bicycle.warnings()) or None
        try:
            engine.check(start.problem, settings)
        except UnsuitableProblem:
            raise
        except ValueError as error:  # a step that does not divide the output interval, and the like
            return facts | {"status": REFUSED, "reason": reason_line(f"engines.{name}: {error}")}
        begin = time.process_time()
        reference: Trajectory | str | None = None
        try:
            if name == REFERENCE:
                trajectory, reference = self._run_reference(scenario, start), None
                if isinstance(trajectory, str):
                    return facts | {"status": "failed", "reason": trajectory}
            else:
                reference = self._run_reference(scenario, start)
                trajectory = ride_engine(engine, start.problem, settings, lambda _: None)
        except MemoryError:
            raise
        except Exception as error:
            return facts | _failed_row(error)
        finally:
            timing["engine_time"] = time.process_time() - begin
        known = None if isinstance(reference, str) else reference
        measured = flatten_metrics(measure_one(start, trajectory, known, step_noise=claimed_noise(engine, settings)))
        timing |= {key: measured.get(key) for key in ("cpu_time", "real_time_factor")}
        facts |= {key: measured.get(key) for key in METRICS if key not in facts}
        reason = f"nothing to compare with: the reference: {reference}" if isinstance(reference, str) else None
        return facts | _describe_outcome(measured, reason)

    def _run_reference(self, scenario: Scenario, start: Start) -> Trajectory | str:
        """Return the reference's ride at this point, or why there is none; the last is kept for the other engines."""
        chosen = canonical_text(scenario.engines.get(REFERENCE, {}))
        text = f"{_start_parameters(scenario)} {chosen}"
        if text not in self._references:
            engine, _, settings = _load_configured_engine(REFERENCE, chosen)
            found: Trajectory | str
            try:
                engine.check(start.problem, settings)
                found = ride_engine(engine, start.problem, settings, lambda _: None)
            except MemoryError:
                raise
            except Exception as error:
                found = reason_line(why_failed(error))
            self._references = {text: found}
        return self._references[text]


def _start_parameters(scenario: Scenario) -> str:
    """Return the parts of a scenario that determine its start."""
    return canonical_text(scenario.model_dump(mode="json", exclude_none=True, include={*OF_THE_MOTION, "simulation"}))


def _make_start_or_reason(text: str) -> Start | str:
    try:
        return make_start(validate_scenario(json.loads(text) | {"title": "start"}, "task"))
    except ScenarioError as error:
        return str(error)


@lru_cache(maxsize=1024)
def _load_configured_engine(name: str, settings: str) -> tuple[Engine, str, Settings]:
    """Return an engine, its version and its settings; looking them up takes longer than a short ride."""
    engine, chosen = configure_engine(name, json.loads(settings))
    return engine, engine.version, chosen


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
