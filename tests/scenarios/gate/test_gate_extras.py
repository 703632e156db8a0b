"""The gate on the engines whose libraries are extras: clean rides hold, and faults are caught."""

from __future__ import annotations

import pytest
from gating import failing, measure_rides_only, set_silently, verdicts_of, with_factors

from velodrome.engines.registry import default_engines, load_engine, uninstalled_engines
from velodrome.scenarios.gate import checks as gate
from velodrome.scenarios.gate.verdict import SHOWN
from velodrome.scenarios.scenario.schema import load_scenario

pytestmark = pytest.mark.engines

BASELINES = {name: gate.read_baseline(name) for name in gate.gated_names()}
EXTRAS = sorted({engine for entries in BASELINES.values() for engine in entries} - {*default_engines()})
DISTURBED = {"iftomm-2", "q2-plus"}  # on the plane and in a bowl; in steady circles some methods are exact by chance


@pytest.fixture(params=EXTRAS)
def engine(request: pytest.FixtureRequest) -> str:
    if request.param in uninstalled_engines():
        pytest.skip(f"needs its library: {uninstalled_engines()[request.param]}")
    return request.param


def test_a_clean_ride_holds_in_every_quantity(engine: str) -> None:
    rides = [name for name, entries in BASELINES.items() if engine in entries]
    assert {*rides} >= DISTURBED
    for scenario, verdicts in verdicts_of(engine, scenarios=rides).items():
        judged = [verdict for verdict in verdicts if verdict.quantity not in SHOWN]
        assert {verdict.status for verdict in judged} == {"holds"}, scenario
        plan = load_scenario(scenario)[1].gate
        order = plan is None or plan.order
        known = order and BASELINES[scenario][engine]["quantities"]["observed_order"] is not None
        assert ("observed_order" in {verdict.quantity for verdict in judged}) == known, scenario


def test_an_order_is_held_in_a_disturbed_ride(engine: str) -> None:
    entries = [BASELINES[scenario].get(engine) for scenario in DISTURBED]
    assert any(entry and entry["quantities"]["observed_order"] is not None for entry in entries)


def test_every_ride_has_the_bits_of_one_alone(engine: str) -> None:
    """The bits of MJX depend on how many rides it computes at once."""
    settings = [entries[engine]["settings"] for entries in BASELINES.values() if engine in entries]
    assert {found.get("batch_size", 1) for found in settings} == {1}


def test_a_bicycle_that_is_too_heavy_closes_the_gate(engine: str, monkeypatch: pytest.MonkeyPatch) -> None:
    measure_rides_only(monkeypatch)
    # The solvers of drake-native may leave 1e-6 of the momentum in a step, and limits are as wide.
    factor = 1.01 if BASELINES["iftomm-2"][engine]["step_noise"] < 1e-8 else 1.05
    verdicts = verdicts_of(engine, with_factors(rear_frame_mass=factor), ["iftomm-2"])["iftomm-2"]
    assert failing(verdicts) >= {"position_error"}


def test_a_doubled_step_closes_the_gate(engine: str, monkeypatch: pytest.MonkeyPatch) -> None:
    measure_rides_only(monkeypatch)
    step = load_engine(engine).settings.model_validate(BASELINES["iftomm-2"][engine]["settings"]).model_dump()["step"]
    verdicts = verdicts_of(engine, set_silently(step=2 * step), ["iftomm-2"])["iftomm-2"]
    assert failing(verdicts) >= {"position_error", "steps"}
