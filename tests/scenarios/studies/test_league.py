"""The league: its figures held against single rides, laws and definitions; failures as rows; settings from a file."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from velodrome.engines.admission import ride_engine
from velodrome.engines.engine import DEFAULT_SETTINGS_SOURCE, REFERENCE, EngineError, Problem, describe_settings_source
from velodrome.engines.mujoco.native import ENGINE as NATIVE
from velodrome.engines.mujoco.settings import NativeSettings
from velodrome.engines.registry import default_engines, engine_names, load_engine
from velodrome.engines.releases import LibraryReach
from velodrome.reports.page import find_creeping, rank_rides
from velodrome.scenarios.error import ScenarioError
from velodrome.scenarios.run.runner import measure_one
from velodrome.scenarios.scenario.schema import load_scenario
from velodrome.scenarios.scenario.start import make_start
from velodrome.scenarios.studies.league import (
    GROWTH,
    LEAGUE_SCENARIOS,
    League,
    LeagueEngine,
    LeagueFolder,
    all_rode,
    equal_to_the_bit,
    plan_league,
    run_league,
)
from velodrome.scenarios.studies.league_settings import LeagueSettings, read_league_settings

CONTRACT = {
    *("position_error", "rate_error", "energy_drift", "radius_drift_rate", "mean_slip", "observed_order"),
    *("cpu_per_second", "fell_at", "same_bits_twice"),
}
ENGINES = ["mujoco-native", "exudyn-builtin"]
SHORT = {"simulation.duration": 0.5}


def plan(
    names: tuple[str, ...],
    engines: list[str],
    chosen: LeagueSettings | None = None,
    levels: int = 1,
    changes: Mapping[str, Any] = SHORT,
) -> League:
    return plan_league([load_scenario(name, dict(changes)) for name in names], engines, chosen, levels)


def run(league: League) -> dict[str, Any]:
    return run_league(league, lambda *_: None, lambda _: None)


@cache
def circles() -> dict[str, Any]:
    """Half a second on the plane and in the bowl, three steps."""
    return run(plan(("plane-circle", "q2-plus"), ENGINES, levels=3))


def test_the_document_has_the_contracts_fields() -> None:
    document = circles()
    assert list(document["engines"]) == [REFERENCE, "exudyn-builtin", "mujoco-native"]
    for entry in document["engines"].values():
        assert set(entry) >= {"version", "settings", "settings_source", "scenarios"}
        assert list(entry["scenarios"]) == ["plane-circle", "q2-plus"]
        assert all(set(ride) >= CONTRACT for ride in entry["scenarios"].values())
    assert document["complete"]
    assert all_rode(document)
    json.dumps(document, allow_nan=False)


def test_figures_are_those_of_a_single_ride() -> None:
    found = circles()["engines"]["mujoco-native"]["scenarios"]["q2-plus"]
    start = make_start(load_scenario("q2-plus", SHORT)[1])
    reference = load_engine(REFERENCE)
    yardstick = ride_engine(reference, start.problem, reference.settings(), lambda _: None)
    own = measure_one(start, ride_engine(NATIVE, start.problem, NativeSettings(), lambda _: None), yardstick)
    assert found["position_error"] == own["position_error"]["max"]
    for name in ("rate_error", "energy_drift", "radius_drift_rate", "mean_slip", "contact_force_error", "fell_at"):
        assert found[name] == own[name], name
    assert found["step"] == pytest.approx(NativeSettings().step, rel=1e-12)
    assert [point["step"] for point in found["points"]] == pytest.approx([0.002, 0.001, 0.0005], rel=1e-12)
    assert found["points"][0]["position_error"] == found["position_error"]
    assert found["cpu_per_second"] > 0


def test_the_order_lies_in_its_range() -> None:
    for name, order in (("mujoco-native", 1), ("exudyn-builtin", 2)):
        found = circles()["engines"][name]["scenarios"]["plane-circle"]
        least, largest = found["order_range"]
        assert least <= found["observed_order"] <= largest
        # The next power of the step adds up to a tenth of the error at these steps.
        assert found["observed_order"] == pytest.approx(order, abs=0.15)


def test_soft_contacts_creep_by_their_law_and_a_constraint_does_not() -> None:
    """1 / b = 0.95 steps for a time constant of two steps; softness at impratio 10 adds up to a tenth of 24 %."""
    document = circles()
    creeping = find_creeping(document, "plane-circle")
    assert list(creeping) == ["mujoco-native"]
    for step, time in creeping["mujoco-native"]:
        # After 0.2 s, fifty time constants and more, nothing is left of the start without slip.
        assert 0.95 * step < time < 0.95 * 1.024 * step
    rolling = document["engines"]["exudyn-builtin"]["scenarios"]["plane-circle"]
    assert rolling["creep"]["slip_time"] < 1e-3 * rolling["step"]


def test_an_unsuitable_ground_is_a_row_even_of_an_engine_that_is_named() -> None:
    found = circles()["engines"]["exudyn-builtin"]["scenarios"]["q2-plus"]
    assert found["status"] == "unsuitable"
    assert "level plane only" in found["reason"]
    assert found["position_error"] is None
    names = [name for name, _ in rank_rides(circles(), "q2-plus")]
    assert names == [REFERENCE, "mujoco-native", "exudyn-builtin"]


def test_rows_stand_by_error_and_falls_below_the_latest_first() -> None:
    def ride(status: str, error: float | None, fell: float | None = None) -> dict[str, Any]:
        return {"scenarios": {"s": {"status": status, "position_error": error, "fell_at": fell}}}

    engines = {
        "early": ride("fell", 1e-9, 1.0),
        "none": ride("failed", None),
        "worse": ride("rode", 2.0),
        "late": ride("fell", 5.0, 3.0),
        "better": ride("rode", 1.0),
        REFERENCE: ride("rode", None),
        "unreached": {"scenarios": {}},
    }
    names = [name for name, _ in rank_rides({"engines": engines}, "s")]
    assert names == [REFERENCE, "better", "worse", "late", "early", "none"]


def test_an_unstable_motion_is_ridden_until_its_growth_is_a_hundred() -> None:
    (stage,) = plan(("p2",), [REFERENCE], changes={}).scenarios
    simulation, rate = stage.scenario.simulation, stage.start.growth_rate
    assert rate > 0
    grown = math.log(GROWTH) / rate
    assert grown - 10 / simulation.output_rate < simulation.duration <= grown
    assert stage.start.problem.times[-1] == pytest.approx(simulation.duration)
    (stable,) = plan(("q2-plus",), [REFERENCE], changes={}).scenarios
    assert stable.scenario.simulation.duration == 20.0


def test_the_default_scenarios_are_stable_but_one() -> None:
    rates = [make_start(load_scenario(name)[1]).growth_rate for name in LEAGUE_SCENARIOS]
    assert [rate > 0 for rate in rates] == [False, False, False, True]


class Restless:
    """MuJoCo's native model, whose every ride is displaced by more than the one before."""

    name, version, gives, settings = "restless", "1", NATIVE.gives, NativeSettings
    bit_variants: Mapping[str, Mapping[str, Any]] = {}

    def __init__(self, drift: float = 0.0) -> None:
        self.drift, self.rides = drift, 0

    def check(self, problem: Problem, settings: Any) -> None:
        pass

    def step_noise(self, settings: Any) -> float:
        return 1e-8

    def simulate(self, problem: Problem, settings: Any, progress: Any) -> Any:
        self.rides += 1
        ride = NATIVE.simulate(problem, settings, progress)
        return replace(ride, engine=self.name, version="1", q=ride.q + self.drift * self.rides)


def entered(engine: Any, **settings: Any) -> League:
    league = plan(("plane-circle",), [REFERENCE])
    league.engines[engine.name] = LeagueEngine(engine, engine.settings(**settings), "a test")
    return league


def test_a_ride_that_does_not_repeat_itself_is_told() -> None:
    assert run(entered(Restless()))["engines"]["restless"]["scenarios"]["plane-circle"]["same_bits_twice"] is True
    changed = run(entered(Restless(1e-12)))["engines"]["restless"]["scenarios"]["plane-circle"]
    assert changed["same_bits_twice"] is False
    assert circles()["engines"][REFERENCE]["scenarios"]["plane-circle"]["same_bits_twice"] is True


def test_an_engines_variants_are_compared_with_its_ride() -> None:
    engine = Restless()
    engine.bit_variants = {"as it is": {}, "half the step": {"step": 0.001}, "no step": {"step": -1.0}}
    found = run(entered(engine))["engines"]["restless"]["scenarios"]["plane-circle"]
    assert found["same_bits_elsewhere"] == {"as it is": True, "half the step": False, "no step": None}


def test_rides_are_equal_only_in_every_array() -> None:
    problem = make_start(load_scenario("plane-circle", {"simulation.duration": 0.1})[1]).problem
    ride = ride_engine(NATIVE, problem, NativeSettings(), lambda _: None)
    assert equal_to_the_bit(ride, replace(ride, q=ride.q.copy(), cpu_time=ride.cpu_time + 1))
    assert ride.slip is not None
    assert not equal_to_the_bit(ride, replace(ride, slip=np.nextafter(ride.slip, 1.0)))
    assert not equal_to_the_bit(ride, replace(ride, gap=None))
    assert not equal_to_the_bit(ride, replace(ride, ended="early"))


def test_an_engine_that_fails_is_a_row_and_the_others_ride(monkeypatch: pytest.MonkeyPatch) -> None:
    engine = Restless()

    def fail(*_: Any) -> None:
        raise EngineError("it has no wheels")

    monkeypatch.setattr(engine, "simulate", fail)
    league = entered(engine)
    league.engines["absent"] = LeagueEngine(None, None, None, "cannot be loaded: no library")
    league.engines["native"] = league.engines.pop("restless")  # the others come after it
    traced = []
    document = run_league(
        league, lambda *_: None, lambda _: None, lambda name, error: traced.append((name, str(error)))
    )
    assert document["engines"]["native"]["scenarios"]["plane-circle"]["reason"] == "it has no wheels"
    assert document["engines"]["absent"]["scenarios"]["plane-circle"]["reason"] == "cannot be loaded: no library"
    assert document["engines"]["absent"]["fault"] == "cannot be loaded: no library"
    assert document["engines"][REFERENCE]["scenarios"]["plane-circle"]["status"] == "rode"
    assert document["complete"]
    assert not all_rode(document)
    assert traced == [("restless", "it has no wheels")]


def test_a_step_that_fits_no_output_interval_is_a_row() -> None:
    league = plan(("plane-circle",), ["mujoco-native"])
    engine = league.engines["mujoco-native"].engine
    league.engines["mujoco-native"] = LeagueEngine(engine, NativeSettings(step=0.0017), "a test")
    found = run(league)["engines"]["mujoco-native"]["scenarios"]["plane-circle"]
    assert found["status"] == "failed"
    assert "must divide the output interval" in found["reason"]


def test_ctrl_c_keeps_the_finished_rides_and_every_ride_is_stored() -> None:
    stored: list[Mapping[str, Any]] = []

    def press(engine: str, *_: Any) -> None:
        if engine == "mujoco-native":
            raise KeyboardInterrupt

    document = run_league(plan(("plane-circle",), ENGINES), press, stored.append)
    assert not document["complete"]
    assert not all_rode(document)
    rode = {name: list(entry["scenarios"]) for name, entry in document["engines"].items()}
    assert rode == {REFERENCE: ["plane-circle"], "exudyn-builtin": ["plane-circle"], "mujoco-native": []}
    assert [sum(map(len, (e["scenarios"] for e in one["engines"].values()))) for one in stored] == [1, 2]


def test_what_a_row_says_does_not_depend_on_the_other_rows() -> None:
    alone = run(plan(("plane-circle",), ["mujoco-native"], levels=3))["engines"]["mujoco-native"]
    beside = circles()["engines"]["mujoco-native"]

    def without_cost(ride: dict[str, Any]) -> dict[str, Any]:
        points = [{k: v for k, v in point.items() if not k.startswith("cpu")} for point in ride["points"]]
        return {k: v for k, v in ride.items() if k != "cpu_per_second"} | {"points": points}

    assert without_cost(alone["scenarios"]["plane-circle"]) == without_cost(beside["scenarios"]["plane-circle"])


def test_all_engines_take_part_where_none_is_named_and_the_suites_own_name_their_source() -> None:
    league = plan_league([load_scenario("plane-circle")], None, None)
    assert list(league.engines) == engine_names()
    for name in default_engines():
        assert league.engines[name].settings_source not in (None, DEFAULT_SETTINGS_SOURCE), name
    assert describe_settings_source(Restless()) == DEFAULT_SETTINGS_SOURCE


def test_a_file_replaces_settings_and_names_its_source(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(
        '[engines.mujoco-native]\nstep = 0.001\nsource = "the manual"\n[engines.exudyn-builtin]\nstep = 0.002\n'
    )
    chosen = read_league_settings(tmp_path / "mine.toml")
    league = plan(("plane-circle",), ENGINES, chosen)
    assert league.settings_file == "mine.toml"
    entries = {name: entry.as_json({}) for name, entry in league.engines.items()}
    assert entries["mujoco-native"]["settings"] == NativeSettings(step=0.001).model_dump(mode="json")
    assert entries["mujoco-native"]["settings_source"] == "mine.toml: the manual"
    assert entries["exudyn-builtin"]["settings_source"] == "mine.toml, which names no source"
    assert entries[REFERENCE]["settings_source"] == describe_settings_source(load_engine(REFERENCE))


def test_what_is_left_out_for_an_old_release_is_in_the_document(monkeypatch: pytest.MonkeyPatch) -> None:
    engines = plan(("plane-circle",), ENGINES).engines
    assert "left_out" not in engines["exudyn-builtin"].as_json({})
    monkeypatch.setattr(LibraryReach, "version", property(lambda _: "1.10.0"))
    assert list(engines["exudyn-builtin"].as_json({})["left_out"]) == ["first_force"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[engines.mujoco-native]\nstep = 1.0\n", "engines.mujoco-native.step"),
        ("[engines.mujoco-native]\nstop = 0.001\n", "step"),
        ("[engines.mujoco-nativ]\nstep = 0.001\n", "did you mean 'mujoco-native'?"),
        ("[mujoco-native]\nstep = 0.001\n", "tables are [engines.NAME]"),
        ('[engines.mujoco-native]\nsource = "two\\nlines"\n', "engines.mujoco-native.source must be one line of text"),
        ("engines.mujoco-native = 3\n", "must be a table of settings"),
        ("", "it has no table [engines.NAME]"),
        ("[engines", "not valid TOML"),
    ],
)
def test_a_wrong_file_of_settings_is_refused_in_one_line(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(ScenarioError) as caught:
        read_league_settings(path)
    assert said in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_scenarios_with_settings_of_engines_and_unknown_engines_are_refused() -> None:
    scenario = load_scenario("plane-circle", {"engines.mujoco-native.step": 0.001})
    with pytest.raises(ScenarioError, match="put them into a file for --settings"):
        plan_league([scenario], None, None)
    with pytest.raises(ScenarioError, match="did you mean 'exudyn'"):
        plan_league([load_scenario("plane-circle")], ["exudin"], None)
    twice = [load_scenario("plane-circle"), load_scenario("plane-circle", SHORT)]
    with pytest.raises(ScenarioError, match="two scenarios have this name"):
        plan_league(twice, None, None)


def test_the_folder_has_the_document_and_the_page(tmp_path: Path) -> None:
    written = list(LeagueFolder(tmp_path / "out").finish(circles()))
    assert [path.name for path in written] == ["league.json", "league.html"]
    document = json.loads(written[0].read_text())
    assert document.pop("schema_version") == 1
    assert document == json.loads(json.dumps(circles()))
    assert written[1].read_text().startswith("<!doctype html>")


@pytest.mark.slow
def test_every_installed_engine_rides_the_default_scenarios() -> None:
    scenarios = [load_scenario(name, {"simulation.duration": 1.0}) for name in LEAGUE_SCENARIOS]
    document = run(plan_league(scenarios, None, None))
    assert all_rode(document)
    for name, entry in document["engines"].items():
        for scenario, ride in entry["scenarios"].items():
            if ride["status"] == "rode":
                assert ride["same_bits_twice"], (name, scenario)
                assert (ride["position_error"] is None) == (name == REFERENCE)
            else:
                assert ride["status"] in ("unsuitable", "fell", "ended"), (name, scenario, ride["reason"])
    # The one law of creep on the plane: 0.95 steps and up to a tenth of 24 % for soft contacts, see above.
    for points in find_creeping(document, "plane-circle").values():
        assert all(0.9 * step < time for step, time in points)
