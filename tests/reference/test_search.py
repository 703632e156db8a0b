"""Curves of circular motions that no anchor leads to, held against a search from random starts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from velodrome.reference.anchors import above_ground
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.bowls import Cone, Sphere, Torus
from velodrome.reference.circular import LEAN, PITCH, SIGMA, STEER, Steady, as_solved, newton, rear_rate_condition
from velodrome.reference.continuation import Point, tangent
from velodrome.reference.families import find_motion, trace_all
from velodrome.reference.rideability import assess_motions
from velodrome.reference.search import guesses_at, is_on_curve
from velodrome.reference.sections import stable_sections
from velodrome.reference.surface import Paraboloid, Plane, SurfaceOfRevolution

# Meijaard et al. (2007); a measured bicycle of Moore (2012), "Silver"; one with a long trail.
SILVER = Bicycle(
    wheelbase=1.01,
    trail=0.19,
    steer_axis_tilt=0.366519143,
    rear_wheel_radius=0.35,
    rear_wheel_mass=2.6,
    rear_wheel_Ixx=0.078,
    rear_wheel_Iyy=0.156,
    rear_frame_x=0.32,
    rear_frame_z=0.627,
    rear_frame_mass=12.1,
    rear_frame_Ixx=0.8155,
    rear_frame_Iyy=1.2,
    rear_frame_Izz=1.0825,
    rear_frame_Ixz=-0.0327,
    front_frame_x=0.907,
    front_frame_z=0.8,
    front_frame_mass=2.5,
    front_frame_Ixx=0.086,
    front_frame_Iyy=0.1,
    front_frame_Izz=0.0169,
    front_frame_Ixz=0.0311,
    front_wheel_radius=0.349,
    front_wheel_mass=2.05,
    front_wheel_Ixx=0.081,
    front_wheel_Iyy=0.162,
)
BICYCLES = {"benchmark": Bicycle(), "silver": SILVER, "trail": replace(Bicycle(), trail=0.2)}
SURFACES: dict[str, SurfaceOfRevolution] = {
    "plane": Plane(),
    "flat bowl": Paraboloid(0.005),
    "steep bowl": Paraboloid(0.5),
    "wide sphere": Sphere(20.0),
    "sphere": Sphere(6.0),
    "cone": Cone(slope=0.3, rounding=0.5),
    "torus": Torus(ring=3.0, tube=9.0),
}


def random_motions(bicycle: Bicycle, surface: SurfaceOfRevolution, starts: int) -> list[np.ndarray]:
    """Circular motions that can be ridden, from random angles and rear rates by Newton's method alone."""
    random, equations = np.random.default_rng(7), Steady(bicycle, surface)
    found: list[np.ndarray] = []
    for _ in range(starts):
        lean, steer, rate = random.uniform(-1.5, 1.5), random.uniform(0.05, 3.09), random.uniform(0.5, 40.0)
        for guess in guesses_at(bicycle, surface, lean, steer):
            try:
                unknowns, _ = newton(equations, guess, rear_rate_condition(rate), most=30)
            except ValueError:
                continue
            unknowns[[LEAN, PITCH, STEER]] = (unknowns[[LEAN, PITCH, STEER]] + np.pi) % (2 * np.pi) - np.pi
            if unknowns[SIGMA] < 0 or not 0 < unknowns[STEER] < np.pi or not above_ground(equations, unknowns):
                continue
            unknowns = as_solved(unknowns)
            (ridden,) = assess_motions(bicycle, surface, unknowns[None]).physical
            if ridden and not any(np.allclose(unknowns, u, atol=1e-7) for u in found):
                found.append(unknowns)
    return found


def count_missed(bicycle: Bicycle, surface: SurfaceOfRevolution, starts: int) -> tuple[int, list[np.ndarray]]:
    curves, _ = trace_all(bicycle, surface)
    motions = random_motions(bicycle, surface, starts)
    equations = Steady(bicycle, surface)
    missed = [
        u
        for u in motions
        if not any(is_on_curve(equations, curve.points, Point(u, tangent(equations, u))) for curve in curves)
    ]
    return len(motions), missed


@pytest.mark.parametrize("surface", ["plane", "torus"])
def test_no_motion_of_a_random_search_is_missed(surface: str) -> None:
    motions, missed = count_missed(SILVER, SURFACES[surface], 40)
    assert motions >= 8
    assert missed == []


@pytest.mark.slow
def test_no_motion_of_a_long_random_search_is_missed() -> None:
    total, missed = 0, {}
    for name, bicycle in BICYCLES.items():
        for ground, surface in SURFACES.items():
            motions, lost = count_missed(bicycle, surface, 90)
            total += motions
            if lost:
                missed[name, ground] = lost
    assert total >= 400
    assert missed == {}


def test_a_motion_on_a_curve_without_a_number_is_found_near_its_angles() -> None:
    number, motion = find_motion(Bicycle(), SURFACES["torus"], 5.913, near=(0.2559, 2.3376))
    assert number is None
    assert (motion.lean, motion.steer) == pytest.approx((0.2559105, 2.3376157), abs=1e-6)


def test_a_long_trail_has_a_stable_section_that_families_left_behind() -> None:
    """On a bowl, on a curve that the benchmark's families do not reach."""
    curves, _ = trace_all(BICYCLES["trail"], Paraboloid(0.005), 0.05)
    unnumbered = [curve for curve in curves if curve.number is None]
    assert any(stable_sections(curve) for curve in unnumbered)


@pytest.mark.parametrize("surface", [Plane(), Paraboloid(0.5), Paraboloid(1.0)], ids=str)
def test_every_curve_is_listed_once(surface: SurfaceOfRevolution) -> None:
    curves, absent = trace_all(Bicycle(), surface)
    assert absent == {}
    assert sorted({number for curve in curves for number in curve.numbers}) == [1, 2, 3, 4]
    for k, curve in enumerate(curves):
        middle = curve.points[len(curve.points) // 2]
        others = [other for n, other in enumerate(curves) if n != k]
        assert not any(is_on_curve(curve.equations, o.points, middle) for o in others)


def test_a_family_that_a_bicycle_does_not_have_ends_in_a_fold() -> None:
    with pytest.raises(ValueError, match=r"family 2: its anchor ends in a fold .* at trail = 0\.06901"):
        find_motion(replace(Bicycle(), trail=0.06), Plane(), 18.0, family=2)


def test_a_search_that_finds_nothing_says_how_it_searched() -> None:
    with pytest.raises(ValueError, match=r"the nearest is at .*; searched were Newton's method from there"):
        find_motion(Bicycle(), Plane(), 1.0, near=(1.0, 3.0))


def test_a_small_wheel_may_turn_fast() -> None:
    """A front wheel of 50 mm turns at 200 rad/s where the bicycle rides at 10 m/s; no curve is cut there."""
    bicycle = replace(
        Bicycle(),
        wheelbase=1.9,
        front_wheel_radius=0.05,
        front_wheel_mass=0.3,
        front_wheel_Ixx=0.0002,
        front_wheel_Iyy=0.0004,
        front_frame_x=1.8,
        front_frame_z=0.5,
    )
    curves, _ = trace_all(bicycle, Paraboloid(0.005), 0.1)
    assert all(curve.numbers for curve in curves)
    assert min(len(curve.points) for curve in curves) > 20
    number, motion = find_motion(bicycle, Paraboloid(0.005), 40.0, 1)
    assert (number, find_motion(bicycle, Paraboloid(0.005), 40.0, near=(motion.lean, motion.steer))[0]) == (1, 1)
    assert abs(motion.front_rate) > 200
