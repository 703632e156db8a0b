"""Straight motion and its neighbours on the level plane, held against Meijaard's linear equations and the families."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from velodrome.reference.anchors import start_on_plane
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.bowls import Sphere
from velodrome.reference.circular import Steady, nearest_condition, newton
from velodrome.reference.families import find_motion
from velodrome.reference.kernels import curve
from velodrome.reference.missing_motion import NoSuchMotion, SearchFailed
from velodrome.reference.special import find_straight_motion
from velodrome.reference.stability import free_eigenvalues, growth_rate, linearise
from velodrome.reference.steady_turn import make_straight_motion, solve_steady_turn
from velodrome.reference.surface import Paraboloid, Plane
from velodrome.reference.upright import canonical_matrices, capsize_speed, stable_speeds

MASSLESS = {f"{wheel}_wheel_{what}": 0.0 for wheel in ("rear", "front") for what in ("mass", "Ixx", "Iyy")}
# Two masses on two wheels of a millionth of a kilogram, without trail (Kooijman et al. 2011).
SKATE = Bicycle(
    wheelbase=1.0,
    trail=0.0,
    steer_axis_tilt=np.pi / 36,
    rear_wheel_radius=0.1,
    rear_wheel_mass=1e-6,
    rear_wheel_Ixx=5e-9,
    rear_wheel_Iyy=1e-8,
    rear_frame_x=1.2,
    rear_frame_z=0.4,
    rear_frame_mass=10.0,
    front_frame_x=1.02,
    front_frame_z=0.2,
    front_frame_mass=1.0,
    front_wheel_radius=0.1,
    front_wheel_mass=1e-6,
    front_wheel_Ixx=5e-9,
    front_wheel_Iyy=1e-8,
    **{f"{frame}_frame_I{axis}{axis}": 1e-6 for frame in ("rear", "front") for axis in "xyz"},
    **{f"{frame}_frame_Ixz": 0.0 for frame in ("rear", "front")},
)
BICYCLES = {
    "benchmark": Bicycle(),
    "trail": replace(Bicycle(), trail=0.2),
    "negative trail": replace(Bicycle(), trail=-0.1),
    "massless wheels": replace(Bicycle(), **MASSLESS),
}
CAPSIZE = capsize_speed(canonical_matrices(Bicycle())) or np.nan


@pytest.mark.parametrize("bicycle", BICYCLES.values(), ids=BICYCLES)
@pytest.mark.parametrize("speed", [1.0, 5.0, 8.0])
def test_straight_motion_has_the_eigenvalues_and_the_verdict_of_the_linear_equations(
    bicycle: Bicycle, speed: float
) -> None:
    rate = speed / bicycle.rear_wheel_radius
    motion = make_straight_motion(bicycle, Plane(), rate)
    assert (motion.yaw_rate, motion.lean, motion.steer) == (0.0, 0.0, 0.0)
    assert motion.residual < 1e-14
    values = linearise(bicycle, Plane(), *motion.state()).eigenvalues
    matrices = canonical_matrices(bicycle)
    expected = matrices.eigenvalues(speed)[0]
    free = free_eigenvalues(Plane(), values, 0.0)
    # Round-off of eigenvalues: 1e-15 times a condition number of at most 1e4.
    np.testing.assert_allclose(np.sort_complex(free), np.sort_complex(expected), atol=1e-11 * np.abs(expected).max())
    assert growth_rate(Plane(), values, 0.0) == pytest.approx(expected.real.max(), abs=1e-9)
    stable = any(low < speed < high for low, high in stable_speeds(matrices))
    assert (growth_rate(Plane(), values, 0.0) < 0) == stable


@pytest.mark.parametrize("near", [(0.0, -np.pi + 0.01), (2 * np.pi, np.pi), (0.0, 3 * np.pi)])
def test_angles_count_without_whole_turns(near: tuple[float, float]) -> None:
    number, motion = find_motion(Bicycle(), Plane(), 15.0, near=near)
    assert (number, motion.steer, motion.yaw_rate) == (None, np.pi, 0.0)


@pytest.mark.parametrize(("surface", "rate"), [(Plane(), 20.08), (Paraboloid(0.005), 18.0)])
def test_a_mirror_image_belongs_to_the_same_family(surface: Plane | Paraboloid, rate: float) -> None:
    number, motion = find_motion(Bicycle(), surface, rate, 1)
    again, image = find_motion(Bicycle(), surface, rate, near=(-motion.lean, -motion.steer))
    assert (again, image.lean, image.steer, image.yaw_rate) == (number, -motion.lean, -motion.steer, -motion.yaw_rate)
    reduced = linearise(Bicycle(), surface, *image.state())
    assert np.abs(reduced.field).max() < 1e-9
    np.testing.assert_allclose(
        reduced.eigenvalues, linearise(Bicycle(), surface, *motion.state()).eigenvalues, atol=1e-9
    )


def test_nearly_straight_motion_in_a_bowl_is_not_denied() -> None:
    """Circles of more than a kilometre are not searched; here there is one of 1.1 km."""
    with pytest.raises(SearchFailed, match="on circles of up to 1000 m"):
        find_motion(Bicycle(), Paraboloid(1e-6), 20.0808, near=(0.0, 0.0))
    with pytest.raises(NoSuchMotion):
        find_motion(Bicycle(), Sphere(20.0), 5.0, near=(0.0, 0.0))


def test_fast_motion_is_not_denied() -> None:
    """Curves are followed up to 200 rad/s of both wheels together."""
    for family, near in ((2, None), (None, (1.2, 3.0))):
        with pytest.raises(SearchFailed, match="whose wheels turn faster than 200 rad/s together were not searched"):
            find_motion(Bicycle(), Paraboloid(0.005), 500.0, family, near)
    with pytest.raises(NoSuchMotion):
        find_motion(Bicycle(), Paraboloid(0.005), 10.0, 2)


@pytest.mark.parametrize(("trail", "branches"), [(0.08, True), (-0.1, False)])
def test_circles_branch_off_straight_motion_at_the_capsize_speed(trail: float, branches: bool) -> None:
    bicycle = replace(Bicycle(), trail=trail)
    speed, point = capsize_speed(canonical_matrices(bicycle)), find_straight_motion(bicycle, "B", 0.0)
    assert (point is not None) == (speed is not None) == branches
    if point is not None and speed is not None:
        assert point.rear_rate * bicycle.rear_wheel_radius == pytest.approx(speed, rel=1e-11)


def test_a_capsize_speed_of_kilometres_a_second_is_found() -> None:
    speed, point = capsize_speed(canonical_matrices(SKATE)), find_straight_motion(SKATE, "B", 0.0)
    assert speed is not None
    assert speed > 1000.0
    assert point is not None
    assert point.rear_rate * SKATE.rear_wheel_radius == pytest.approx(speed, rel=1e-7)


@pytest.mark.parametrize("bicycle", BICYCLES.values(), ids=BICYCLES)
def test_the_ground_carries_a_straight_bicycle(bicycle: Bicycle) -> None:
    motion = make_straight_motion(bicycle, Plane(), 15.0)
    weight = bicycle.mass * bicycle.gravity
    # Static moments about the rear contact.
    front = sum(bicycle.body_mass(body) * bicycle.centre(body)[0] for body in ("rear_frame", "front_frame"))
    front = (front + bicycle.front_wheel_mass * bicycle.wheelbase) * bicycle.gravity / bicycle.wheelbase
    np.testing.assert_allclose(motion.force, [[0, 0, weight - front], [0, 0, front]], atol=1e-12 * weight)


def test_the_bicycle_also_runs_straight_with_its_handlebar_reversed() -> None:
    number, motion = find_motion(Bicycle(), Plane(), 15.0, near=(0.0, np.pi - 0.01))
    assert (number, motion.steer, motion.yaw_rate) == (None, np.pi, 0.0)
    assert motion.front_rate < 0
    assert np.abs(linearise(Bicycle(), Plane(), *motion.state()).field[2:]).max() < 1e-12  # it moves along x


def test_circles_branch_off_straight_motion_with_the_root_of_the_distance() -> None:
    """A pitchfork at the capsize speed: ever larger circles below it, none above, and no other solutions."""
    rate, leans = CAPSIZE / Bicycle().rear_wheel_radius, []
    distances = np.array([1e-3, 1e-4, 1e-6, 1e-8])
    for distance in distances:
        guess = np.sqrt(distance) * np.array([-1.5, 0.45])
        turn = solve_steady_turn(Bicycle(), Plane(), rate * (1 - distance), *guess)
        assert turn is not None
        # In units of the weight, and of the circle's size times round-off.
        assert turn.residual < 1e-15 * (1 + np.hypot(*turn.position[:2]))
        # Straight motion is no solution of its own there.
        assert turn.yaw_rate > 0
        leans.append(turn.lean)
        for sign in (1, -1):
            assert solve_steady_turn(Bicycle(), Plane(), rate * (1 + distance), sign * 1e-3, 3e-4) is None
    # lean = -c sqrt(d) (1 + O(d)), at 1e-8 with the capsize speed's own round-off, 1e-15 / 1e-8.
    np.testing.assert_allclose(leans / np.sqrt(distances), leans[2] / np.sqrt(distances[2]), rtol=2e-2)
    np.testing.assert_allclose(leans[3] / np.sqrt(distances[3]), leans[2] / np.sqrt(distances[2]), rtol=1e-4)


@pytest.mark.parametrize("near", [(-0.02, 0.006), (0.02, -0.006)])
def test_a_large_circle_is_the_one_that_its_family_leads_to(near: tuple[float, float]) -> None:
    rate = CAPSIZE / Bicycle().rear_wheel_radius * (1 - 1e-4)
    _, followed = find_motion(Bicycle(), Plane(), rate, family=1)
    _, found = find_motion(Bicycle(), Plane(), rate, near=near)
    side = np.sign(near[0]) * np.sign(followed.lean)  # families turn to the left
    # On a circle of 243 m the family's unknowns are known to 1e-13 of it, angles to its inverse times that.
    assert (found.lean, found.steer) == pytest.approx((side * followed.lean, side * followed.steer), abs=1e-9)
    assert found.yaw_rate == pytest.approx(side * followed.yaw_rate, abs=1e-9)


@pytest.mark.parametrize("excess", [1e-4, 1e-6, 1e-8])
def test_no_large_circle_is_made_up_where_there_is_none(excess: float) -> None:
    """Newton's method in positions converges there to circles of kilometres, which are no solutions."""
    rate = CAPSIZE / Bicycle().rear_wheel_radius * (1 + excess)
    for near in ((1e-4, 5e-5), (-1e-3, 5e-4)):
        _, motion = find_motion(Bicycle(), Plane(), rate, near=near)
        assert motion.is_straight


def test_no_motion_is_straight_in_a_bowl() -> None:
    with pytest.raises(
        SearchFailed, match=r"no motion is straight on ground that is not level; the nearest is at -0\.3"
    ):
        find_motion(Bicycle(), Paraboloid(0.005), 19.0, near=(0.0, 0.0))


def test_wheels_that_roll_straight_on_are_no_guess_of_a_circle() -> None:
    with pytest.raises(ValueError, match=r"roll straight on at lean = 0\.0, steer = 0\.0"):
        start_on_plane(Bicycle(), 0.0, 0.0)


def test_newtons_method_ends_where_the_equations_have_no_value(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compiled code divides complex numbers by zero with an exception, as where nothing has inertia."""
    unknowns = start_on_plane(Bicycle(), -0.3, 0.2)

    def divide_by_zero(*_: object) -> None:
        raise ZeroDivisionError("complex division by zero")

    monkeypatch.setattr(curve, "expanded", divide_by_zero)
    equations = Steady(Bicycle(), Plane())
    assert all(np.isnan(part).all() for part in equations.expand(unknowns[curve.CHOSEN]))
    with pytest.raises(ValueError, match="Newton's method finds no circular motion there"):
        newton(equations, unknowns, nearest_condition())
