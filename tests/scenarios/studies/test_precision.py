"""Work-precision studies: the document, its figures held against single runs, failures as rows."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from tests.sealing import contents
from velodrome.engines.admission import ride_engine
from velodrome.engines.engine import REFERENCE
from velodrome.engines.registry import load_engine
from velodrome.reports.measure.metrics import position_errors
from velodrome.reports.measure.precision import SAME_BITS, Level, engine_document
from velodrome.scenarios.commands.present_precision import show_precision
from velodrome.scenarios.error import ScenarioError
from velodrome.scenarios.run.runner import measure_one
from velodrome.scenarios.scenario.schema import load_scenario
from velodrome.scenarios.scenario.start import make_start
from velodrome.scenarios.studies.precision import study_precision, write_precision

FIELDS = {"scenario", "horizon", "engines"}
POINT_FIELDS = {"step", "position_error", "energy_drift", "max_slip", "cpu_time"}


def study(name: str, changes: dict[str, Any], engines: list[str], levels: int, eigenvalues: bool = False) -> Any:
    return study_precision(*load_scenario(name, changes), engines, levels, eigenvalues, lambda *_: None)


@cache
def soft() -> Any:
    """Two seconds of q1 on soft contacts."""
    changes = {"simulation.duration": 2.0, "engines.mujoco-native.step": 0.002}
    return study("q1", changes, ["mujoco-native"], 4)


def test_the_document_has_the_contracts_fields() -> None:
    document = soft()
    assert set(document) >= FIELDS
    assert list(document["engines"]) == [REFERENCE, "mujoco-native"]
    for entry in document["engines"].values():
        assert set(entry) >= {"points", "observed_order", "richardson_error"}
        assert all(set(point) >= POINT_FIELDS for point in entry["points"])
    json.dumps(document, allow_nan=False)


def test_steps_are_halved_from_four_times_the_scenarios() -> None:
    steps = [point["step"] for point in soft()["engines"]["mujoco-native"]["points"]]
    assert steps == pytest.approx([0.008, 0.004, 0.002, 0.001], rel=1e-12)


def test_an_error_is_that_of_a_single_run() -> None:
    point = soft()["engines"]["mujoco-native"]["points"][2]
    problem = make_start(load_scenario("q1", {"simulation.duration": 2.0})[1]).problem
    engine = load_engine("mujoco-native")
    settings = engine.settings.model_validate({"step": 0.002})
    reference = load_engine(REFERENCE)
    yardstick = ride_engine(reference, problem, reference.settings(), lambda _: None)
    errors = position_errors(ride_engine(engine, problem, settings, lambda _: None), yardstick)
    # The study is sampled at every eighth millisecond that both grids share; the error grows smoothly, to its
    # largest at the end, which both have.
    assert point["position_error"] == pytest.approx(errors.max(), rel=1e-6)


def test_order_and_limit_of_soft_contacts() -> None:
    entry = soft()["engines"]["mujoco-native"]
    # First order; the finest three steps still carry a tenth of the next.
    assert entry["observed_order"] == pytest.approx(1, abs=0.15)
    assert entry["richardson_error"] < 0.05 * entry["points"][-1]["position_error"]
    assert 0 < entry["window"] <= 2.0


def test_the_horizon_is_that_of_the_finest_step() -> None:
    document = soft()
    assert document["growth_rate"] == pytest.approx(0.38445, abs=1e-5)
    finest = document["engines"]["mujoco-native"]["points"][-1]
    assert document["horizon"] == pytest.approx(finest["horizon"])
    assert study("q2", {"simulation.duration": 0.4}, ["mujoco-native"], 2)["horizon"] is None


def test_the_references_levels_converge_to_itself() -> None:
    entry = soft()["engines"][REFERENCE]
    errors = [point["position_error"] for point in entry["points"]]
    assert errors[0] > errors[-1] > 0
    # Order 8 in tolerances that fall by 256: even its noisiest halving gains a factor of 4.
    assert errors[-1] < errors[0] / 4**3


def test_a_step_that_changes_nothing_shows_neither_order_nor_limit() -> None:
    start = make_start(load_scenario("plane-circle", {"simulation.duration": 0.2})[1])
    engine = load_engine(REFERENCE)
    same = ride_engine(engine, start.problem, engine.settings(), lambda _: None)
    measured = measure_one(start, same, same, step_noise=0.0)
    levels = [Level(step, same, measured) for step in (0.02, 0.01, 0.005)]
    entry = engine_document(levels, [], same, start.size, None)
    assert (entry["observed_order"], entry["richardson_error"], entry["window"]) == (None, None, None)
    assert [failure["reason"] for failure in entry["failures"]] == [SAME_BITS]
    study = {"scenario": "plane-circle", "horizon": None, "duration": 0.2, "warnings": []}
    console = Console(width=100, record=True, file=io.StringIO())
    show_precision(console, study | {"engines": {"own": entry | {"eigenvalues": None}}})
    rows = [line.split() for line in console.export_text().splitlines() if line.startswith("0.0")]
    assert [row[-1] for row in rows][2:] == ["–"]


def test_a_window_of_few_samples_shows_its_order() -> None:
    """Quarters of a window of two or three samples hold no sample, or the start alone."""
    start = make_start(load_scenario("plane-circle", {"simulation.duration": 0.2})[1])
    engine = load_engine(REFERENCE)
    exact = ride_engine(engine, start.problem, engine.settings(), lambda _: None)
    measured = measure_one(start, exact, exact, step_noise=0.0)

    def ride(step: float, beyond: int) -> Level:
        q = exact.q.copy()
        q[:, 0] += 1e-6 * step**2 * exact.time
        q[beyond:, 0] += start.size
        return Level(step, replace(exact, q=q), measured)

    for samples, order in ((1, None), (2, 2.0), (3, 2.0)):
        entry = engine_document([ride(step, samples) for step in (0.04, 0.02, 0.01)], [], exact, start.size, None)
        expected = None if order is None else pytest.approx(order, abs=1e-3)
        assert entry["observed_order"] == expected
        assert entry["order_range"] == (None if order is None else [expected, expected])


def test_an_order_that_is_not_settled_is_none() -> None:
    """Rides of order 2 that end in noise which a halved step does not change show some other order at the end."""
    start = make_start(load_scenario("plane-circle", {"simulation.duration": 0.2})[1])
    engine = load_engine(REFERENCE)
    exact = ride_engine(engine, start.problem, engine.settings(), lambda _: None)
    measured = measure_one(start, exact, exact, step_noise=0.0)
    steps, late = (0.04, 0.02, 0.01), exact.time > 0.8 * exact.time[-1]

    def ride(step: float, noise: float) -> Level:
        q = exact.q.copy()
        q[:, 0] += 1e-6 * step**2 * exact.time + noise * late
        return Level(step, replace(exact, q=q), measured)

    clean = engine_document([ride(step, 0.0) for step in steps], [], exact, start.size, None)
    assert clean["observed_order"] == pytest.approx(2, abs=1e-3)
    assert clean["failures"] == []
    noisy = [ride(step, noise) for step, noise in zip(steps, (0.0, 0.0, 1e-9), strict=True)]
    entry = engine_document(noisy, [], exact, start.size, None)
    assert entry["observed_order"] is None
    least, largest = entry["order_range"]
    assert largest == pytest.approx(2, abs=1e-3)
    assert least < 1
    assert [failure["reason"].split(":")[0] for failure in entry["failures"]] == ["no order"]


def test_eigenvalues_are_part_of_the_study() -> None:
    document = study("q2", {"simulation.duration": 0.4}, ["mujoco-native"], 2, eigenvalues=True)
    for name, largest in ((REFERENCE, 1e-6), ("mujoco-native", 1e-2)):
        found = document["engines"][name]["eigenvalues"]
        assert found["error"] < largest
        assert np.abs(np.subtract(found["values"], found["reference"])).max() <= found["error"]


def test_ground_without_symmetry_has_no_eigenvalues() -> None:
    document = study("waves", {"simulation.duration": 0.4}, ["mujoco-multipliers"], 2, eigenvalues=True)
    entry = document["engines"]["mujoco-multipliers"]
    assert entry["eigenvalues"] is None
    reasons = [failure["reason"] for failure in entry["failures"]]
    assert reasons == ["no eigenvalues: the ground is no surface of revolution, so that the motion is not steady"]


def test_a_level_that_fails_is_a_row_with_its_reason() -> None:
    document = study("p3", {"simulation.duration": 4.0}, ["mujoco-native"], 2)
    entry = document["engines"]["mujoco-native"]
    assert len(entry["points"]) + len(entry["failures"]) == 2
    assert entry["failures"], "P3 grows by e^5 a second: soft contacts leave it in four"
    assert all(failure["step"] and failure["reason"] for failure in entry["failures"])


def test_a_fall_is_told_though_the_engine_ends_the_ride_later() -> None:
    """mujoco-default lies at 0.48 s, and its ride ends at 0.92 s, where a wheel lies flat."""
    document = study("plane-circle", {"simulation.duration": 1.0}, ["mujoco-default"], 2)
    reasons = [failure["reason"] for failure in document["engines"]["mujoco-default"]["failures"]]
    assert len(reasons) == 2
    assert all(reason.startswith("fell at 0.4") for reason in reasons)


def test_steps_that_share_no_output_interval_are_refused_in_one_line() -> None:
    with pytest.raises(ScenarioError, match="no output interval") as caught:
        study("q2", {"simulation.duration": 0.75, "engines.mujoco-native.step": 0.005}, ["mujoco-native"], 3)
    assert "\n" not in str(caught.value)
    with pytest.raises(ScenarioError, match="no output interval") as caught:
        study("q2", {"simulation.duration": 0.5}, ["mujoco-exact-contact"], 2)
    advice = "the coarsest of which is 0.008 s of mujoco-exact-contact; --duration 0.52 fits them"
    assert str(caught.value).endswith(advice)
    document = study("q2", {"simulation.duration": 0.52}, ["mujoco-exact-contact"], 2)
    assert len(document["engines"]["mujoco-exact-contact"]["points"]) == 2


def test_document_and_figure_are_written(tmp_path: Path) -> None:
    written = write_precision(soft(), tmp_path / "found")
    assert [path.name for path in written] == ["precision-q1.json", "precision-q1.html", "precision-q1.png"]
    assert contents(written[0]) == soft()
    assert "Steps and errors on q1" in written[1].read_text(encoding="utf-8")
    assert written[2].read_bytes().startswith(b"\x89PNG")
    assert sorted(tmp_path.rglob("*.*")) == sorted(written)
    blocked = tmp_path / "file"
    blocked.write_text("")
    with pytest.raises(ScenarioError, match="cannot be made"):
        write_precision(soft(), blocked / "found")
