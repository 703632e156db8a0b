"""Bicycles, grounds and motions at the edge of what there is: a right result or one line."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from complaints import refusing
from hypothesis import given, settings
from hypothesis import strategies as st

from velodrome.engines.registry import engine_names, load_engine
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.bowls import Cone, Sphere, Torus
from velodrome.reference.circular import CircularMotion
from velodrome.reference.contact import observe
from velodrome.reference.families import FAMILIES, find_motion, trace_all
from velodrome.reference.kernels.newton import LARGEST_RESIDUAL
from velodrome.reference.kernels.steady import STANDING
from velodrome.reference.kinematics import YAW
from velodrome.reference.profile import PolynomialProfile, SplineProfile
from velodrome.reference.simulate import simulate
from velodrome.reference.stability import growth_rate, linearise
from velodrome.reference.surface import Paraboloid, Plane, Surface, evaluate, has_tip
from velodrome.scenarios.error import ScenarioError
from velodrome.scenarios.run.runner import plan_run
from velodrome.scenarios.scenario.schema import validate_scenario
from velodrome.scenarios.scenario.start import Start, make_start
from velodrome.scenarios.scenario.surfaces import FLATTEST, make_bowl

PLANE = {"kind": "plane"}
UPRIGHT = {"kind": "upright", "speed": 5.0}
EDGES = [0.0, -0.0, 5e-324, 1e-300, 1e-12, 1e-9, 1e-3, 0.3, 1.0, 10.0, 1e3, 1e6, -1e-9, -1e-3, -0.1, -1.0, -1e6]


def start(surface: Mapping[str, Any], motion: Mapping[str, Any], **tables: Any) -> Start:
    data = {"title": "edge", "surface": surface, "motion": motion, "simulation": {"duration": 1.0}} | tables
    return make_start(validate_scenario(data, "a.toml"))


def assert_rides(found: Start) -> None:
    """The start is on all constraints, up to round-off of its lengths and speeds."""
    problem = found.problem
    q, qd = problem.q, problem.qd
    assert np.all(np.isfinite(q))
    assert np.all(np.isfinite(qd))
    assert np.isfinite(found.growth_rate)
    bicycle = problem.bicycle
    seen = observe(bicycle, problem.surface, q[None], qd[None])
    length = 1 + np.abs(q[:3]).max() + bicycle.wheelbase + bicycle.rear_wheel_radius + bicycle.front_wheel_radius
    speed = 1 + np.abs(qd).max() * length
    assert seen.found
    # Newton's method ends at 1e-13 of the lengths; speeds are solved from its Jacobian, whose condition is some 1e3.
    assert np.abs(seen.gap).max() < 1e-12 * length
    assert np.abs(seen.slip).max() < 1e-10 * speed
    if found.motion is not None:
        assert_steady(found.motion)


def assert_steady(motion: CircularMotion) -> None:
    sizes = (motion.position, motion.contact, motion.force / (Bicycle().mass * Bicycle().gravity))
    assert motion.residual <= LARGEST_RESIDUAL * (1 + max(np.abs(size).max() for size in sizes))


PARAMETERS = st.dictionaries(st.sampled_from(sorted(Bicycle.__dataclass_fields__)), st.sampled_from(EDGES), max_size=4)


@settings(max_examples=80)
@given(PARAMETERS)
def test_any_bicycle_stands_upright_on_the_plane_or_is_refused(parameters: dict[str, float]) -> None:
    with refusing():
        assert_rides(start(PLANE, UPRIGHT, bicycle=parameters))


@settings(max_examples=12)
@given(PARAMETERS, st.sampled_from(FAMILIES))
def test_any_bicycle_rides_a_circle_or_is_refused(parameters: dict[str, float], family: int) -> None:
    with refusing():
        motion = {"rear_rate": 10.0, "family": family}
        found = start({"kind": "paraboloid", "alpha": 0.01}, motion, bicycle=parameters)
        assert_rides(found)


@pytest.mark.slow
@settings(max_examples=300)
@given(PARAMETERS, st.sampled_from(FAMILIES), st.sampled_from([0.0, 1e-9, 0.005, 0.2, 10.0]))
def test_many_bicycles_ride_circles_or_are_refused(parameters: dict[str, float], family: int, alpha: float) -> None:
    with refusing():
        motion = {"rear_rate": 10.0, "family": family}
        assert_rides(start({"kind": "paraboloid", "alpha": alpha}, motion, bicycle=parameters))


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"front_wheel_mass": 0.0}, "front_wheel_I.*without mass"),
        ({"rear_wheel_mass": -2.0}, "rear_wheel_mass is -2.0; it must not be negative"),
        ({"rear_frame_Ixx": -1.0}, "rear_frame_I.*rigid body"),
        ({"rear_frame_Ixz": -20.0}, "rear_frame_I.*rigid body"),
        ({"front_wheel_Iyy": -0.1}, "front_wheel_I.*rigid body"),
        ({"wheelbase": 0.0}, "wheelbase is 0.0; it must be positive"),
        ({"steer_axis_tilt": 1.6}, "steer_axis_tilt is 1.6"),
        # The rear wheel has 0.3 m, and its centre is 1.7 m lower and 1.02 m behind.
        ({"front_wheel_radius": 2.0}, f"the wheels overlap by {1e3 * (2.3 - np.hypot(1.7, 1.02)):.3g} mm"),
    ],
)
def test_a_bicycle_that_cannot_be_is_refused(parameters: dict[str, float], words: str) -> None:
    with pytest.raises(ScenarioError, match=words):
        start(PLANE, UPRIGHT, bicycle=parameters)


@pytest.mark.parametrize(
    "parameters",
    [
        {"trail": 0.0},
        {"steer_axis_tilt": 0.0},
        {"trail": 0.0, "steer_axis_tilt": 0.0},
        {"front_wheel_radius": 0.3},
        {"front_wheel_radius": 2.0, "wheelbase": 2.0},
        {"front_wheel_mass": 1e-9, "front_wheel_Ixx": 1e-12, "front_wheel_Iyy": 2e-12},
    ],
    ids=repr,
)
def test_an_odd_bicycle_rides(parameters: dict[str, float]) -> None:
    found = start(PLANE, UPRIGHT | {"speed": 4.0}, bicycle=parameters, perturbation={"lean_rate": 0.05})
    assert_rides(found)
    problem = found.problem
    motion = simulate(problem.bicycle, problem.surface, problem.q, problem.qd, np.array([0.0, 0.5]))
    assert motion.ended is None
    seen = observe(problem.bicycle, problem.surface, motion.q, motion.qd)
    energy = seen.kinetic_energy + seen.potential_energy
    # Nothing dissipates: fifty steps or so of tolerance 1e-13, grown by e^(6 / s 0.5 s).
    assert abs(energy[1] - energy[0]) < 1e-10 * abs(energy[0])


def number(low: float) -> st.SearchStrategy[float]:
    return st.sampled_from([value for value in EDGES if value >= low])


GROUNDS = st.one_of(
    st.fixed_dictionaries({"kind": st.just("paraboloid"), "alpha": number(-1)}),
    st.fixed_dictionaries({"kind": st.just("sphere"), "radius": number(-1)}),
    st.fixed_dictionaries({"kind": st.just("cone"), "slope": number(-1), "rounding": number(0)}),
    st.fixed_dictionaries({"kind": st.just("torus"), "ring": number(-1), "tube": number(0)}),
    st.fixed_dictionaries({"kind": st.just("profile"), "coefficients": st.lists(st.sampled_from(EDGES), max_size=3)}),
    st.lists(number(-1e-9), max_size=4).map(
        lambda radii: {"kind": "profile", "radii": sorted(radii), "heights": [r * (1 + r) for r in sorted(radii)]}
    ),
)
MOTIONS = st.one_of(
    st.fixed_dictionaries({"rear_rate": number(0), "family": st.sampled_from(FAMILIES)}),
    st.fixed_dictionaries({"kind": st.just("upright"), "speed": number(0)}),
)


@settings(max_examples=25)
@given(GROUNDS, MOTIONS)
def test_any_ground_is_ridden_or_refused(ground: dict[str, Any], motion: dict[str, Any]) -> None:
    with refusing():
        assert_rides(start(ground, motion))


@pytest.mark.slow
@settings(max_examples=500)
@given(GROUNDS, MOTIONS)
def test_many_grounds_are_ridden_or_refused(ground: dict[str, Any], motion: dict[str, Any]) -> None:
    with refusing():
        assert_rides(start(ground, motion))


def growth(surface: Surface, motion: CircularMotion) -> float:
    q, qd = motion.state()
    return growth_rate(surface, linearise(Bicycle(), surface, q, qd).eigenvalues, float(qd[YAW]))


def test_a_bowl_tends_to_the_plane_as_it_flattens() -> None:
    level = find_motion(Bicycle(), Plane(), 18.0, 2)[1]
    shares = []
    for alpha in (1e-6, 1e-9, FLATTEST):
        motion = find_motion(Bicycle(), Paraboloid(alpha), 18.0, 2)[1]
        # To first order in alpha; its coefficients are of order ten.
        assert abs(motion.lean - level.lean) < 100 * alpha + 1e-12
        assert abs(motion.front_rate - level.front_rate) < 1e3 * alpha + 1e-10
        shares.append(growth(Paraboloid(alpha), motion) / alpha)
    # The circle's centre, free on the plane, is drawn to the axis at a rate of first order. Round-off of eigenvalues
    # is some 1e-14, of which the flattest bowl leaves a hundredth.
    assert shares[1] == pytest.approx(shares[0], rel=1e-4)
    assert shares[2] == pytest.approx(shares[0], rel=1e-2)


@pytest.mark.parametrize("alpha", [5e-324, 1e-300, 0.99 * FLATTEST])
def test_a_bowl_that_round_off_hides_is_refused(alpha: float) -> None:
    with pytest.raises(ScenarioError, match="must be 0, which is the plane, or at least 1e-12"):
        make_bowl(alpha)
    with pytest.raises(ScenarioError, match=r"surface\.alpha: must be 0, which is the plane"):
        start({"kind": "paraboloid", "alpha": alpha}, UPRIGHT)


@pytest.mark.parametrize(
    "surface",
    [
        pytest.param(Sphere(0.1), marks=pytest.mark.slow),  # four seconds
        *(Sphere(1e-6), Sphere(1e-300), Torus(0.0, 1e-300), Torus(1e-200, 1e-300)),
    ],
    ids=repr,
)
def test_no_bicycle_rides_in_a_bowl_smaller_than_itself(surface: Any) -> None:
    for family in FAMILIES:
        with pytest.raises(ValueError, match="no circular motion found"):
            find_motion(Bicycle(), surface, 5.0, family)


def test_a_cone_as_sharp_as_to_divide_by_zero_is_refused() -> None:
    with pytest.raises(ValueError, match="rounding is 1e-300; it must be a finite number >= 1e-100"):
        Cone(1.0, 1e-300)
    assert np.all(np.isfinite(evaluate(Cone(1.0, 1e-100), 0.0, 0.0)))
    with pytest.raises(ScenarioError, match=r"surface\.rounding: Input should be greater"):
        start({"kind": "cone", "slope": 1.0, "rounding": 1e-9}, UPRIGHT)


def test_radii_whose_squares_are_one_are_refused() -> None:
    with pytest.raises(ValueError, match=r"radii\[1\] is 1e-300; its square cannot be told from that of 0\.0"):
        SplineProfile((0.0, 1e-300, 1.0), (0.0, 0.1, 0.2))


def test_a_profile_of_a_thousand_numbers_has_a_short_name() -> None:
    assert len(str(PolynomialProfile((1e-6,) * 1000))) < 100
    radii = tuple(float(r) for r in range(1000))
    assert len(str(SplineProfile(radii, radii))) < 100


TIPPED = [Torus(2.0, 20.0), Torus(0.1, 20.0)]


@pytest.mark.parametrize("surface", TIPPED, ids=repr)
def test_curves_end_before_a_tip_however_long_the_steps(surface: Torus) -> None:
    assert has_tip(surface)
    found = []
    for longest in (0.05, 0.15):
        curves, absent = trace_all(Bicycle(), surface, longest)
        found.append(({(curve.number, curve.ends) for curve in curves}, absent))
        for curve in curves:
            sides = np.array([point.unknowns[11] for point in curve.points])
            # eta of the rear contact: no curve leads over the axis.
            assert np.all(sides > 0) or np.all(sides < 0)
            assert "pivot" not in curve.ends
    assert all(one == found[0] for one in found)
    numbers = {number for number, _ in found[0][0] if number is not None}
    assert numbers | set(found[0][1]) == set(FAMILIES)
    assert (3, ("flat", "tip")) in found[0][0]


def test_a_motion_on_a_tipped_trough_is_found() -> None:
    number, motion = find_motion(Bicycle(), Torus(2.0, 20.0), 8.0, 3)
    assert number == 3
    assert_steady(motion)


@pytest.mark.parametrize(
    "surface", [Sphere(20.0), Torus(0.0, 20.0), Torus(20.0, 2.0), Plane(), Paraboloid(0.005)], ids=repr
)
def test_what_is_smooth_on_the_axis_or_has_none_has_no_tip(surface: Any) -> None:
    assert not has_tip(surface)


@pytest.mark.parametrize(
    "ground",
    [
        {"kind": "profile", "radii": [0.0, 1.0, 2.0, 3.0], "heights": [0.0, 0.01, 0.04, 0.09]},
        {"kind": "sphere", "radius": 4.0},
        {
            "kind": "height-field",
            "spacing": 1.0,
            "origin": [-2.0, -3.0],
            "heights": [[0.1 * i * i] * 7 for i in range(6)],
        },
    ],
    ids=lambda ground: ground["kind"],
)
def test_a_ride_to_the_edge_of_the_ground_says_so(ground: dict[str, Any]) -> None:
    problem = start(ground, UPRIGHT | {"speed": 12.0}).problem
    motion = simulate(problem.bicycle, problem.surface, problem.q, problem.qd, problem.times)
    assert motion.ended is not None
    assert motion.ended.endswith("the ground ends under the front wheel")
    assert 0 < len(motion.time) < len(problem.times)


def test_a_fall_is_no_edge() -> None:
    problem = start(PLANE, UPRIGHT | {"speed": 0.5}, perturbation={"lean_rate": 1.0}).problem
    motion = simulate(problem.bicycle, problem.surface, problem.q, problem.qd, np.linspace(0, 20, 21))
    assert motion.ended is not None
    assert motion.ended.endswith("become singular")


@pytest.mark.parametrize("rate", [1e-300, 1e-12, 1e4])
@pytest.mark.parametrize("family", FAMILIES)
def test_a_very_slow_or_fast_motion_is_one_or_is_refused(rate: float, family: int) -> None:
    with refusing() as said:
        found = start({"kind": "paraboloid", "alpha": 0.005}, {"rear_rate": rate, "family": family})
        assert found.motion is not None
        # A rear wheel that is slower than this share of all three speeds together stands, but for round-off.
        speeds = found.motion.yaw_rate, found.motion.rear_rate, found.motion.front_rate
        standing = max(1e-12, 2 * STANDING * float(np.linalg.norm(speeds)))
        assert found.motion.rear_rate == pytest.approx(rate, rel=1e-9, abs=standing)
        assert_rides(found)
    # Family 2 ends in the pivoting motion on steep bowls only; at 1e4 rad/s the wheels' weight is nothing.
    assert (not said) == (rate < 1 and family != 2)


ODD = {
    "light front wheel": {"bicycle": {"front_wheel_mass": 1e-9, "front_wheel_Ixx": 1e-12, "front_wheel_Iyy": 2e-12}},
    "vertical axis, no trail": {"bicycle": {"trail": 0.0, "steer_axis_tilt": 0.0}},
    "a million g": {"bicycle": {"gravity": 1e6}},
    "10 km/s": {"motion": {"kind": "upright", "speed": 1e4}},
    "nearly at rest": {"motion": {"kind": "upright", "speed": 1e-12}},
    "one wheel close behind the other": {"bicycle": {"wheelbase": 0.66}},
}


@pytest.mark.slow
@pytest.mark.parametrize("name", engine_names())
@pytest.mark.parametrize("odd", ODD)
def test_every_engine_rides_the_odd_or_says_why_not(name: str, odd: str) -> None:
    data = {"title": odd, "surface": PLANE, "motion": UPRIGHT, "simulation": {"duration": 0.1}} | ODD[odd]
    plan = plan_run("odd", validate_scenario(data, "a.toml"), [name])
    engine, chosen = plan.engines[name]
    found = load_engine(name).simulate(plan.start.problem, chosen, lambda _: None)
    assert engine.name == found.engine
    assert found.ended is not None or len(found.time) == len(plan.start.problem.times)
