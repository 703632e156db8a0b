"""What single precision costs: measured distances, their prediction, and what is refused."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

from tests.sealing import contents
from velodrome.engines.admission import ride_engine
from velodrome.engines.mujoco.model import MARGIN
from velodrome.engines.mujoco.native import ENGINE as NATIVE
from velodrome.engines.mujoco.planes import build_planes
from velodrome.engines.mujoco.ride import ride_rig
from velodrome.engines.mujoco.rounding import build_rounded_planes
from velodrome.engines.mujoco.settings import NativeSettings, RoundedSettings
from velodrome.engines.mujoco.state import from_mujoco
from velodrome.engines.registry import load_engine
from velodrome.reports.measure import carry_errors, find_deviations, measure_sensitivity, measure_step_errors
from velodrome.scenarios.error import ScenarioError
from velodrome.scenarios.scenario import load_scenario, make_start
from velodrome.scenarios.studies import all_rode_float32, study_float32, write_float32

VARIANTS = ["state rounded", "positions rounded", "velocities rounded"]
STARTS = 8


def study(name: str, engines: list[str] | None, duration: float, starts: int = 2, **changes: Any) -> Any:
    given = {"simulation.duration": duration, **changes}
    return study_float32(*load_scenario(name, given), engines, starts, lambda *_: None)


@cache
def circle() -> Any:
    """A second on the level circle with MuJoCo in C alone."""
    return study("plane-circle", ["mujoco-native"], 1.0)


def points(document: Any, engine: str, variant: str) -> Any:
    return document["engines"][engine]["variants"][variant]["points"]


def test_every_variant_rides_and_gives_numbers() -> None:
    document = circle()
    assert list(document["engines"]["mujoco-native"]["variants"]) == VARIANTS
    assert all_rode_float32(document)
    for variant in VARIANTS:
        (point,) = points(document, "mujoco-native", variant)
        assert point["time"] == pytest.approx(1.0)
        assert 0 < point["distance"] <= point["largest_distance"]
        assert point["rms_distance"] <= point["largest_distance"]
        assert 0 < point["start"] < 1e-4
    json.dumps(document, allow_nan=False)


def test_the_errors_of_single_steps_carry_the_whole_distance() -> None:
    """To first order it is their sum; the interpolation of the sensitivity in blocks leaves less than a per cent."""
    for variant in VARIANTS:
        for point in points(circle(), "mujoco-native", variant):
            assert point["unexplained"] < 0.02 * point["distance"]
            assert point["measured_to_step_errors"] == pytest.approx(1, abs=0.02)


@pytest.mark.parametrize("name", ["plane-circle", "iftomm-2"])
def test_a_bias_that_contacts_undo_is_carried(name: str) -> None:
    """Contacts that begin 0.5 um higher kick the wheels up in every step, and push back: 0.5 um is left of 20 mm/s.

    Blocks of 0.1 s miss the distance by 0.4 and 7 times itself, those of 0.01 s by less than a tenth: the square of the
    ratio.
    """
    settings = NativeSettings(tolerance=1e-14)
    problem = make_start(load_scenario(name, {"simulation.duration": 1.0})[1]).problem
    problem = replace(problem, times=np.arange(501) * 0.002)

    def ride(margin: float) -> tuple[np.ndarray, np.ndarray]:
        rig = build_planes(problem, settings)
        rig.model.pair_margin[:] = margin
        found = ride_rig(rig, 0.002, list(range(501)), lambda _: None).recording
        return from_mujoco(found.time, found.qpos, found.qvel, problem.q)

    exact, other, advance = ride(MARGIN), ride(0.5e-6), NATIVE.make_advance(problem, settings)
    formed, errors = 50, np.zeros((501, 18))
    errors[formed] = find_deviations(other[0][[formed]], other[1][[formed]], exact[0][[formed]], exact[1][[formed]])[0]
    errors[formed + 1 :] = measure_step_errors(other[0][formed:], other[1][formed:], advance)
    assert errors[formed + 1 :, 11].sum() > 0.01  # m/s upwards
    deviation = find_deviations(other[0][-1:], other[1][-1:], exact[0][-1:], exact[1][-1:])[0, :3]
    sensitivity = measure_sensitivity(*exact, 5, 10, advance)
    assert np.linalg.norm(carry_errors(sensitivity, errors, 100) - deviation) < 0.1 * np.linalg.norm(deviation)
    coarse = measure_sensitivity(*exact, 50, 1, advance)
    assert np.linalg.norm(carry_errors(coarse, errors, 10) - deviation) > 0.3 * np.linalg.norm(deviation)


def test_a_distance_is_that_of_two_single_rides() -> None:
    (point,) = points(circle(), "mujoco-native", "velocities rounded")
    problem = make_start(load_scenario("plane-circle", {"simulation.duration": 1.0})[1]).problem
    engine = load_engine("mujoco-native")
    exact = ride_engine(engine, problem, engine.settings.model_validate({"tolerance": 1e-14}), lambda _: None)
    variant = engine.inner.single_precision.variants[2]  # type: ignore[attr-defined]
    settings = variant.engine.settings.model_validate({"tolerance": 1e-14, **variant.changes})
    rounded = ride_engine(variant.engine, problem, settings, lambda _: None)
    assert point["distance"] == pytest.approx(np.linalg.norm(rounded.q[-1, :3] - exact.q[-1, :3]), rel=1e-6)


@pytest.mark.parametrize(("rounded", "parts"), [("state", "qpos qvel"), ("positions", "qpos"), ("velocities", "qvel")])
def test_the_state_holds_numbers_of_float32(rounded: Any, parts: str) -> None:
    problem = make_start(load_scenario("plane-circle")[1]).problem
    rig = build_rounded_planes(problem, RoundedSettings(rounded=rounded))
    assert rig.stride == 1
    rig.follow()
    for name in ("qpos", "qvel"):
        numbers = getattr(rig.data, name)
        is_single = bool(np.all(numbers == numbers.astype(np.float32)))
        assert is_single == (name in parts.split()), name


def test_the_document_and_the_figure_are_written(tmp_path: Path) -> None:
    files = write_float32(circle(), tmp_path / "found")
    assert [file.name for file in files] == ["float32-plane-circle.json", "float32-plane-circle.png"]
    assert files[1].read_bytes().startswith(b"\x89PNG")
    assert contents(files[0])["engines"] == json.loads(json.dumps(circle()["engines"]))


@pytest.mark.parametrize(
    ("engines", "message"),
    [
        (
            ["exudyn"],
            "exudyn does not say with which engine in float64 to compare a float32; those that do are",
        ),
        (["exudyn", "mujoco-default"], "exudyn and mujoco-default do not say with which"),
        (["exudyn*"], "these engines do not say with which"),
        (["mujoco-naive"], "'mujoco-naive' is not installed"),
    ],
)
def test_engines_without_single_precision_are_refused(engines: list[str], message: str) -> None:
    with pytest.raises(ScenarioError, match=message) as caught:
        study("plane-circle", engines, 1.0)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "duration", "message"),
    [
        ("plane-circle", 0.1, "the duration is 0.1 s; it must be at least 0.2 s"),
        ("plane-circle", 3600.0, "must be at most 400 s"),
        pytest.param(
            *("waves", 8.0, r"ends at 7\..* s in float64: .*choose a shorter --duration"), marks=pytest.mark.slow
        ),
    ],
)
def test_rides_that_cannot_be_compared_are_refused(name: str, duration: float, message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        study(name, ["mujoco-native"], duration)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "duration"), [("plane-circle", 20.0), ("iftomm-2", 20.0), ("q1", 10.0)])
def test_last_digits_predict_the_distance(name: str, duration: float) -> None:
    """Steady, rolling straight on far from the origin, and unstable; without a number that is fitted."""
    point = points(study(name, ["mujoco-native"], duration, STARTS), "mujoco-native", "state rounded")[-1]
    # What a root mean square of STARTS draws may be, were each of one dimension only.
    low, high = np.sqrt(chi2.ppf([1e-4, 1 - 1e-4], STARTS) / STARTS)
    assert low < point["measured_to_predicted"] < high
    # Where the motion is unstable, distances are large enough for terms of second order.
    assert point["unexplained"] < 0.05 * point["distance"]


@pytest.mark.slow
def test_repeated_roundings_dominate_where_a_bicycle_rolls_straight_on() -> None:
    """Beyond 64 m every step of 9.2 mm is rounded the same way."""
    (*_, point) = points(study("iftomm-2", ["mujoco-native"], 20.0), "mujoco-native", "positions rounded")
    assert point["repeated_digits"] > 100 * point["unrelated_digits"]
    assert point["measured_to_predicted"] == pytest.approx(1, abs=0.1)


@pytest.mark.engines
def test_a_port_that_the_ground_does_not_suit_is_left_out() -> None:
    document = study("waves", None, 1.0)
    assert "closed form" in document["engines"]["mjx"]["reason"]
    assert document["engines"]["mujoco-native"]["reason"] is None
    assert all_rode_float32(document)
    with pytest.raises(ScenarioError, match="closed form"):
        study("waves", ["mjx"], 1.0)


@pytest.mark.engines
def test_a_port_is_compared_with_mujoco() -> None:
    document = study("plane-circle", ["mjx"], 1.0)
    (point,) = points(document, "mjx", "float32")
    assert document["engines"]["mjx"]["counterpart"] == "mujoco-native"
    assert 1e-8 < point["rms_distance"] < 1e-3
    assert point["unexplained"] < 0.02 * point["distance"]


@pytest.mark.engines
def test_mujoco_warp_is_compared_with_mujoco_at_its_own_tolerance() -> None:
    """1e-6 is the least that it knows; in double precision a ride at 1e-14 is no other one."""
    pytest.importorskip("mujoco_warp", reason="needs the extra warp")
    document = study("plane-circle", ["mujoco-warp"], 0.5)
    (point,) = points(document, "mujoco-warp", "float32")
    assert document["engines"]["mujoco-warp"]["counterpart"] == "mujoco-native"
    assert [entry["settings"]["tolerance"] for entry in document["double"]] == [1e-6]
    assert 1e-8 < point["rms_distance"] < 1e-3
    assert point["unexplained"] < 0.1 * point["distance"]
    problem = make_start(load_scenario("plane-circle", {"simulation.duration": 0.5})[1]).problem
    engine = load_engine("mujoco-native")
    loose, tight = (
        ride_engine(engine, problem, engine.settings.model_validate({"tolerance": tolerance}), lambda _: None)
        for tolerance in (1e-6, 1e-14)
    )
    assert np.abs(loose.q - tight.q).max() < 1e-3 * point["rms_distance"]
