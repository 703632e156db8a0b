"""Two runs against each other: what is the same, what is not, and from when on."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from velodrome.engines.engine import Trajectory
from velodrome.reference.bicycle import BODIES, Bicycle
from velodrome.reference.families import find_motion
from velodrome.reference.kinematics import LEAN, REAR_ANGLE, YAW
from velodrome.reference.surface import Paraboloid
from velodrome.reports.measure.limits import START_ERROR, Scale
from velodrome.reports.measure.metrics import compute_metrics
from velodrome.reports.measure.steady import steady_trajectory
from velodrome.scenarios.compare.differences import StoredGround, StoredRun, diff_document
from velodrome.scenarios.compare.markdown import diff_markdown

BICYCLE, BOWL = Bicycle(), Paraboloid(0.005)
_, MOTION = find_motion(BICYCLE, BOWL, 18.0, 2, (0.74, 2.84))
STATE = MOTION.state()
TIMES = np.arange(101) / 10
STEADY = steady_trajectory(BICYCLE, MOTION, TIMES)
WHEELS = [BODIES.index(f"{wheel}_wheel") for wheel in ("rear", "front")]
# Fields that a steady ride does not hold get values of the right shape and size.
EXACT = replace(
    STEADY,
    engine="one",
    version="1",
    steps=1000,
    contact_point=STEADY.body_position[:, WHEELS],
    gap=np.zeros((len(TIMES), 2)),
    slip=np.zeros((len(TIMES), 2, 2)),
    kinetic_energy=np.full(len(TIMES), 1000.0),
    potential_energy=np.full(len(TIMES), 700.0),
)
SCALE = Scale(
    radius=float(np.hypot(*MOTION.position[:2])),
    speed=float(np.hypot(*STATE[1][:2])),
    rear_rate=18.0,
    growth_rate=0.1,
    duration=10.0,
    gravity=9.81,
    height=0.9,
)
STEP_NOISE = 1e-14


def limit(t: float) -> float:
    """As the module says: noise, its growth, and the share of the way [m]."""
    noise = (START_ERROR + STEP_NOISE * 100 * t) * np.exp(0.1 * t)
    return noise * (SCALE.radius + SCALE.speed * t)


def moved(size: float, growth: float = 0.0, begin: float = 0.0, **changes: Any) -> Trajectory:
    """The circle with D displaced along z, so that no drift but the distance tells."""
    q = EXACT.q.copy()
    q[:, 2] += np.where(begin <= TIMES, size * np.exp(growth * (TIMES - begin)), 0.0)
    return replace(EXACT, q=q, **changes)


def stored(name: str, *rides: Trajectory, failed: tuple[str, ...] = (), **changed: Any) -> StoredRun:
    engines = {ride.engine: {"version": ride.version, "settings": dict(ride.settings)} for ride in rides}
    engines |= {engine: {"version": "1", "settings": {}, "failed": "it broke"} for engine in failed}
    manifest = {
        "scenario": "q2",
        "title": "Q2",
        "created": "2026-01-01T00:00:00+00:00",
        "complete": True,
        "engines": engines,
        "libraries": {"numpy": "2"},
        "platform": {"machine": "x86_64"},
    }
    measured = {
        ride.engine: compute_metrics(ride, EXACT, BICYCLE, BOWL, SCALE.growth_rate, SCALE.radius, circular=True)
        for ride in rides
    }
    return StoredRun(name, manifest | changed, measured, {ride.engine: ride for ride in rides})


def compare(before: StoredRun, after: StoredRun, scale: Scale = SCALE) -> dict[str, Any]:
    names = {*before.manifest["engines"], *after.manifest["engines"]}
    return diff_document(before, after, StoredGround(BICYCLE, BOWL, scale), dict.fromkeys(names, STEP_NOISE))


def test_a_ride_is_the_same_to_the_bit_as_itself() -> None:
    found = compare(stored("a", EXACT), stored("b", replace(EXACT, cpu_time=9.0)))
    entry = found["engines"]["one"]
    assert (found["same"], entry["verdict"], entry["reasons"]) == (True, "same to the bit", [])
    assert (entry["position_difference"]["max"], entry["position_difference"]["begins_at"]) == (0, None)
    assert entry["metrics"]["cpu_time"]["change"] == 9.0
    assert entry["metrics"]["cpu_time"]["holds"] is None


def test_any_other_bit_is_seen() -> None:
    force = np.array(EXACT.contact_force)
    force[50, 0, 0] = np.nextafter(force[50, 0, 0], np.inf)
    found = compare(stored("a", EXACT), stored("b", replace(EXACT, contact_force=force)))
    assert (found["same"], found["engines"]["one"]["verdict"]) == (True, "same within round-off")


def test_whole_turns_of_yaw_and_wheels_are_no_difference() -> None:
    for name, column, verdict in (
        ("yaw", YAW, "same within round-off"),
        ("rear wheel", REAR_ANGLE, "same within round-off"),
        ("lean", LEAN, "differs"),
    ):
        q = EXACT.q.copy()
        q[30:, column] -= 2 * np.pi
        assert compare(stored("a", EXACT), stored("b", replace(EXACT, q=q)))["engines"]["one"]["verdict"] == verdict, (
            name
        )


def test_positions_may_differ_by_what_the_law_allows_and_no_more() -> None:
    within = compare(stored("a", EXACT), stored("b", moved(0.9 * limit(0.0))))
    assert within["engines"]["one"]["verdict"] == "same within round-off"
    beyond = compare(stored("a", EXACT), stored("b", moved(1.1 * limit(4.0), begin=4.0)))
    entry = beyond["engines"]["one"]
    assert (beyond["same"], entry["verdict"]) == (False, "differs")
    assert (entry["position_difference"]["begins_at"], entry["position_difference"]["exceeds_at"]) == (4.0, 4.0)
    assert entry["position_difference"]["end_limit"] == pytest.approx(limit(10.0), rel=1e-12)
    assert entry["reasons"][0].startswith("positions are apart by more than round-off from 4 s on")


def test_growth_beyond_the_motions_own_is_found_where_it_overtakes() -> None:
    size, growth = 1e-12, 2.0
    entry = compare(stored("a", EXACT), stored("b", moved(size, growth)))["engines"]["one"]
    overtaken = next(t for t in TIMES if size * np.exp(growth * t) > limit(t))
    assert entry["position_difference"]["exceeds_at"] == overtaken
    assert entry["position_difference"]["max_at"] == 10.0
    # What is added to a coordinate of 0.3 m is rounded there.
    assert entry["position_difference"]["end"] == pytest.approx(size * np.exp(20), rel=1e-7)


def test_a_metric_that_moves_beyond_its_limit_differs_although_positions_do_not() -> None:
    force = np.array(EXACT.contact_force) * (1 + 1e-6)
    entry = compare(stored("a", EXACT), stored("b", replace(EXACT, contact_force=force)))["engines"]["one"]
    assert entry["verdict"] == "differs"
    names = [reason.split(":")[0] for reason in entry["reasons"]]
    assert names[0].startswith("contact force (")
    assert "contact_force_error" in names
    assert entry["fields"]["contact_force"]["exceeds_at"] == 0.0


def test_beyond_what_growth_leaves_nothing_is_compared() -> None:
    scale = replace(SCALE, growth_rate=5.0)
    entry = compare(stored("a", EXACT), stored("b", moved(1.0, begin=8.0)), scale)["engines"]["one"]
    found = entry["position_difference"]
    # 1e-11 exp(5 t) (1 + speed t / radius) reaches 1 at some 4.6 s.
    assert found["horizon"] == found["compared_until"] == pytest.approx(4.6, abs=0.2)
    assert (entry["verdict"], {metric["holds"] for metric in entry["metrics"].values()}) == (
        "same within round-off",
        {None},
    )
    # Growth that no number holds is no error either.
    assert compare(stored("a", EXACT), stored("b", EXACT), replace(SCALE, growth_rate=500.0))["same"]


def test_an_early_end_differs() -> None:
    short = replace(EXACT.first(61), ended="the solver gave up")
    entry = compare(stored("a", EXACT), stored("b", short))["engines"]["one"]
    assert entry["verdict"] == "differs"
    assert "they end differently: at 10 s (its end) and at 6 s (the solver gave up)" in entry["reasons"]
    assert entry["position_difference"]["compared_until"] == 6.0


def test_positions_that_are_no_numbers_differ() -> None:
    entry = compare(stored("a", EXACT), stored("b", moved(np.nan, begin=5.0)))["engines"]["one"]
    assert (entry["verdict"], entry["position_difference"]["exceeds_at"]) == ("differs", 5.0)
    json.dumps(entry, allow_nan=False)


def test_a_fall_in_one_run_differs() -> None:
    fallen = EXACT.q.copy()
    fallen[80:, 2] -= 1.0
    entry = compare(stored("a", EXACT), stored("b", replace(EXACT, q=fallen)))["engines"]["one"]
    assert any(reason.startswith("fell_at: none -> ") for reason in entry["reasons"])


def test_an_engine_without_a_trajectory_differs_and_says_why() -> None:
    found = compare(stored("a", EXACT), stored("b", failed=("one",)))
    assert found["engines"]["one"]["reasons"] == ["gave no trajectory in b: it broke"]
    assert not found["same"]


def test_what_changed_is_said() -> None:
    other = replace(EXACT, version="2", settings={"step": 0.001, "kept": 1})
    run = replace(EXACT, settings={"step": 0.002, "kept": 1, "gone": True})
    two = replace(EXACT, engine="two")
    found = compare(stored("a", run, two), stored("b", other, replace(two, engine="three"), libraries={"numpy": "3"}))
    assert found["engines"]["one"]["version"] == ["1", "2"]
    assert found["engines"]["one"]["settings"] == {"step": [0.002, 0.001], "gone": [True, None]}
    assert found["differs"] == {"libraries": {"numpy": ["2", "3"]}, "platform": {}}
    assert (found["only_before"], found["only_after"]) == (["two"], ["three"])
    page = diff_markdown(found | {"notes": ["a note"]})
    for line in ("- version 1 -> 2", "- step 0.002 -> 0.001", "- libraries: numpy 2 -> 3", "- a note"):
        assert line in page
    assert "## one: same to the bit" in page


def test_a_metric_that_only_one_suite_knows_is_not_judged() -> None:
    before, after = stored("a", EXACT), stored("b", EXACT)
    older = {"one": {name: value for name, value in before.metrics["one"].items() if name != "fell_at"}}
    found = compare(replace(before, metrics=older), after)
    assert found["engines"]["one"]["metrics"]["fell_at"]["holds"] is None
    assert found["same"]


def changed(field: str, change: Callable[[np.ndarray], np.ndarray], begin: float = 0.0) -> Trajectory:
    """The circle with one field changed from a time on."""
    values = getattr(EXACT, field).copy()
    values[begin <= TIMES] = change(values[begin <= TIMES])
    return replace(EXACT, **{field: values})


ALONG_LEAN, ALONG_REAR_RATE = np.eye(9)[4], np.eye(9)[7]


@pytest.mark.parametrize(
    ("field", "change", "says"),
    [
        (
            "q",
            lambda q: q + 0.3 * ALONG_LEAN,
            "lean: apart by more than round-off from 4 s on, where .* is allowed, by up to 0.3 rad",
        ),
        ("qd", lambda qd: qd + 1e-3 * ALONG_REAR_RATE, "rear angle rate: .* by up to 0.001 rad/s"),
        (
            "body_position",
            lambda x: x + 0.2 * np.eye(3)[1],
            r"body position \(\S+ \S+ y and 3 more\): .* by up to 0.2 m",
        ),
        ("body_quaternion", lambda e: e[..., ::-1], "body quaternion .* from 4 s on"),
        ("contact_point", lambda x: x + 1e-6 * np.eye(3)[0], "contact point .* by up to 1e-06 m"),
        ("contact_force", lambda f: 1.01 * f, "contact force .* N"),
        ("gap", lambda gap: gap + 0.05, r"gap \(rear gap and 1 more\): .* by up to 0.05 m"),
        ("slip", lambda slip: slip + 1e-6, "slip .* by up to 1e-06 m/s"),
        ("kinetic_energy", lambda energy: 3 * energy, "kinetic energy: .* from 4 s on, .* J"),
        ("potential_energy", lambda energy: 3 * energy, "potential energy: .* from 4 s on, .* J"),
    ],
)
def test_every_stored_field_is_compared(field: str, change: Callable[[np.ndarray], np.ndarray], says: str) -> None:
    found = compare(stored("a", EXACT), stored("b", changed(field, change, begin=4.0)))
    entry = found["engines"]["one"]
    assert (found["same"], entry["verdict"]) == (False, "differs")
    assert {name for name, values in entry["fields"].items() if values["exceeds_at"] is not None} == {field}
    assert entry["fields"][field]["exceeds_at"] == 4.0
    assert any(re.match(says, reason) for reason in entry["reasons"]), entry["reasons"]
    assert f"| {field} |" in diff_markdown(found | {"notes": []})


@pytest.mark.parametrize(("field", "column", "size"), [("q", 4, 1.0), ("qd", 6, 18.0), ("qd", 0, SCALE.speed)])
def test_a_field_may_differ_by_what_the_law_allows_and_no_more(field: str, column: int, size: float) -> None:
    allowed = limit(6.0) / SCALE.radius * size
    for share, verdict in ((0.9, "same within round-off"), (1.1, "differs")):
        values = getattr(EXACT, field).copy()
        values[60, column] += share * allowed
        entry = compare(stored("a", EXACT), stored("b", replace(EXACT, **{field: values})))["engines"]["one"]
        assert (entry["verdict"], entry["fields"][field]["max_at"]) == (verdict, 6.0)
        assert entry["fields"][field]["allowed"] == pytest.approx(allowed, rel=1e-12)


def test_a_quaternion_and_its_opposite_are_one_orientation() -> None:
    opposite = replace(EXACT, body_quaternion=-EXACT.body_quaternion)
    entry = compare(stored("a", EXACT), stored("b", opposite))["engines"]["one"]
    assert (entry["verdict"], entry["fields"]["body_quaternion"]["max"]) == ("same within round-off", 0.0)


def test_a_field_of_one_run_alone_differs() -> None:
    for rides, only in (((EXACT, replace(EXACT, gap=None)), "before"), ((replace(EXACT, gap=None), EXACT), "after")):
        entry = compare(stored("a", rides[0]), stored("b", rides[1]))["engines"]["one"]
        assert entry["verdict"] == "differs"
        assert f"gap: only the run {only} has it" in entry["reasons"]
    bare = replace(EXACT, gap=None)
    assert "gap" not in compare(stored("a", bare), stored("b", bare))["engines"]["one"]["fields"]


def test_no_number_in_the_same_places_is_the_same() -> None:
    holes = [changed(field, lambda x: x * np.nan, begin=9.0) for field in ("q", "slip", "contact_force")]
    for ride in holes:
        twin = replace(ride, kinetic_energy=np.full(len(TIMES), np.nextafter(1000.0, 0)))  # not the same to the bit
        pair = stored("a", ride), stored("b", twin)
        entry = compare(*pair)["engines"]["one"]
        assert (entry["verdict"], entry["reasons"]) == ("same within round-off", [])
        entry = compare(stored("a", EXACT), stored("b", ride))["engines"]["one"]
        assert entry["verdict"] == "differs"
        json.dumps(entry, allow_nan=False)


def test_cpu_times_are_told_and_not_judged() -> None:
    found = compare(stored("a", replace(EXACT, cpu_time=2.0)), stored("b", replace(EXACT, cpu_time=3.0)))
    entry = found["engines"]["one"]
    assert entry["cpu_time"] == {"before": 2.0, "after": 3.0, "ratio": 1.5}
    assert found["same"]
    assert "- CPU time 2 s -> 3 s, 1.5 times" in diff_markdown(found | {"notes": []})
