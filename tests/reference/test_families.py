"""The curves of circular motions: where they run, their special points, where they are stable."""

from functools import cache

import numpy as np
import pytest

from reference.bicycle import Bicycle
from reference.circular import REAR_SPEED
from reference.continuation import root_between
from reference.families import FAMILIES, Family, front_rate_slope, trace
from reference.sections import growth_along, modes, sample_family, stable_sections
from reference.special import SpecialPoint, special_points
from reference.surface import Paraboloid
from tests.literature import published, rounds_to

BICYCLE = Bicycle()
PRINTED = published("xiong2020")
ALPHAS = (0.0, 0.005, 0.011, 1 / 33, 0.05, 0.2, 0.5, 1.0)


@cache
def family(alpha: float, number: int, longest: float = 0.1) -> Family:
    return trace(BICYCLE, Paraboloid(alpha), number, longest)


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
    rows = modes(curve)
    assert rows.shape == (len(curve.points), 7)
    for expected, row in zip(sample_family(curve).eigenvalues, rows, strict=True):
        assert sorted(row, key=lambda v: (v.real, v.imag)) == sorted(expected, key=lambda v: (v.real, v.imag))
    # The first column is the zero of the family; conditioning leaves 1e-6 next to a double zero.
    assert np.abs(rows[:, 0]).max() < 1e-4
    assert growth_along(curve.equations, curve.points[0]) > 0


def test_a_family_stops_at_the_pivot() -> None:
    for number in (3, 4):
        speeds = [point.unknowns[REAR_SPEED] for point in family(0.2, number).points]
        assert abs(speeds[0]) < 1e-12
        assert len({np.sign(speed) for speed in speeds[1:]}) == 1
