"""Engines that are altered on their way to the gate, and the gate's verdicts on them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from altered import Altered

from velodrome.engines.engine import Engine, Problem, Progress, Settings, Trajectory
from velodrome.scenarios.gate import checks as gate
from velodrome.scenarios.gate import sample as gate_sample
from velodrome.scenarios.gate.exact import Exact, find_exact
from velodrome.scenarios.gate.verdict import Verdict
from velodrome.scenarios.run.runner import configure_engine
from velodrome.scenarios.scenario.schema import Scenario
from velodrome.scenarios.scenario.start import Start, make_start

Chosen = Callable[[str, Mapping[str, Any]], tuple[Engine, Settings]]
Simulate = Callable[[Engine, Problem, Any, Progress], Trajectory]


@cache
def _start_of(scenario: str) -> Start:
    return make_start(Scenario.model_validate_json(scenario))


@cache
def _exact_of(scenario: str) -> Exact:
    return find_exact(_start_of(scenario))


def compute_starts_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compute the gated motions once: it is the engines that are altered."""
    scenarios: dict[int, str] = {}

    def start_of(scenario: Scenario) -> Start:
        text = scenario.model_dump_json()
        scenarios[id(_start_of(text))] = text
        return _start_of(text)

    monkeypatch.setattr(gate, "make_start", start_of)
    monkeypatch.setattr(gate, "find_exact", lambda start: _exact_of(scenarios[id(start)]))


def measure_rides_only(monkeypatch: pytest.MonkeyPatch) -> None:
    """Measure the ride alone: orders and eigenvalues take the longest, and faults must show without them."""
    monkeypatch.setattr(gate_sample, "_measure_order", lambda *_: ({}, {}))
    monkeypatch.setattr(gate_sample, "_measure_eigenvalues", lambda *_: {})


def verdicts_of(
    engine: str,
    chosen: Chosen = configure_engine,
    scenarios: Sequence[str] | None = None,
    baselines: Path | None = None,
    **options: Any,
) -> dict[str, list[Verdict]]:
    """Verdicts on an engine by scenario; on all that are gated if none is named."""
    verdicts, _ = gate.check_gate(lambda *_: None, scenarios, [engine], baselines, chosen, **options)
    assert {verdict.engine for _, verdict in verdicts} == {engine}
    found: dict[str, list[Verdict]] = {}
    for name, verdict in verdicts:
        found.setdefault(name, []).append(verdict)
    return found


def verdicts_on(engine: str, chosen: Chosen = configure_engine, scenario: str = "q2") -> list[Verdict]:
    """Verdicts on an engine in one scenario."""
    return verdicts_of(engine, chosen, [scenario])[scenario]


def failing(verdicts: Sequence[Verdict]) -> set[str]:
    """Quantities that close the gate."""
    return {verdict.quantity for verdict in verdicts if not verdict.passes}


def altered(
    before: Callable[[Problem], Problem] = lambda problem: problem,
    after: Callable[[Trajectory], Trajectory] = lambda trajectory: trajectory,
) -> Chosen:
    """An engine with another problem, or another trajectory."""

    def chosen(name: str, values: Mapping[str, Any]) -> tuple[Engine, Settings]:
        engine, settings = configure_engine(name, values)
        return Altered(engine, before, after), settings

    return chosen


@dataclass(frozen=True)
class _Simulated(Altered):
    """An engine whose `simulate` is another."""

    replaced: Simulate | None = None

    def simulate(self, problem: Problem, settings: Any, progress: Progress) -> Trajectory:
        assert self.replaced is not None
        found = self.replaced(self.inner, problem, settings, progress)
        # It says nothing of what it did.
        return replace(found, engine=self.name, version=self.version, settings=settings.model_dump(mode="json"))


def simulated(simulate: Simulate) -> Chosen:
    """An engine that computes its trajectory in another way, and says nothing of it."""

    def chosen(name: str, values: Mapping[str, Any]) -> tuple[Engine, Settings]:
        engine, settings = configure_engine(name, values)
        return _Simulated(engine, replaced=simulate), settings

    return chosen


def set_to(**changes: Any) -> Chosen:
    """An engine with other settings."""
    return lambda name, values: configure_engine(name, {**values, **changes})


def set_silently(**changes: Any) -> Chosen:
    """An engine that rides with other settings than it says."""

    def simulate(engine: Engine, problem: Problem, settings: Any, progress: Progress) -> Trajectory:
        return engine.simulate(problem, settings.model_copy(update=changes), progress)

    return simulated(simulate)


def with_bicycle(problem: Problem, **factors: float) -> Problem:
    """A problem with factors on values of its bicycle."""
    values = {name: factor * getattr(problem.bicycle, name) for name, factor in factors.items()}
    return replace(problem, bicycle=replace(problem.bicycle, **values))


def with_factors(**factors: float) -> Chosen:
    """An engine that rides another bicycle than it is given."""
    return altered(before=lambda problem: with_bicycle(problem, **factors))
