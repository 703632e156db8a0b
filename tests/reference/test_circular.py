from dataclasses import replace

import numpy as np
import pytest

from tests.literature import published, rounds_to
from velodrome.reference.anchors import anchor, start_on_plane
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.circular import Steady, nearest_condition, newton
from velodrome.reference.continuation import follow_curve
from velodrome.reference.dae import dynamics, residual
from velodrome.reference.families import find_motion, find_motions
from velodrome.reference.surface import Paraboloid

BICYCLE = Bicycle()
PRINTED = published("xiong2020")


@pytest.mark.parametrize("name", ["P1", "P2", "P3", "P4"])
def test_points_p_round_to_the_print(name: str) -> None:
    point = PRINTED[name]
    near = (float(point["lean"]), float(point["steer"]))
    family, motion = find_motion(BICYCLE, Paraboloid(point["alpha"]), point["rear_rate"], point["family"], near)
    assert family == point["family"]
    for field in ("lean", "steer", "front_rate"):
        assert rounds_to(getattr(motion, field), point[field]), field
    assert motion.residual < 1e-12


@pytest.mark.parametrize(("name", "family"), [("Q1", 1), ("Q2", 2)])
def test_points_q_round_to_the_print(name: str, family: int) -> None:
    point = PRINTED[name]
    _, motion = find_motion(BICYCLE, Paraboloid(point["alpha"]), 18.0, family)
    values = [*motion.position[:2], motion.lean, motion.steer, 0.0, 0.0, motion.rear_rate]
    for value, printed in zip(values, point["v"], strict=True):
        assert rounds_to(value, printed)
    assert motion.residual < 1e-12


def test_family_two_has_two_motions_at_q2_and_near_tells_them_apart() -> None:
    both = find_motions(BICYCLE, Paraboloid(0.005), 2, 18.0)
    assert [round(motion.lean, 3) for motion in both] == [0.737, 0.693]
    _, other = find_motion(BICYCLE, Paraboloid(0.005), 18.0, 2, near=(0.69, 2.87))
    assert other.lean == both[1].lean
    # Without a family the nearest of all is found as well.
    family, same = find_motion(BICYCLE, Paraboloid(0.005), 18.0, near=(0.69, 2.87))
    assert (family, same.lean) == (2, both[1].lean)


def test_point_g_is_the_printed_pivoting_motion() -> None:
    pivot = anchor(BICYCLE, Paraboloid(0.0), 3, None)
    motion, point = pivot.equations.motion(pivot.unknowns), PRINTED["G"]
    assert abs(motion.rear_rate) < 1e-12
    assert rounds_to(motion.lean, point["lean"])
    assert rounds_to(motion.steer, point["steer"])
    assert rounds_to(abs(motion.front_rate), point["front_rate"])


@pytest.mark.parametrize(("name", "guess"), [("B", (-0.02, 0.02)), ("C", (0.02, 3.12))])
def test_straight_motions_are_the_limits_of_large_circles(name: str, guess: tuple[float, float]) -> None:
    """B and C: the front rate far out on the curve rounds to the print, and its error falls like 1/R^2."""
    level = Steady(BICYCLE, Paraboloid(0.0))
    u, _ = newton(level, start_on_plane(BICYCLE, *guess), nearest_condition(), most=30)
    outwards = np.zeros(22)
    outwards[1] = np.sign(u[1])
    far = level.motion(list(follow_curve(level, u, outwards))[-1].unknowns)
    assert np.hypot(*far.position[:2]) > 900
    assert rounds_to(far.front_rate, PRINTED[name]["front_rate"])


@pytest.mark.parametrize(("alpha", "family", "rear_rate"), [(0.005, 2, 18.0), (0.2, 3, 20.0), (0.05, 4, 12.0)])
def test_a_circular_motion_solves_the_equations_of_motion(alpha: float, family: int, rear_rate: float) -> None:
    """All 21 equations of the unrotated system, with the accelerations of turning about z."""
    surface = Paraboloid(alpha)
    _, motion = find_motion(BICYCLE, Paraboloid(alpha), rear_rate, family)
    q, qd = motion.state()
    turning = np.zeros(9)
    turning[:2] = -(motion.yaw_rate**2) * motion.position[:2]
    rows = residual(BICYCLE, surface, q, qd, turning, motion.contact.ravel(), motion.force.ravel())
    # Rolling rows carry real speeds here, up to some 10 m/s.
    assert np.abs(rows).max() < 1e-11
    now = dynamics(BICYCLE, surface, q, qd)
    assert np.abs(now.acceleration - turning).max() < 1e-9
    assert np.abs(now.force - motion.force).max() < 1e-9
    assert np.abs(now.contact_rate[:, 2]).max() < 1e-12


def test_families_one_and_three_are_continuous_in_alpha() -> None:
    """Their curves join between alpha = 1/5 and 1/2; the motions at a rear rate stay and move smoothly."""
    for family, rear_rate in ((1, 12.0), (3, 20.0)):
        found = [find_motion(BICYCLE, Paraboloid(alpha), rear_rate, family)[1] for alpha in np.arange(0.2, 1.01, 0.1)]
        angles = np.array([[motion.lean, motion.steer] for motion in found])
        # Lean and steer move by some 0.1 over the whole range.
        assert np.abs(np.diff(angles, axis=0)).max() < 0.1
        assert max(motion.residual for motion in found) < 1e-12


@pytest.mark.parametrize("change", [{"trail": 0.081}, {"trail": 0.06, "wheelbase": 1.1}, {"rear_frame_mass": 70.0}])
def test_another_bicycle_is_reached_from_the_benchmark(change: dict[str, float]) -> None:
    """Motions of bicycles nearby are neighbours of the benchmark's, not another family's."""
    for alpha, rear_rate, family in ((0.005, 19.0, 2), (0.2, 20.0, 3)):
        there = find_motion(BICYCLE, Paraboloid(alpha), rear_rate, family)[1]
        here = find_motion(replace(BICYCLE, **change), Paraboloid(alpha), rear_rate, family)[1]
        assert here.residual < 1e-12
        # Parameters differ by up to a quarter; angles are functions of order one of their logarithms.
        assert np.hypot(here.lean - there.lean, here.steer - there.steer) < 0.25


def test_near_is_refused_where_nothing_is_near() -> None:
    with pytest.raises(ValueError, match=r"within 0\.2 rad of near = 0\.2, 2; the nearest is at 0\.7"):
        find_motion(BICYCLE, Paraboloid(0.005), 18.0, 2, near=(0.2, 2.0))


def test_small_curvature_tends_to_the_plane() -> None:
    """Families at alpha -> 0 tend to the plane's linearly in alpha."""
    plane = find_motion(BICYCLE, Paraboloid(0.0), 18.0, 2)[1]
    gaps = [abs(find_motion(BICYCLE, Paraboloid(alpha), 18.0, 2)[1].lean - plane.lean) for alpha in (1e-4, 1e-5)]
    # Linear with a quadratic correction of relative size alpha x lengths of some metres x O(10).
    assert gaps[0] / gaps[1] == pytest.approx(10, rel=1e-2)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((-1.0, 2, None), "rear rate"),
        ((18.0, 5, None), "family"),
        ((18.0, None, None), "needs a family"),
        ((18.0, None, (np.nan, 0.0)), "near"),
        ((500.0, 1, None), "no circular motion"),
    ],
)
def test_impossible_wishes_are_refused(arguments: tuple, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        find_motion(BICYCLE, Paraboloid(0.005), *arguments)
