"""The page of a run: whole, escaped, readable without eyes, and seen in a browser."""

from __future__ import annotations

import base64
import hashlib
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import headless_page as headless
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from parsed_page import Parsed, check_accessible_names
from PIL import Image

from velodrome.engines.engine import REFERENCE, Trajectory
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.height_field import HeightField
from velodrome.reference.surface import Paraboloid
from velodrome.reports.drawing.palette import PALETTE, assign_colours
from velodrome.reports.drawing.plots import PLOTS, RideData
from velodrome.reports.drawing.samples import choose_samples
from velodrome.reports.drawing.summary import COLUMNS, format_table, format_verdict
from velodrome.reports.measure.metrics import compute_metrics
from velodrome.reports.page import make_page
from velodrome.reports.page.curves import GROUPS, NOT_FINITE, NOT_GIVEN, THE_MEASURE, TOO_SMALL, make_curve
from velodrome.reports.page.document import list_engine_styles
from velodrome.reports.page.findings import (
    NEVER,
    NOTED,
    describe_growth,
    explain_error,
    list_findings,
    write_headline,
)
from velodrome.reports.page.ink import CONTRAST, DASHES, line_dashes, luminance, make_css, paper_colour
from velodrome.reports.page.plan import draw_plan
from velodrome.reports.page.trust import explain_columns, list_meanings
from velodrome.reports.page.words import (
    describe_bicycle,
    describe_disturbance,
    describe_ground,
    describe_motion,
    describe_own_steps,
    describe_setting,
    keep_whole,
)

BOWL = Paraboloid(0.005)
HOSTILE = "<script>alert(1)</script>"
GROWTH = 0.4


def ride(engine: str, samples: int = 301, error: float = 0.0, seed: int = 0) -> Trajectory:
    """A circle of 2.4 m, noise on all that can be noisy, and an error that grows."""
    noise = np.random.default_rng(seed)
    time = np.arange(samples) * 0.01
    q, qd = np.zeros((samples, 9)), np.zeros((samples, 9))
    angle = 2.2 * time + error * time
    q[:, 0], q[:, 1] = 2.4 * np.cos(angle), 2.4 * np.sin(angle)
    q[:, 4], q[:, 6], qd[:, 7] = 0.74 + error * time, 2.84, 18.0 - error * time
    height = BOWL.alpha * 2.4**2
    point = np.zeros((samples, 2, 3))
    point[:, :, :2], point[:, :, 2] = q[:, None, :2], height
    body = np.repeat(q[:, None, :3] + [0, 0, 0.9], 4, axis=1)
    return Trajectory(
        engine=engine,
        version="1.2.3",
        settings={"step": 0.001},
        time=time,
        q=q,
        qd=qd,
        body_position=body,
        body_quaternion=np.tile([1.0, 0, 0, 0], (samples, 4, 1)),
        contact_point=point,
        contact_force=np.array([0, 0, 500.0]) + noise.normal(size=(samples, 2, 3)),
        gap=1e-14 * noise.normal(size=(samples, 2)),
        slip=1e-12 * noise.normal(size=(samples, 2, 2)),
        kinetic_energy=1000 + 1e-9 * noise.normal(size=samples),
        potential_energy=np.full(samples, 800.0),
        steps=samples,
        cpu_time=0.1,
    )


RUNS = {
    REFERENCE: ride(REFERENCE),
    "one": ride("one", error=1e-4, seed=1),
    "short": ride("short", samples=61, error=-0.05, seed=2),
    "bare": replace(
        ride("bare", error=0.01, seed=3),
        **dict.fromkeys(("contact_point", "contact_force", "gap", "slip", "kinetic_energy", "potential_energy")),
    ),
}


def measured(runs: dict[str, Trajectory]) -> dict[str, dict[str, Any]]:
    reference = runs.get(REFERENCE)
    where = (Bicycle(), BOWL, GROWTH, 2.4, True)
    return {name: compute_metrics(run, None if run is reference else reference, *where) for name, run in runs.items()}


def made(runs: dict[str, Trajectory] | None = None, verdicts: Any = (), **changes: Any) -> str:
    runs = RUNS if runs is None else runs
    engines = {
        name: {
            "version": run.version,
            "settings": run.settings,
            "cpu_time": run.cpu_time,
            "steps": run.steps,
            "ended": run.ended,
        }
        for name, run in runs.items()
    }
    manifest = {
        "scenario": "ride",
        "title": "Once around",
        "created": "2026-01-02T03:04:05+00:00",
        "complete": True,
        "engines": engines | changes.pop("engines", {}),
        "libraries": {"velodrome": "0.1.0", "numpy": "2.4"},
        "platform": {"system": "Linux", "machine": "x86_64", "python": "3.11"},
        "start": {"family": 2, "growth_rate": GROWTH},
    }
    scenario = {
        "surface": {"kind": "paraboloid", "alpha": 0.005},
        "motion": {"kind": "circular", "rear_rate": 18.0},
        "perturbation": {"lean_rate": 0.1},
        "simulation": {"duration": 3.0, "output_rate": 100.0},
    } | changes.pop("tables", {})
    surface, docs = changes.pop("surface", BOWL), changes.pop("docs", None)
    return make_page(manifest | changes, scenario, measured(runs), verdicts, runs, surface, docs)


@pytest.fixture(scope="module")
def text() -> str:
    return made()


@pytest.fixture(scope="module")
def parsed(text: str) -> Parsed:
    return Parsed(text)


def test_the_table_has_the_summarys_figures(parsed: Parsed) -> None:
    values = measured(RUNS)
    cells = [found for _, found in parsed.all("td")]
    for name in RUNS:
        row = format_table(values)[name]
        assert any(cells[k : k + len(row)] == row for k in range(len(cells))), name
    heads = [found for _, found in parsed.all("th")]
    assert {title for title, *_ in COLUMNS} <= set(heads)
    assert {metric for _, _, metric, _ in COLUMNS} <= {key for key, *_ in list_meanings(False)}


def test_input_is_text_and_never_markup() -> None:
    name = '"><img src=x onerror=alert(1)>'
    reason = "</script><b>{{ 7 * 7 }}</b>"
    runs = {REFERENCE: RUNS[REFERENCE], name: replace(RUNS["one"], engine=name, settings={"a</table>": "<i>&"})}
    shown = made(
        runs,
        title=HOSTILE,
        scenario="<u>",
        engines={"<s>": {"version": "<q>", "settings": {}, "failed": reason}},
        left_out={"<del>": "<ins>"},
        libraries={"<kbd>": "<samp>"},
    )
    parsed = Parsed(shown)
    assert [found for _, found in parsed.all("h1")] == [HOSTILE]
    assert len(parsed.all("script")) == 2
    assert not parsed.all("img", "i", "u", "s", "q", "del", "ins", "kbd", "samp")
    assert all(found.startswith("Figure") for _, found in parsed.all("b"))
    assert parsed.data()["engines"] == list(runs)
    assert any(reason in found for _, found in parsed.all("li"))


def test_the_page_needs_nothing_from_elsewhere(text: str, parsed: Parsed) -> None:
    assert set(re.findall(r"https?://[^\s\"'<)]+", text)) == {"http://www.w3.org/2000/svg"}  # a name, not an address
    addresses = [value for _, attrs, _ in parsed.elements for key, value in attrs.items() if key in ("href", "src")]
    assert all(a == "comparison.rrd" or (a or "").startswith(("#", "data:")) for a in addresses)
    script = text.rpartition("<script>")[2].partition("</script>")[0]
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    policy = next(a["content"] for a, _ in parsed.all("meta") if "http-equiv" in a) or ""
    assert f"script-src 'sha256-{digest}'" in policy
    assert "default-src 'none'" in policy


def test_the_page_can_be_read_without_eyes(parsed: Parsed) -> None:
    check_accessible_names(parsed)
    assert all(attrs.get("aria-pressed") == "true" for attrs, _ in parsed.all("button"))


def test_what_went_wrong_is_said() -> None:
    verdicts = [
        {"engine": "one", "quantity": "energy_variation", "value": 2.0, "limit": 1.0, "holds": False},
        {"engine": REFERENCE, "quantity": "energy_variation", "value": 1e-9, "limit": 1.0, "holds": True},
    ]
    parsed = Parsed(
        made(
            verdicts=verdicts,
            engines={"broken": {"version": "9", "settings": {}, "failed": "no luck"}},
            left_out={"flat": "rolls on a plane only"},
            complete=False,
        )
    )
    said = [found for _, found in parsed.all("li")]
    assert f"✗ {format_verdict(verdicts[0])}" in said
    assert f"✓ {format_verdict(verdicts[1])}" in said
    assert "✗ broken did not run: no luck" in said
    assert "– flat left out: rolls on a plane only" in said
    assert any("interrupted" in found for _, found in parsed.all("dd"))


def test_a_run_without_a_trajectory_has_a_page() -> None:
    parsed = Parsed(made({}, engines={"broken": {"version": "9", "settings": {"step": 1.0}, "failed": "no luck"}}))
    assert parsed.data() == {"duration": 3.0, "engines": [], "stops": {}, "panels": [], "plan": None}
    assert not parsed.all("figure")


def test_what_the_scenario_lacks_is_not_shown() -> None:
    straight = {"motion": {"kind": "upright", "speed": 4.6}, "criterion": {"energy_variation": 1.0}}
    waves = HeightField(tuple((0.01 * (i % 2),) * 40 for i in range(40)), 1.0, (-20.0, -20.0))
    shown = made(tables=straight, surface=waves)
    assert "radius" not in {panel["key"] for panel in Parsed(shown).data()["panels"]}
    assert "no verdict on the scenario's criterion" in shown
    assert "On this ground no motion is steady" in shown
    plain = made()
    assert "sets no criterion" in plain
    assert "Nothing is steady on this ground" not in plain


def test_every_panel_has_a_plot_and_what_an_engine_lacks_is_absent(parsed: Parsed) -> None:
    keys = {panel.key for _, panels in GROUPS for panel in panels}
    assert keys <= {plot.key for plot in PLOTS}
    panels = {panel["key"]: panel for panel in parsed.data()["panels"]}
    assert set(panels) == keys
    bare = str(list(RUNS).index("bare"))
    assert {key for key, panel in panels.items() if bare in panel["curves"]} == {
        *("log_position_error", "lean", "steer", "rear_rate", "radius")
    }
    assert len(parsed.all("figure")) == len(keys) + 1  # and the ride from above


def test_a_curve_in_the_page_is_the_trajectorys(parsed: Parsed) -> None:
    data = parsed.data()
    lean = next(panel for panel in data["panels"] if panel["key"] == "lean")["curves"]["1"]
    # Seven digits are kept.
    np.testing.assert_allclose(np.interp(lean["t"], RUNS["one"].time, RUNS["one"].q[:, 4]), lean["v"], rtol=5e-7)
    assert data["duration"] == RUNS[REFERENCE].time[-1]
    trail = data["plan"]["trails"]["0"]
    np.testing.assert_allclose(np.hypot(trail["x"], trail["y"]), 2.4, rtol=1e-4)  # five digits of each


def test_the_horizon_is_shown_where_it_says_something(parsed: Parsed) -> None:
    # All horizons lie beyond the end of this run: nothing is shown.
    error = next(panel for panel in parsed.data()["panels"] if panel["key"] == "log_position_error")
    assert all(values["horizon"] > 3.0 for name, values in measured(RUNS).items() if name != REFERENCE)
    assert error["marks"] == []
    assert "horizon" not in [found for _, found in parsed.all("th")]
    # It is off by the size of the motion before the end.
    q = RUNS["bare"].q.copy()
    q[200:, :2] *= -1
    far = RUNS | {"far": replace(RUNS["bare"], engine="far", q=q)}
    values = measured(far)
    assert values["far"]["horizon"] < 3.0
    shown = Parsed(made(far))
    error = next(panel for panel in shown.data()["panels"] if panel["key"] == "log_position_error")
    assert error["marks"] == [{"engine": list(far).index("far"), "t": values["far"]["horizon"]}]
    assert "horizon" in [found for _, found in shown.all("th")]
    assert f"up to {values['far']['horizon']:.2f} s" in [found for _, found in shown.all("td")]


@given(
    st.lists(st.one_of(st.floats(-1e3, 1e3), st.just(float("nan"))), max_size=200).map(np.array),
    st.integers(4, 60),
)
def test_no_extreme_is_lost(values: np.ndarray, most: int) -> None:
    values = values.astype(float)
    chosen = choose_samples(values, most)
    finite = np.flatnonzero(np.isfinite(values))
    assert len(chosen) <= most
    assert np.all(np.diff(chosen) > 0)
    if len(finite):
        assert {finite[0], finite[-1]} <= set(chosen)
        assert (values[chosen].min(), values[chosen].max()) == (np.nanmin(values), np.nanmax(values))
    else:
        assert len(chosen) == 0


def test_a_gap_in_a_curve_stays_a_gap() -> None:
    values = np.array([1.0, 2.0, np.nan, np.nan, 3.0, 4.0])
    assert make_curve(np.arange(6.0), values, 10) == {"t": [0, 1, 4, 4, 5], "v": [1, 2, None, 3, 4]}


def test_the_page_stays_under_two_megabytes() -> None:
    # Noise with holes: as many points as can be, and a break between each two.
    runs = {name: ride(name, 2001, 1e-3 * k, k) for k, name in enumerate([REFERENCE, *"abcdefghij"])}
    for run in runs.values():
        assert run.slip is not None
        run.slip[::2] = np.nan
    assert len(made(runs).encode()) < 2e6


def test_engines_are_told_apart_on_paper() -> None:
    names = [REFERENCE, *"abcdefgh"]
    for name, colour in assign_colours(names).items():
        assert 1.05 / (luminance(paper_colour(name, colour)) + 0.05) >= CONTRAST
    assert len({paper_colour("a", colour) for colour in PALETTE}) == len(PALETTE)
    assert luminance((255, 255, 255)) == pytest.approx(1.0, abs=1e-12)
    patterns = line_dashes(names)
    assert patterns[REFERENCE] == ""
    assert [patterns[name] for name in "abcdefgh"] == list(DASHES)
    many = [REFERENCE, *(f"engine {k}" for k in range(2 * len(PALETTE)))]
    styles = [(style["dash"], style["shape"]) for style in list_engine_styles(many)[1:]]
    assert len(set(styles)) == len(styles)  # without a colour
    assert len({style["paper"] for style in list_engine_styles(many)}) == len(many)


def test_what_ran_is_said_in_words() -> None:
    assert describe_ground({"kind": "plane"}) == "level plane"
    assert describe_ground({"kind": "sphere", "radius": 20.0}) == "sphere, radius 20.0"
    assert len(describe_ground({"kind": "height-field", "heights": [[0.0] * 100] * 100})) < 120
    assert describe_motion({"kind": "upright", "speed": 4.6}) == "straight and upright, 4.6 m/s"
    assert describe_motion({"kind": "circular", "rear_rate": 18.0}) == "circle with the rear wheel at 18 rad/s"
    assert describe_disturbance({"x": 0.0, "lean_rate": -0.1}) == "lean rate -0.1 rad/s"
    assert describe_disturbance({}) == "nothing"
    assert describe_bicycle({"wheelbase": 1.1}).endswith("with wheelbase 1.1")
    assert [describe_setting(value) for value in (None, True, 0.001, [0.9, 2.0], "dop853")] == [
        *("not set", "true", "0.001", "0.9, 2.0", "dop853")
    ]


@pytest.mark.parametrize(
    ("growth", "horizon", "error", "says"),
    [
        (-0.1, None, {"max": 1.0}, "amplifies no error"),
        (0.4, 5.0, {"max": 1.0}, "Up to 5.00 s"),
        (0.4, 50.0, {"max": 1.0}, "longer than the run"),
        (0.4, None, {"max": 0.0}, "to the last digit"),
        (0.4, None, None, "no reference in this run"),
    ],
)
def test_trust_follows_from_the_metrics(growth: float, horizon: float | None, error: Any, says: str) -> None:
    assert says in explain_columns("one", {"horizon": horizon, "position_error": error}, growth, 20.0)


@pytest.mark.parametrize(
    ("growth", "horizon", "changes", "end", "says"),
    [
        (-0.1, None, {}, 20.0, "own, over the whole run."),
        (-0.1, None, {"fell_at": 3.217}, 3.22, "own, up to its fall at 3.22 s."),
        (-0.1, None, {"ended": "it gave up"}, 6.1, "own, up to its early end at 6.10 s."),
        (-0.1, None, {"ended": "it gave up"}, None, "own, up to its early end."),
        (0.4, 5.0, {"fell_at": 3.0}, 3.1, "longer than it rode: it is seen up to its fall at 3.00 s."),
        (0.4, 2.0, {"fell_at": 3.0}, 3.1, "Up to 2.00 s the error"),
        (0.4, None, {"ended": "it gave up"}, 6.1, "to the last digit up to its early end at 6.10 s:"),
    ],
)
def test_trust_goes_no_further_than_the_ride(
    growth: float, horizon: float | None, changes: dict[str, Any], end: float | None, says: str
) -> None:
    values = {"horizon": horizon, "position_error": {"max": 1.0}, "fell_at": None, "ended": None} | changes
    assert says in explain_columns("one", values, growth, 20.0, end)


def test_bounds_of_the_reference_are_rounded_up() -> None:
    values = {"energy_drift": 5.01e-13, "max_gap": 1.3004e-14, "max_slip": 9.91e-12}
    said = explain_columns(REFERENCE, values, 0.4, 20.0)
    for words in ("at most 5.1e-13 of itself", "within 1.4e-14 m", "within 1e-11 m/s"):
        assert words in said
    said = explain_columns(REFERENCE, {"energy_drift": 0.0, "max_gap": 1.3e-14, "max_slip": None}, 0.4, 20.0)
    assert "at most 0 of itself, its gaps stay within 1.3e-14 m." in said


def test_a_fall_is_said_where_the_figures_count_a_sample_more() -> None:
    lying = RUNS["one"].q.copy()
    lying[200:, 2] -= 1.0
    fallen = made({REFERENCE: RUNS[REFERENCE], "one": replace(RUNS["one"], q=lying)})
    said = " ".join(fallen.split())
    assert "what fell or ended early (one) is drawn to its end" in said
    assert "up to the first sample after its fall" in said
    assert "what fell or ended early (" not in made()
    rows = [found for _, found in Parsed(fallen).all("th")]
    assert rows.count("one ✕ fell at 1.99 s") == 1 + len(GROUPS[0][1]) + len(GROUPS[1][1]) + len(GROUPS[2][1])


def test_the_first_lines_tell_who_drifts_from_when_why_and_how_far() -> None:
    runs = {name: run for name, run in RUNS.items() if name != "short"}
    ride_data, values = RideData(BOWL, runs), measured(runs)
    found = {row.name: row for row in list_findings(values, ride_data, 3.0)}
    assert list(found) == list(format_table(values))
    for name in ("one", "bare"):
        error = np.linalg.norm(RUNS[name].q[:, :3] - RUNS[REFERENCE].q[: len(RUNS[name].time), :3], axis=1)
        first = np.flatnonzero(error > NOTED)
        assert found[name].since == (f"{RUNS[name].time[first[0]]:.2f}" if len(first) else NEVER)
        assert float(found[name].error) == pytest.approx(error.max(), rel=0.1)
    assert found["one"].since == NEVER
    assert found[REFERENCE].cause.startswith("the measure of the others")
    said = write_headline(values, ride_data, GROWTH, 3.0)
    assert said.startswith("bare drifts most: ")
    assert f"from {found['bare'].since} s on" in said
    assert f"What goes with it: {found['bare'].cause}." in said
    assert "one stays closest" in said
    assert [text for attrs, text in Parsed(made(runs)).all("p") if attrs.get("class") == "headline"] == [said]
    # Equal errors are told together: both turn by 0.03 rad too far or too little.
    assert write_headline(measured(RUNS), RideData(BOWL, RUNS), GROWTH, 3.0).startswith("short and bare drift most: ")
    without = measured({"one": RUNS["one"]})
    assert "no reference in this run" in write_headline(without, RideData(BOWL, {"one": RUNS["one"]}), GROWTH, 3.0)


def test_what_fell_drifts_least_and_most_of_all_never() -> None:
    values = measured(RUNS)
    values["bare"] |= {"fell_at": 1.0}
    values["short"] |= {"ended": "it gave up"}
    said = write_headline(values, RideData(BOWL, RUNS), GROWTH, 3.0)
    assert said.startswith("Of the engines that ride to the end, one drifts most: ")
    assert "bare fell at 1.00 s." in said
    assert "short ended at 0.60 s." in said
    found = {row.name: row for row in list_findings(values, RideData(BOWL, RUNS), 3.0)}
    assert found["bare"].until.endswith("fell at 1.00 s")
    assert not found["bare"].stays_up


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({}, "its steps or its model; slip is 0.02 m in all"),
        ({"mean_slip": 0.03}, "its wheels slip, 0.3 m in all"),  # 0.3 m are half of the error and more
        ({"friction_left_at": 0.1, "required_friction": 1.01, "friction": 0.7}, "needs a friction of 1.01, it has 0.7"),
        ({"unconverged_steps": 3, "steps": 100}, "not converged in 3 of 100 steps"),
        ({"position_error": {"max": 0.0}}, "to the last digit"),
        ({"position_error": None}, "–"),
        ({"mean_slip": None}, "not known"),
    ],
)
def test_what_goes_with_an_error_follows_from_the_metrics(changes: dict[str, Any], says: str) -> None:
    assert says in explain_error({"position_error": {"max": 0.6}, "mean_slip": 0.002} | changes, 10.0)


def test_growth_is_told_where_it_matters() -> None:
    assert describe_growth(0.1, 20.0) is None  # 7.4
    assert describe_growth(-1.0, 20.0) is None
    assert describe_growth(0.3845, 20.0) == "The motion itself multiplies any error by 2200 in 20 s."
    assert "by 1.0e+304 in" in str(describe_growth(1e6, 20.0))  # and does not overflow


def test_nothing_given_too_small_and_fallen_are_told_apart() -> None:
    exact = replace(RUNS["one"], gap=np.zeros_like(RUNS["one"].gap))
    lost = replace(RUNS["one"], gap=np.full_like(RUNS["one"].gap, np.nan))
    parsed = Parsed(made({REFERENCE: RUNS[REFERENCE], "exact": exact, "lost": lost, "bare": RUNS["bare"]}))
    absent = {panel["key"]: panel["absent"] for panel in parsed.data()["panels"]}
    assert absent["rear_log_gap"] == {"1": TOO_SMALL, "2": NOT_FINITE, "3": NOT_GIVEN}
    assert absent["log_position_error"] == {"0": THE_MEASURE}
    assert absent["lean"] == {}
    cells = [found for _, found in parsed.all("td")]
    assert {TOO_SMALL, NOT_GIVEN, NOT_FINITE, THE_MEASURE} <= set(cells)


def test_the_plan_holds_the_rides_that_stay_up() -> None:
    away = RUNS["one"].q.copy()
    away[:, :2] *= 50
    runs = {REFERENCE: RUNS[REFERENCE], "away": replace(RUNS["bare"], q=away)}
    shown = draw_plan(RideData(BOWL, runs), list(runs), [REFERENCE])
    alone = draw_plan(RideData(BOWL, {REFERENCE: RUNS[REFERENCE]}), [REFERENCE], [REFERENCE])
    assert shown is not None
    assert alone is not None
    assert shown["box"] == alone["box"]
    assert len(shown["trails"]["1"]["x"]) > 0
    everything = draw_plan(RideData(BOWL, runs), list(runs), list(runs))
    none_up = draw_plan(RideData(BOWL, runs), list(runs), [])
    assert everything is not None
    assert none_up is not None
    assert everything["box"] == none_up["box"]
    assert everything["box"][2] > 10 * shown["box"][2]


def test_steps_that_are_not_the_settings_are_told() -> None:
    engines = {
        "own": {"settings": {"step": 0.001}, "steps": 300, "ended": None},
        "fixed": {"settings": {"step": 0.01}, "steps": 300, "ended": None},
        "short": {"settings": {"step": 0.001}, "steps": 3, "ended": "it gave up"},
        "failed": {"settings": {"step": 0.001}, "failed": "no luck"},
    }
    assert list(describe_own_steps(engines, 3.0)) == ["own"]
    assert describe_own_steps(engines, 3.0)["own"] == "0.001, but it took 0.01 on average"
    # Every ride of this run has 301 samples and as many steps in 3 s, but its settings say 0.001 s.
    assert [text for _, text in Parsed(made()).all("td")].count("0.001, but it took 0.01 on average") == 3


def test_quantities_lead_to_their_definitions_and_to_the_documentation() -> None:
    parsed = Parsed(made())
    ids = {attrs["id"] for _, attrs, _ in parsed.elements if "id" in attrs}
    for _, _, metric, _ in COLUMNS:
        assert f"meaning-{metric}" in ids
    documented = Parsed(made(docs="https://velodrome.example/docs"))
    links = {attrs.get("href") for attrs, _ in documented.all("a")}
    for key, *_ in list_meanings(False):
        assert f"https://velodrome.example/docs/reference/metrics.html#metric-{key}" in links


def test_names_are_kept_whole() -> None:
    found = keep_whole("a-b and a-b-c: <", ["a-b", "a-b-c"])
    assert found == '<span class="whole">a-b</span> and <span class="whole">a-b-c</span>: &lt;'
    assert keep_whole("<", []) == "&lt;"


# In a browser.

needs_browser = pytest.mark.skipif(headless.missing() is not None, reason=str(headless.missing()))


@pytest.fixture(scope="module")
def address(text: str, tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("page") / "report.html"
    path.write_text(text, encoding="utf-8")
    return path.as_uri()


def pixels(path: Path) -> dict[str, int]:
    """Number of pixels of each exact colour."""
    picture = np.asarray(Image.open(path).convert("RGB")).astype(int)
    codes, counts = np.unique(picture @ [65536, 256, 1], return_counts=True)
    return {f"#{code:06x}": int(count) for code, count in zip(codes, counts, strict=True)}


@needs_browser
@pytest.mark.parametrize("dark", [False, pytest.param(True, marks=pytest.mark.slow)], ids=["light", "dark"])
def test_an_engine_that_is_switched_off_is_not_seen(address: str, dark: bool, tmp_path: Path) -> None:
    paint = assign_colours(RUNS)
    ink = {name: make_css(paint[name] if dark else paper_colour(name, paint[name])) for name in RUNS}
    size = (1280, 7000 if dark else 4600)  # the tables, the toolbar, the ride from above and some curves; or all
    assert headless.picture(address, tmp_path / "all.png", dark, size) == []
    everything = pixels(tmp_path / "all.png")
    hidden = ["one", "bare"]
    assert headless.picture(f"{address}#hide={','.join(hidden)}", tmp_path / "some.png", dark, size) == []
    some = pixels(tmp_path / "some.png")
    for name, colour in ink.items():
        # A line of 28 by 3 pixels beside the name stands at least six times in the page.
        assert everything.get(colour, 0) > 6 * 28, name
        assert (some.get(colour, 0) == 0) == (name in hidden), name


@needs_browser
def test_a_view_can_be_passed_on_by_its_address(address: str) -> None:
    parsed = Parsed(headless.document(f"{address}#hide=short&t=1.5"))
    assert [attrs["aria-pressed"] for attrs, _ in parsed.all("button")] == ["true", "true", "false", "true"]
    assert [found for _, found in parsed.all("output")] == ["1.50 s"]
    slider = next(attrs for attrs, _ in parsed.all("input"))
    assert slider["aria-valuetext"] == "1.50 s"
    lean = f"{RUNS['one'].q[150, 4]:#.6g}"
    # It lies on the reference, within a hundredth of the axis.
    assert any(found == f"{REFERENCE} = one 0.740000 / {lean}" for _, found in parsed.all("li"))
    # Not served by the suite's own server, it asks for no viewer.
    assert not parsed.all("iframe")


@needs_browser
def test_complaints_of_a_page_are_heard(tmp_path: Path, text: str) -> None:
    broken = tmp_path / "broken.html"

    def said() -> str:
        return "\n".join(headless.picture(broken.as_uri(), tmp_path / "p.png", size=(500, 300)))

    broken.write_text("<script>undefined_function()</script>", encoding="utf-8")
    assert "undefined_function" in said()
    # A script that is not the page's own does not run.
    broken.write_text(text.replace("<h1>", "<script>document.title = 'no'</script><h1>"), encoding="utf-8")
    assert "Content Security Policy" in said()


def with_a_fallen_one(wild: float) -> dict[str, Trajectory]:
    """Five rides, two of them the same, and one that falls at 2 s after it has leaned by a wild angle."""
    q, qd = RUNS["bare"].q.copy(), RUNS["bare"].qd.copy()
    q[150:, 4] += wild
    q[150:, :2] *= 1 + wild
    qd[150:, 7] -= 100 * wild
    q[200:, 2] -= 1.0
    twin = replace(RUNS["one"], engine="twin")
    return RUNS | {"twin": twin, "fallen": replace(RUNS["bare"], engine="fallen", q=q, qd=qd).first(201)}


_LOOKING = """
const figures = [...document.querySelectorAll("figure[data-panel]")];
const each = (look) => Object.fromEntries(figures.map((figure) => [figure.dataset.panel, look(figure)]));
const texts = (where, selector) => [...where.querySelectorAll(selector)].map((found) => found.textContent.trim());
const bottom = (selector) => document.querySelector(selector).getBoundingClientRect().bottom;
const lean = figures.find((figure) => figure.dataset.panel === "lean");
return {
  ticks: each((figure) => texts(figure, ".tick.y")),
  crosses: each((figure) => figure.querySelectorAll(".stop").length),
  curves: each((figure) => figure.querySelectorAll("svg path[stroke^=var]").length),
  dashes: [...lean.querySelectorAll("path[stroke-dashoffset]")].map((path) =>
    ["stroke", "stroke-dasharray", "stroke-dashoffset"].map((name) => path.getAttribute(name))),
  readout: texts(lean, ".readout li"),
  together: texts(lean, ".together")[0],
  box: document.querySelector(".map svg").getAttribute("viewBox"),
  mapCrosses: document.querySelectorAll(".map .stop").length,
  bottoms: [".headline", ".findings", ".map svg", "figure[data-panel=log_position_error] .plot"].map(bottom),
};"""


@needs_browser
def test_a_ride_that_falls_rules_no_axis_and_engines_that_coincide_are_shown(tmp_path: Path) -> None:
    runs = with_a_fallen_one(3.0)
    upright = {name: run for name, run in runs.items() if name != "fallen"}
    seen, without = (headless.examine(made(each), _LOOKING, tmp_path) for each in (runs, upright))
    assert seen["ticks"] == without["ticks"]
    assert seen["box"] == without["box"]
    for key in ("log_position_error", "lean", "steer", "rear_rate", "radius"):
        assert seen["crosses"][key] == 1, key
        assert without["crosses"][key] == 0, key
        assert seen["curves"][key] == without["curves"][key] + 1, key
    assert seen["mapCrosses"] == 1
    # The fallen one is told where the others have values, and those that coincide stand together.
    assert any(line.startswith("fallen ✕ fell at 1.4") for line in seen["readout"])
    together = f"{REFERENCE} = one = twin"
    assert any(line.startswith(together) for line in seen["readout"])
    assert seen["together"] == f"On one another: {REFERENCE}, one, twin."
    # Both have turns of their own: equal dashes, each in the other's gap.
    assert [dash for _, *dash in seen["dashes"]] == [["9 9", "0"], ["9 9", "-9"]]
    assert len({ink for ink, *_ in seen["dashes"]}) == 2
    # All of this is on the first screen.
    assert all(bottom <= 900 for bottom in seen["bottoms"])


@pytest.mark.slow
@needs_browser
def test_the_page_fits_into_400_pixels_and_is_printed_on_four_sheets(tmp_path: Path) -> None:
    runs = with_a_fallen_one(0.5) | {f"engine-of-a-long-name-{k}": ride("bare", error=1e-3 * k) for k in (1, 2)}
    page = made(runs)
    assert headless.measure_width(page, 400, tmp_path) <= 400
    path = tmp_path / "report.html"
    path.write_text(page, encoding="utf-8")
    assert headless.count_printed_pages(path.as_uri(), tmp_path / "report.pdf") <= 4


@pytest.mark.skipif(headless.missing_axe() is not None, reason=str(headless.missing_axe()))
@pytest.mark.parametrize("dark", [False, pytest.param(True, marks=pytest.mark.slow)], ids=["light", "dark"])
def test_the_page_can_be_used_by_everyone(dark: bool, tmp_path: Path) -> None:
    verdicts = [
        {"engine": "one", "quantity": "energy_variation", "value": 2.0, "limit": 1.0, "holds": False},
        {"engine": REFERENCE, "quantity": "energy_variation", "value": 1e-9, "limit": 1.0, "holds": True},
    ]
    page = made(with_a_fallen_one(0.5), verdicts, docs="https://velodrome.example")
    assert headless.find_violations(page, tmp_path, dark) == []


@pytest.mark.slow
@pytest.mark.skipif(headless.missing_axe() is not None, reason=str(headless.missing_axe()))
def test_what_not_everyone_can_use_is_found(text: str, tmp_path: Path) -> None:
    broken = text.replace("<h1>", '<p style="color: #888; background: #777">faint</p><button></button><h1>')
    assert {line.partition(":")[0] for line in headless.find_violations(broken, tmp_path)} == {
        *("color-contrast", "button-name")
    }
