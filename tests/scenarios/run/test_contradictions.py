"""What an engine says of itself must agree with its coordinates: contradictions are named, honest engines are not."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import pytest
from altered import CONTRADICTIONS, Altered, raising
from typer.testing import CliRunner

from tests.sealing import contents
from velodrome.engines import registry
from velodrome.engines.engine import REFERENCE, Engine, EngineError, Problem, Settings, Trajectory
from velodrome.engines.registry import engine_names
from velodrome.reports.drawing.remarks import make_remarks
from velodrome.reports.measure import flatten_metrics
from velodrome.reports.measure.consistency import describe_mismatch
from velodrome.scenarios.cli import app
from velodrome.scenarios.gate import checks as gate
from velodrome.scenarios.gate import sample as gate_sample
from velodrome.scenarios.run.folder import RunPlan
from velodrome.scenarios.run.runner import RunOutcome, configure_engine, plan_run, run_plan
from velodrome.scenarios.scenario.schema import Gate, library_names, load_scenario

OWN = "own"
HONEST = [("q2-plus", 1.0), ("iftomm-2", 1.0), ("plane-circle", 0.3)]


def plan_with(engine: Engine, name: str = "q2-plus", duration: float = 0.5) -> RunPlan:
    """A run of the reference and one more engine, which is built upon the reference."""
    plan = plan_run(*load_scenario(name, {"simulation.duration": duration}), [REFERENCE])
    return replace(plan, engines=plan.engines | {OWN: (engine, plan.engines[REFERENCE][1])})


def ride(plan: RunPlan, out: Path) -> RunOutcome:
    """What comes of a run without a recording, which takes the longest."""
    return run_plan(plan, out, lambda *_: None, lambda _: None, recording=False)


@pytest.mark.parametrize("what", CONTRADICTIONS)
def test_a_run_names_every_report_that_contradicts_the_coordinates(what: str, tmp_path: Path) -> None:
    after, named = CONTRADICTIONS[what]
    inner, _ = configure_engine(REFERENCE, {})
    outcome = ride(plan_with(Altered(inner, after=after, called=OWN)), tmp_path)
    assert not outcome.failures
    measured = contents(outcome.folder / "metrics.json")
    assert measured[REFERENCE]["inconsistent_reports"] == []
    found = measured[OWN]["inconsistent_reports"]
    assert {report["quantity"] for report in found} == named
    lines = make_remarks(OWN, measured[OWN], 0.5)
    told = "; ".join(map(describe_mismatch, found))
    about = "reports that contradict the coordinates: "
    assert [line for line in lines if line.startswith(about)] == ([f"{about}{OWN} ({told})"] if found else [])
    assert set(flatten_metrics(measured[OWN])["inconsistent_reports"].split(", ")) == named
    # What is shown is what follows from the coordinates.
    if "qd" in named:
        assert measured[OWN]["max_slip"] > 1e-3
        assert measured[OWN]["rate_error"] > 5e-4
    else:
        assert measured[OWN]["max_slip"] < 1e-13
        assert measured[OWN]["orientation_error"]["max"] < 1e-15
        assert measured[OWN]["energy_drift"] < 1e-12


def test_an_engine_that_reports_nothing_has_slip_gaps_and_energies(tmp_path: Path) -> None:
    inner, _ = configure_engine(REFERENCE, {})
    optional = ("contact_point", "contact_force", "gap", "slip", "kinetic_energy", "potential_energy")
    silent = Altered(inner, after=lambda one: replace(one, **dict.fromkeys(optional)), called=OWN)
    measured = ride(plan_with(silent), tmp_path).metrics[OWN]
    assert measured["max_slip"] < 1e-13
    assert measured["max_gap"] < 1e-12
    assert measured["energy_drift"] < 1e-12
    assert measured["contact_force_error"] is None
    assert measured["inconsistent_reports"] == []


@pytest.mark.parametrize(("name", "duration"), HONEST)
def test_no_engine_is_accused(name: str, duration: float, tmp_path: Path) -> None:
    accused(name, duration, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", library_names())
def test_no_engine_is_accused_in_the_whole_library(name: str, tmp_path: Path) -> None:
    accused(name, None, tmp_path)


def accused(name: str, duration: float | None, out: Path) -> None:
    changes = {} if duration is None else {"simulation.duration": duration}
    outcome = run_plan(plan_run(*load_scenario(name, changes)), out, lambda *_: None, lambda _: None)
    assert not outcome.failures
    assert len(outcome.metrics) >= len(engine_names()) - 1  # one rides on the level plane only
    assert [
        describe_mismatch(report) for found in outcome.metrics.values() for report in found["inconsistent_reports"]
    ] == []


@pytest.fixture
def rides_only(monkeypatch: pytest.MonkeyPatch) -> None:
    """Measure the ride alone: orders and eigenvalues take the longest."""
    monkeypatch.setattr(gate_sample, "_measure_order", lambda *_: ({}, {}))
    monkeypatch.setattr(gate_sample, "_measure_eigenvalues", lambda *_: {})


def chosen_with(after: Any) -> gate.Chosen:
    def chosen(name: str, values: Mapping[str, Any]) -> tuple[Engine, Settings]:
        engine, settings = configure_engine(name, values)
        return (Altered(engine, after=after) if name == REFERENCE else engine), settings

    return chosen


# Energies of a steady circle are constant: late ones are the same.
@pytest.mark.usefixtures("rides_only")
@pytest.mark.parametrize("what", [what for what in CONTRADICTIONS if what != "late energies"])
def test_no_baseline_is_written_of_an_engine_that_contradicts_itself(what: str, tmp_path: Path) -> None:
    chosen = chosen_with(CONTRADICTIONS[what][0])
    verdicts, fresh = gate.check_gate(lambda *_: None, ["q2"], [REFERENCE, "mujoco-multipliers"], tmp_path, chosen)
    ((name, verdict),) = gate.refused_verdicts(verdicts)
    assert (name, verdict.engine, verdict.status, verdict.limit) == ("q2", REFERENCE, "worse", 1.0)
    assert " from " in verdict.reason
    (path,) = gate.update_baselines(fresh, verdicts, None, tmp_path)
    assert set(json.loads(path.read_text())["engines"]) == {"mujoco-multipliers"}


@pytest.mark.usefixtures("rides_only")
def test_no_baseline_excuses_a_contradiction_and_the_old_one_stays(tmp_path: Path) -> None:
    after, _ = CONTRADICTIONS["bodies 1 mm high"]
    _, fresh = gate.check_gate(lambda *_: None, ["q2"], [REFERENCE], tmp_path, chosen_with(after))
    # Whoever writes it by hand gains nothing.
    (tmp_path / "q2.json").write_text(json.dumps(fresh["q2"]))
    again, fresh = gate.check_gate(lambda *_: None, ["q2"], [REFERENCE], tmp_path, chosen_with(after))
    assert [verdict.quantity for _, verdict in again if not verdict.passes] == ["report_mismatch"]
    assert gate.update_baselines(fresh, again, None, tmp_path) == []


BROKEN = """
import numpy as np
from dataclasses import replace
from velodrome.engines.lagrange import LagrangeEngine

class Own(LagrangeEngine):
    name = "own"
    def simulate(self, problem, settings, progress):
        # Another method than the reference's, or it would be taken for a copy.
        ride = super().simulate(problem, settings.model_copy(update={"integrator": "modified-euler"}), progress)
        return replace(ride, settings=settings.model_dump(), body_position=ride.body_position + [0, 0, 1e-3])

ENGINE = Own()
"""


@pytest.mark.usefixtures("rides_only")
def test_the_command_refuses_to_update_and_says_which_report(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "own_high.py").write_text(BROKEN, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    announced = registry.list_entry_points(registry.ENTRY_POINT_GROUP)
    point = EntryPoint(OWN, "own_high:ENGINE", registry.ENTRY_POINT_GROUP)
    monkeypatch.setattr(registry, "list_entry_points", lambda group: [*announced, point])
    baselines = tmp_path / "baselines"
    command = ["check", "q2", "--engine", OWN, "--engine", REFERENCE, "--baselines", str(baselines), "--update"]
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 1
    assert "no baseline written of own on q2: its position of the" in " ".join(done.output.split())
    assert set(json.loads((baselines / "q2.json").read_text())["engines"]) == {REFERENCE}


RIDE_SAMPLES = round(Gate().duration * Gate().output_rate) + 1


@pytest.mark.parametrize(
    "after",
    [raising(EngineError("no such step")), raising(ZeroDivisionError("by zero"))],
    ids=["refused", "broken"],
)
def test_an_order_that_cannot_be_measured_costs_only_itself(after: Any) -> None:
    def otherwise(problem: Problem, trajectory: Trajectory) -> Trajectory:
        return trajectory if len(problem.times) == RIDE_SAMPLES else after(trajectory)

    class Fragile(Altered):
        def simulate(self, problem: Problem, settings: Any, progress: Any) -> Trajectory:
            return otherwise(problem, self.inner.simulate(problem, settings, progress))

    def chosen(name: str, values: Mapping[str, Any]) -> tuple[Engine, Settings]:
        engine, settings = configure_engine(name, values)
        return Fragile(engine), settings

    verdicts, _ = gate.check_gate(lambda *_: None, ["q2"], [REFERENCE], chosen=chosen)
    fails = {verdict.quantity: verdict for _, verdict in verdicts if not verdict.passes}
    assert set(fails) == {"observed_order", *gate_sample.EIGENVALUE_QUANTITIES}
    for verdict in fails.values():
        assert verdict.status == "missing"
        assert "no such step" in verdict.reason or "ZeroDivisionError: by zero" in verdict.reason
