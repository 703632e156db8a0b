"""What hangs on no round-off: the running direction, changes of sign, the order of eigenvalues, the modes' halves."""

from functools import cache

import numpy as np
import pytest

from tests.shaken import shake
from velodrome.reference.anchors import anchor
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.circular import REAR_SPEED, SIGMA, YAW_SPEED, reverse_speeds
from velodrome.reference.continuation import Point, roots_along, sign_changes
from velodrome.reference.curve import sample_curve
from velodrome.reference.families import Family, trace
from velodrome.reference.kernels.steady import STANDING, direction
from velodrome.reference.modes import follow_modes
from velodrome.reference.sections import sample_family, stable_sections
from velodrome.reference.special import special_points
from velodrome.reference.stability import are_zero, eigenvalue_order, sorted_eigenvalues
from velodrome.reference.surface import Paraboloid

BICYCLE = Bicycle()
ROUND_OFF = np.finfo(float).eps


@cache
def family(alpha: float, number: int) -> Family:
    return trace(BICYCLE, Paraboloid(alpha), number, 0.1)


@pytest.mark.parametrize(("rear", "sign"), [(1.0, 1), (-1.0, -1), (9e-19, 1), (-5e-35, 1), (0.0, 1), (-2e-12, -1)])
def test_the_rear_wheel_rolls_forward_or_stands(rear: float, sign: int) -> None:
    assert direction(rear) == sign


@pytest.mark.parametrize("alpha", [0.0, 0.005, 0.2])
def test_a_pivoting_motion_is_the_limit_of_its_curves_own_motions(alpha: float) -> None:
    for number in (3, 4):
        curve = family(alpha, number)
        yaw, front = (getattr(sample_family(curve), name)[:3] for name in ("yaw_rate", "front_rate"))
        # Points are 0.02 of arc apart at first: rates of order one change by that, never by twice themselves.
        assert np.abs(np.diff(yaw)).max() < 0.1 * np.abs(yaw[0])
        assert np.abs(np.diff(front)).max() < 0.1 * np.abs(front[0])
        assert curve.points[0].unknowns[REAR_SPEED] == 0
        motion = curve.equations.motion(curve.points[0].unknowns)
        assert (motion.yaw_rate, motion.rear_rate, motion.front_rate) == (yaw[0], 0, front[0])
    third, fourth = (
        family(alpha, number).equations.motion(family(alpha, number).points[0].unknowns) for number in (3, 4)
    )
    # One motion, G and H: ridden from family 3 one way, from family 4 the other.
    assert third.yaw_rate == pytest.approx(-fourth.yaw_rate, rel=1e-12)
    assert third.steer == pytest.approx(fourth.steer, abs=1e-12)


@pytest.mark.parametrize("noise", [-5e-35, 0.0, 9e-19])
@pytest.mark.parametrize("number", [3, 4])
def test_round_off_of_the_rear_speed_tells_nothing(number: int, noise: float) -> None:
    curve = family(0.005, number)
    u = curve.points[0].unknowns.copy()
    u[REAR_SPEED] = noise
    motion, expected = curve.equations.motion(u), curve.equations.motion(curve.points[0].unknowns)
    assert (motion.yaw_rate, motion.front_rate) == (expected.yaw_rate, expected.front_rate)
    seen = sample_curve(curve.equations, u[None])
    assert (seen.yaw_rate[0], seen.front_rate[0]) == (motion.yaw_rate, motion.front_rate)


def test_a_pivoting_anchor_runs_as_its_curve_and_is_carried_on_from_there() -> None:
    for number in (3, 4):
        start = anchor(BICYCLE, Paraboloid(0.2), number, None)
        here, there = family(0.2, number).points[0].unknowns, start.unknowns
        assert here[YAW_SPEED] == pytest.approx(there[YAW_SPEED], rel=1e-12)
        again = anchor(BICYCLE, Paraboloid(0.2), number, None).unknowns
        assert np.array_equal(again, there)


def test_a_static_end_stands_still() -> None:
    curve = family(0.2, 1)
    assert curve.points[-1].unknowns[SIGMA] == 0
    special = next(point for point in special_points(curve) if point.name == "A")
    assert str((special.rear_rate, special.front_rate)) == "(0.0, 0.0)"  # no -0.0
    # At rest it still solves the equations.
    assert np.abs(curve.equations.residual(curve.points[-1].unknowns)).max() < 1e-12


def test_turned_speeds_solve_the_same_equations() -> None:
    curve = family(0.2, 2)
    for point in curve.points[::20]:
        here, there = (curve.equations.residual(u) for u in (point.unknowns, reverse_speeds(point.unknowns)))
        # Each row is odd or even in the speeds.
        assert np.array_equal(np.abs(here), np.abs(there))


@pytest.mark.parametrize(
    ("values", "pairs"),
    [
        ([1.0, -1.0, 2.0], [(0, 1), (1, 2)]),
        ([1.0, 0.0, -1.0], [(0, 2)]),
        ([1.0, 8.8e-19, -1.0], [(0, 2)]),
        ([1.0, -8.8e-19, 1.0], []),
        ([1.0, -5e-35, -9e-19, 0.0, -1.0], [(0, 4)]),
        ([0.0, 1.0, 0.0], []),
        ([0.0], []),
        ([], []),
    ],
)
def test_changes_of_sign_pass_over_zeros(values: list[float], pairs: list[tuple[int, int]]) -> None:
    assert sign_changes(values, STANDING) == pairs


def test_a_root_on_a_point_is_that_point() -> None:
    curve = family(0.005, 2)
    middle = len(curve.points) // 2

    def beyond(point: Point) -> float:
        return float((point.unknowns - curve.points[middle].unknowns) @ curve.points[middle].tangent)

    numbers = [beyond(point) for point in curve.points[middle - 3 : middle + 4]]
    assert numbers[3] == 0
    ((place, root),) = roots_along(curve.equations, curve.points[middle - 3 : middle + 4], beyond)
    assert (place, root) == (2, curve.points[middle])


def spectra() -> tuple[np.ndarray, np.ndarray]:
    """Shuffled spectra, and the exact one: a zero and a pair have one real part, two other pairs have another."""
    exact = np.array([-12.0, -0.4 - 6j, -0.4 - 2j, -0.4 + 2j, -0.4 + 6j, -3j, 0, 3j, 0.7])
    rng = np.random.default_rng(5)
    # Ten times what is left of well-conditioned eigenvalues of this size.
    noise = 10 * 12 * ROUND_OFF * rng.standard_normal((50, len(exact)))
    noise[:, [4, 3, 7]] = noise[:, [1, 2, 5]]  # halves have one real part
    order = rng.permuted(np.tile(np.arange(len(exact)), (50, 1)), axis=1)
    return np.take_along_axis(exact + noise, order, axis=1), exact


def test_eigenvalues_of_equal_real_parts_are_ordered_by_their_imaginary_parts() -> None:
    values, exact = spectra()
    found = np.take_along_axis(values, eigenvalue_order(values), axis=1)
    assert np.abs(found - exact).max() < 1e-12
    assert np.array_equal(eigenvalue_order(values[7]), eigenvalue_order(values)[7])


def test_a_double_zero_counts_as_zero_however_it_splits() -> None:
    rest = [-3.0, -8j, 8j, 3.0]
    expected = [-3.0, -8j, 0, 0, 0, 8j, 3.0]
    for split in ([1e-8, 0, -1e-8], [1e-8j, 0, -1e-8j], [0, 0, 0]):
        values = np.array([*split, *rest])
        assert np.abs(values[eigenvalue_order(values)] - expected).max() < 1e-7
        assert are_zero(values).sum() == 3


def test_complex_eigenvalues_are_exactly_conjugate_and_sorted() -> None:
    jacobians = np.random.default_rng(3).standard_normal((20, 7, 7))
    for values in sorted_eigenvalues(jacobians):
        assert np.all(np.diff(np.real(values)) >= 0)
        assert sorted(values, key=lambda v: (v.real, v.imag)) == sorted(np.conj(values), key=lambda v: (v.real, v.imag))


@pytest.mark.parametrize(("alpha", "number"), [(0.0, 2), (0.0, 4), (0.2, 1), (0.2, 3)])
def test_halves_of_modes_have_one_order(alpha: float, number: int) -> None:
    rows = follow_modes(family(alpha, number))
    for start in (1, 3, 5):
        first, second = rows[:, start], rows[:, start + 1]
        turning = np.imag(first) != 0
        assert np.all(np.imag(first[turning]) > 0)
        assert np.all(first[turning] == np.conj(second[turning]))
        assert np.all(np.real(first[~turning]) <= np.real(second[~turning]))


def test_growth_that_is_round_off_is_none() -> None:
    """So level a bowl is that the pair of its free centre grows by less than what eigenvalues are known to."""
    curve = trace(BICYCLE, Paraboloid(1e-15), 2, 0.1)
    seen, level = sample_family(curve), sample_family(family(0.0, 2))
    assert level.stable.any()
    assert not seen.stable.any()
    assert stable_sections(curve) == []
    # Where the bicycle itself is unstable it is told.
    assert seen.growth_rate.max() > 1


def test_shaken_round_off_changes_no_name_and_no_flag(monkeypatch: pytest.MonkeyPatch) -> None:
    kept = {number: (family(0.005, number), follow_modes(family(0.005, number))) for number in (3, 4)}
    shake(3, monkeypatch.setattr)
    for number, (curve, named) in kept.items():
        other = trace(BICYCLE, Paraboloid(0.005), number, 0.1)
        assert other.ends == curve.ends
        seen, same = sample_family(curve), sample_family(other)
        assert not np.array_equal(seen.eigenvalues, same.eigenvalues), "nothing was shaken"
        assert np.array_equal(seen.stable, same.stable)
        size = np.abs(named).max(axis=1, keepdims=True)
        # A double zero splits by the root of round-off times its condition, 1e-7.
        assert np.abs(follow_modes(other) - named).max() <= (1e-6 * size).max()
        assert [point.name for point in special_points(other)] == [point.name for point in special_points(curve)]
