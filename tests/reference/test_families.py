"""The curves of circular motions: where they run, their special points, where they are stable."""

from functools import cache

import numpy as np
import pytest

from tests.literature import published, rounds_to
from velodrome.reference.anchors import anchor, static_equilibria
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.circular import LEAN, REAR_SPEED, SIGMA, STEER, Steady, rear_rate_condition
from velodrome.reference.continuation import FARTHEST, LARGEST_LEAN, crossings, largest_sigma, root_between
from velodrome.reference.families import FAMILIES, Family, find_motion, find_motions, front_rate_slope, trace, trace_all
from velodrome.reference.modes import follow_modes
from velodrome.reference.profile import SplineProfile
from velodrome.reference.sections import growth_along, sample_family, stable_sections
from velodrome.reference.special import SpecialPoint, special_points
from velodrome.reference.surface import Paraboloid

BICYCLE = Bicycle()
PRINTED = published("xiong2020")
ALPHAS = (0.0, 0.005, 0.011, 1 / 33, 0.05, 0.2, 0.5, 1.0)


@cache
def family(alpha: float, number: int, longest: float = 0.1) -> Family:
    return trace(BICYCLE, Paraboloid(alpha), number, longest)


@cache
def everything(alpha: float) -> list[Family]:
    curves, absent = trace_all(BICYCLE, Paraboloid(alpha), 0.1)
    assert not absent
    return curves


def special(alpha: float, number: int, name: str) -> SpecialPoint:
    return next(point for point in special_points(family(alpha, number)) if point.name == name)


@pytest.mark.parametrize("number", FAMILIES)
@pytest.mark.parametrize("alpha", ALPHAS)
def test_every_point_of_every_family_is_a_motion(alpha: float, number: int) -> None:
    curve = family(alpha, number)
    motions = [curve.equations.motion(point.unknowns) for point in curve.points]
    # The residual's rows are of order one, but for heights and speeds on the large circles far up the bowl.
    size = [1 + np.abs(point.unknowns).max() for point in curve.points]
    assert max(motion.residual / s for motion, s in zip(motions, size, strict=True)) < 1e-12
    steps = np.diff([[motion.lean, motion.steer] for motion in motions], axis=0)
    assert np.abs(steps).max() <= 0.2, "a jump to another branch"


@pytest.mark.parametrize(
    ("alpha", "number", "ends"),
    [
        # Families 2 and 4 exchange their far ends where the cusps D and I collide,
        (0.011, 2, ("large circle", "flat")),
        (0.011, 4, ("pivot", "fast front wheel")),
        (1 / 33, 2, ("fast front wheel", "flat")),
        (1 / 33, 4, ("pivot", "large circle")),
        # families 1 and 3 theirs between 1/5 and 1/2,
        (0.2, 1, ("large circle", "static")),
        (0.2, 3, ("pivot", "flat")),
        (0.5, 1, ("large circle", "flat")),
    ],
)
def test_families_reconnect_as_the_bowl_gets_steeper(alpha: float, number: int, ends: tuple[str, str]) -> None:
    assert family(alpha, number).ends == ends


SHALLOW = [
    (1, "large circle", "static"),
    (2, "large circle", "flat"),
    (3, "pivot", "flat"),
    (4, "pivot", "fast front wheel"),
]
DEEPER = [  # families 2 and 4 have exchanged their far ends
    (1, "large circle", "static"),
    (2, "fast front wheel", "flat"),
    (3, "pivot", "flat"),
    (4, "pivot", "large circle"),
]
CURVES = {
    **dict.fromkeys((0.0, 0.005, 0.011), SHALLOW),
    **dict.fromkeys((1 / 33, 0.05, 0.2), DEEPER),
    0.5: [
        (1, "large circle", "flat"),  # from B to F: family 3 has no other forward part
        (2, "pivot", "flat"),
        (3, "pivot", "fast front wheel"),
        (4, "large circle", "large circle"),  # C, and slow circles
        (1, "static", "large circle"),  # A, and slow circles
    ],
    1.0: [
        (1, "large circle", "large circle"),  # B, and slow circles
        (2, "pivot", "flat"),
        (3, "pivot", "flat"),
        (3, "flat", "static"),  # from F to A
        (4, "large circle", "large circle"),
    ],
}


@pytest.mark.parametrize("alpha", ALPHAS)
def test_every_curve_is_followed_from_one_kind_of_end_to_another(alpha: float) -> None:
    assert [(curve.number, *curve.ends) for curve in everything(alpha)] == CURVES[alpha]


@pytest.mark.parametrize("alpha", ALPHAS)
def test_no_curve_stops_in_nowhere(alpha: float) -> None:
    """An end is solved for, or beyond what a curve is followed to: else the shortest steps had failed there."""
    fastest = largest_sigma(BICYCLE)
    for curve in everything(alpha):
        for kind, point in zip(curve.ends, (curve.points[0], curve.points[-1]), strict=True):
            u = point.unknowns
            reached = {
                "static": abs(u[SIGMA]) < 1e-12,
                "pivot": abs(u[REAR_SPEED]) < 1e-12,
                "large circle": np.linalg.norm(u[:3]) > FARTHEST,
                # A fast one may lie as flat only further on.
                "flat": abs(u[LEAN]) > LARGEST_LEAN or u[SIGMA] > fastest,
                "fast front wheel": u[SIGMA] > fastest,
            }
            assert reached[kind], (curve.number, kind, u[: SIGMA + 1])


@pytest.mark.parametrize("alpha", [0.5, 1.0])
def test_further_curves_share_no_motion_with_another(alpha: float) -> None:
    curves = everything(alpha)
    for i, further in enumerate(curves[len(FAMILIES) :], len(FAMILIES)):
        middle = further.points[len(further.points) // 2].unknowns
        for other in curves[:i]:
            gaps = [np.abs(p.unknowns - middle)[[LEAN, STEER, SIGMA]].max() for p in other.points]
            # Points lie 0.1 apart along the arc.
            assert min(gaps) > 0.1, (further.number, other.number)


def test_a_further_curve_is_found_through_the_anchor_that_lies_on_it() -> None:
    """At alpha = 1 the rear rate of 20 on family 3 is on the curve from F to A, not on the one from G."""
    start = anchor(BICYCLE, Paraboloid(1.0), 3, 20.0)
    own, further = (curve for curve in everything(1.0) if curve.number == 3)
    on_own, on_further = (
        [u for u in crossings(curve.equations, curve.points, start.condition) if start.is_same_as(u)]
        for curve in (own, further)
    )
    assert (len(on_own), len(on_further)) == (0, 1)


@pytest.mark.parametrize("number", [3, 4])
def test_the_pivoting_motion_has_any_rear_rate_of_round_off(number: int) -> None:
    """Its rear speed is exactly zero at a curve's end, where the squared rate has no slope."""
    curve = family(0.005, number)
    pivots = [point.unknowns for point in curve.points if point.unknowns[REAR_SPEED] == 0]
    assert len(pivots) == 1
    (found,) = crossings(curve.equations, curve.points, rear_rate_condition(1e-12))
    np.testing.assert_array_equal(found, pivots[0])


@pytest.mark.parametrize(
    ("alpha", "steers"),
    # A alone; with those that have come in from the rim, the first with the handlebar reversed; with A gone.
    [(0.0, [1.3397]), (0.2, [1.4722]), (0.36, [1.5469, 2.6782]), (0.45, [0.6629, 1.6544, 2.0174]), (0.5, [0.9848])],
)
def test_static_equilibria(alpha: float, steers: list[float]) -> None:
    equations = Steady(BICYCLE, Paraboloid(alpha))
    found = static_equilibria(equations)
    assert [round(float(u[STEER]), 4) for u in found] == steers
    for u in found:
        motion = equations.motion(u)
        # At rest the ground carries the weight alone.
        assert motion.force[:, 2].sum() == pytest.approx(BICYCLE.mass * BICYCLE.gravity, rel=1e-12)
        assert motion.residual < 1e-12


def test_motions_of_further_curves_come_after_those_of_the_anchors() -> None:
    steep = Paraboloid(1.0)
    pivoting, reversed_circle = find_motions(BICYCLE, steep, 4, 20.0)
    assert find_motion(BICYCLE, steep, 20.0, 4)[1].steer == pivoting.steer
    number, near = find_motion(BICYCLE, steep, 20.0, near=(reversed_circle.lean + 0.01, reversed_circle.steer))
    assert (number, near.steer) == (4, reversed_circle.steer)
    # While that anchor lies on another family's curve, or on this one's own, there are no further motions.
    assert find_motions(BICYCLE, Paraboloid(0.005), 2, 26.4)
    assert not find_motions(BICYCLE, Paraboloid(0.005), 4, 26.4)


def test_a_family_has_a_further_curve_where_its_own_is_gone() -> None:
    """At alpha = 0.44 there is no pivoting motion, but circles that tend to C."""
    curves, absent = trace_all(BICYCLE, Paraboloid(0.44))
    assert list(absent) == [3]
    assert [(c.number, *c.ends) for c in curves if c.number == 4] == [(4, "static", "large circle")]
    (motion,) = find_motions(BICYCLE, Paraboloid(0.44), 4, 18.0)
    assert motion.front_rate < 0


def test_points_between_neighbours_are_found_where_steps_turn_much() -> None:
    """A step turns by what the metric of its own start says: on this dish by more than it may, seen from behind."""
    dish = SplineProfile((0.0, 3.225, 9.416, 10.602, 15.466), (0.0, 0.1241, 0.3899, 0.4296, 0.5094))
    curve = trace(BICYCLE, dish, 1, 0.05)
    finer = {point.name: point for point in special_points(trace(BICYCLE, dish, 1, 0.02))}
    found = special_points(curve)
    assert {point.name for point in found} == set(finer)
    for point in found:
        assert point.lean == pytest.approx(finer[point.name].lean, abs=1e-9)


def test_the_cusp_d_is_named_where_the_ground_ends_before_the_circles_grow_large() -> None:
    radii = np.arange(16.0)
    dish = SplineProfile(radii.tolist(), (0.005 * radii**2).tolist())
    curve = trace(BICYCLE, dish, 2, 0.1)
    assert curve.ends == ("edge", "flat")
    # Ground through the points of a paraboloid is that paraboloid.
    named = next(point for point in special_points(curve) if point.name == "D")
    assert named.front_rate == pytest.approx(special(0.005, 2, "D").front_rate, abs=1e-8)


def test_named_points_round_to_the_print() -> None:
    assert rounds_to(special(0.0, 1, "A").steer, PRINTED["A"]["steer"])
    assert rounds_to(special(0.0, 1, "B").front_rate, PRINTED["B"]["front_rate"])
    assert rounds_to(special(0.0, 2, "C").front_rate, PRINTED["C"]["front_rate"])
    cusp, pivot = special(0.0, 2, "D"), special(0.0, 3, "G")
    assert rounds_to(cusp.lean, PRINTED["D"]["lean"])
    assert rounds_to(cusp.front_rate, PRINTED["D"]["front_rate"])
    # The printed steer 2.78 is cut off, not rounded.
    assert np.floor(100 * cusp.steer) / 100 == float(PRINTED["D"]["steer"])
    assert rounds_to(pivot.lean, PRINTED["G"]["lean"])
    assert rounds_to(pivot.steer, PRINTED["G"]["steer"])
    assert rounds_to(abs(pivot.front_rate), PRINTED["G"]["front_rate"])


def test_straight_motions_are_where_the_capsize_eigenvalue_vanishes() -> None:
    critical = published("meijaard2007")["critical"]["v_capsize"]
    assert special(0.0, 1, "B").rear_rate * BICYCLE.rear_wheel_radius == pytest.approx(critical, abs=1e-10)


def test_pivot_and_static_ends_are_solved_for() -> None:
    pivot = special(0.005, 3, "G")
    assert abs(pivot.rear_rate) < 1e-11
    static = special(0.005, 1, "A")
    # The squared speed is zero to round-off: the speed to its root.
    assert max(abs(static.rear_rate), abs(static.front_rate)) < 1e-5


@pytest.mark.parametrize("alpha", [0.0, 0.005])
def test_a_cusp_does_not_depend_on_the_points_around_it(alpha: float) -> None:
    coarse = special(alpha, 2, "D")
    fine = next(point for point in special_points(family(alpha, 2, 0.03)) if point.name == "D")
    # The slope is solved to round-off of the arc (1e-15 and what Newton leaves); the point is as exact.
    for name in ("lean", "steer", "rear_rate", "front_rate"):
        assert getattr(coarse, name) == pytest.approx(getattr(fine, name), abs=1e-9)


def test_a_cusp_is_a_turning_point_of_the_front_rate() -> None:
    curve = family(0.005, 2)
    signs = [front_rate_slope(point) for point in curve.points]
    i = next(k for k in range(len(signs) - 1) if signs[k] * signs[k + 1] < 0)
    at = root_between(curve.equations, curve.points[i], curve.points[i + 1], front_rate_slope)
    assert abs(front_rate_slope(at)) < 1e-8 * max(abs(signs[i]), abs(signs[i + 1])) + 1e-12


@pytest.mark.parametrize(
    ("alpha", "stable"),
    [
        (0.0, {2, 4}),
        (0.005, {2, 4}),
        (0.009, {2, 4}),
        (0.011, {2}),
        (1 / 33, {2}),
        (0.05, set()),
        (0.2, set()),
        (1.0, set()),
    ],
)
def test_which_families_have_stable_sections(alpha: float, stable: set[int]) -> None:
    """Section 4.2 of the paper names those at 0 (2 and 4), 1/20, 1/5, 1 (none) and 1/200.

    At 1/200 it names family 2 alone: family 4 has one as well, of rear rates 11.00 to 11.20.
    """
    found = {number for number in FAMILIES if stable_sections(family(alpha, number, 0.05))}
    assert found == stable


def test_a_section_between_two_unstable_points_is_found() -> None:
    """At alpha = 0.009 family 4 is stable over 0.002 rad of lean, less than the points' distance."""
    ((start, end),) = stable_sections(family(0.009, 4, 0.1))
    ((same, _),) = stable_sections(family(0.009, 4, 0.03))
    assert abs(start.motion.lean - end.motion.lean) < 0.0025
    assert start.motion.rear_rate == pytest.approx(same.motion.rear_rate, abs=1e-8)


def test_the_pivoting_motion_is_gone_where_it_would_have_to_stand_still() -> None:
    """From alpha = 0.420 to 0.464 there is none; further on another one, that family 2 ends in."""
    assert family(0.415, 3).ends[0] == "pivot"
    with pytest.raises(ValueError, match="no pivoting motion"):
        trace(BICYCLE, Paraboloid(0.44), 3)
    assert family(0.5, 3).ends[0] == "pivot"
    assert "pivot" in family(0.5, 2).ends


def test_ends_of_a_stable_section_are_crossings() -> None:
    curve = family(0.005, 2, 0.05)
    ((start, end),) = stable_sections(curve)
    for one in (start, end):
        assert one.cause == "hopf"
        # The end is solved in the arc to round-off; eigenvalues are known to 1e-11 and change by order 1.
        assert abs(one.eigenvalue.real) < 1e-9
        assert one.eigenvalue.imag > 1
    assert start.motion.rear_rate < 18 < end.motion.rear_rate, "Q2 lies inside"
    dense = stable_sections(family(0.005, 2, 0.03))[0]
    assert dense[0].motion.rear_rate == pytest.approx(start.motion.rear_rate, abs=1e-8)


def test_on_the_plane_stability_is_lost_at_an_energy_extremum() -> None:
    """A real eigenvalue can cross zero only where the energy is extreme along the family."""
    ((start, _),) = stable_sections(family(0.0, 2, 0.05))
    extremum = special(0.0, 2, "energy 1")
    assert start.cause == "energy"
    # The eigenvalue grows like the distance's root-free line: both are solved to about 1e-9 in the arc.
    assert start.motion.rear_rate == pytest.approx(extremum.rear_rate, abs=1e-6)


def test_modes_are_followed_by_continuity() -> None:
    curve = family(0.005, 2, 0.05)
    rows = follow_modes(curve)
    assert rows.shape == (len(curve.points), 7)
    for expected, row in zip(sample_family(curve).eigenvalues, rows, strict=True):
        assert sorted(row, key=lambda v: (v.real, v.imag)) == sorted(expected, key=lambda v: (v.real, v.imag))
    # The first column is the zero of the family; conditioning leaves 1e-6 next to a double zero.
    assert np.abs(rows[:, 0]).max() < 1e-4
    assert growth_along(curve.equations, curve.points[0]) > 0


@pytest.mark.parametrize("alpha", [0.0, 0.005, 0.2])
@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_no_pair_is_torn_apart(alpha: float, number: int) -> None:
    rows = follow_modes(family(alpha, number, 0.05))
    for start in (1, 3, 5):
        first, second = rows[:, start], rows[:, start + 1]
        real = (np.imag(first) == 0) & (np.imag(second) == 0)
        assert np.all(real | (np.abs(first - np.conj(second)) <= 1e-8 * (1 + np.abs(first))))


def test_modes_have_the_names_that_they_have_on_the_plane() -> None:
    for number in (1, 2, 3, 4):
        curve = family(0.0, number, 0.05)
        rows, yaw_rate = follow_modes(curve), sample_family(curve).yaw_rate
        # The circle's centre is free. The eigenvalues of a nearly double pair are known to the root of round-off.
        distance = np.abs(rows[:, 5:] - 1j * np.abs(yaw_rate)[:, None] * [[1, -1]]).max(axis=1)
        assert np.median(distance) < 1e-9
    # Q2: in the bowl the centre is held, and its pair turns a little faster than the yaw.
    curve = family(0.005, 2, 0.05)
    angles = np.array([point.unknowns[[LEAN, STEER]] for point in curve.points])
    named = follow_modes(curve)[np.linalg.norm(angles - (0.7374, 2.837), axis=1).argmin()]
    # Points are 0.05 of arc apart, along which the fastest eigenvalue moves by 1.
    assert np.abs(named[1:4] - [-12.28, -0.43, -0.14 + 6.71j]).max() < 1
    assert np.abs(np.imag(named[5:])).max() == pytest.approx(2.35, abs=0.1)


def test_a_family_stops_at_the_pivot() -> None:
    for number in (3, 4):
        speeds = [point.unknowns[REAR_SPEED] for point in family(0.2, number).points]
        assert abs(speeds[0]) < 1e-12
        assert len({np.sign(speed) for speed in speeds[1:]}) == 1
