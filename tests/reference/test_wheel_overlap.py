"""Overlap of the wheels, held against discs in space that know nothing of the steering axis."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from velodrome.reference.bicycle import Bicycle
from velodrome.reference.dae import consistent_state
from velodrome.reference.kernels.dynamics import wheels
from velodrome.reference.kernels.wheel_overlap import find_overlap, measure_overlaps
from velodrome.reference.kinematics import COORDINATES, STEER, constants
from velodrome.reference.surface import Plane
from velodrome.reference.wheel_overlap import find_wheel_collision, require_separate_wheels

BICYCLE = Bicycle()
SHORT = replace(BICYCLE, wheelbase=0.6)  # radii of 0.3 m and 0.35 m: the wheels overlap straight ahead
RINGS, RAYS = 100, 400


def random_bicycles(count: int) -> list[Bicycle]:
    rng = np.random.default_rng(11)
    low, high = [0.2, -0.4, -0.6, 0.15, 0.15], [1.1, 0.4, 0.6, 0.5, 0.5]
    names = ("wheelbase", "trail", "steer_axis_tilt", "rear_wheel_radius", "front_wheel_radius")
    return [
        replace(BICYCLE, **dict(zip(names, row, strict=True))) for row in rng.uniform(low, high, (count, 5)).tolist()
    ]


def discs(bicycle: Bicycle, steer: float, rng: np.random.Generator) -> Any:
    """Both wheels in space, anyhow turned: centre, axes in the plane, axle and radius of each."""
    q = rng.uniform(-1, 1, len(COORDINATES))
    q[STEER] = steer
    return [[np.array(part) for part in wheel] for wheel in wheels(q, constants(bicycle))]


def sampled_distance(first: Any, second: Any) -> tuple[float, float]:
    """Least distance of points spread over the first disc from the second, and how far apart the points are."""
    centre, x, _, z, radius = first
    other, _, axle, _, reach = second
    r, a = radius * np.linspace(0, 1, RINGS)[:, None, None], 2 * np.pi * np.arange(RAYS)[None, :, None] / RAYS
    arm = centre + r * (np.cos(a) * x + np.sin(a) * z) - other
    height = arm @ axle
    across = np.linalg.norm(arm - height[..., None] * axle, axis=-1)
    distance = np.hypot(height, np.maximum(across - reach, 0.0)).min()
    return float(distance), float(np.hypot(radius / RINGS, np.pi * radius / RAYS))


def common_chord(first: Any, second: Any) -> float:
    """Length that both discs have in common on the line in which their planes meet."""
    along = np.cross(first[2], second[2])
    along /= np.linalg.norm(along)
    rows = np.array([first[2], second[2], along])
    point = np.linalg.solve(rows, [first[2] @ first[0], second[2] @ second[0], 0.0])
    ends = []
    for centre, *_, radius in (first, second):
        at = (centre - point) @ along
        rest = radius**2 - (centre - point - at * along) @ (centre - point - at * along)
        ends.append((at, np.sqrt(rest) if rest > 0 else -np.inf))
    (a, h), (b, k) = ends
    return float(min(a + h, b + k) - max(a - h, b - k))


def test_overlaps_are_those_of_discs_in_space() -> None:
    rng, overlapping, apart = np.random.default_rng(4), 0, 0
    for bicycle in random_bicycles(60):
        overlaps = measure_overlaps(constants(bicycle))
        for steer in (*rng.uniform(0.2, 2.9, 2), *rng.uniform(-2.9, -0.2, 1)):
            both = discs(bicycle, steer, rng)
            found, shared = find_overlap(steer, overlaps), common_chord(*both)
            distance, spacing = sampled_distance(*both)
            if found > 0:
                # Coordinates of some metres, and steer: round-off.
                assert found == pytest.approx(shared, abs=1e-12)
                assert distance <= spacing
                overlapping += 1
            else:
                assert not shared > 0
                assert distance > 0
                apart += distance > spacing
    assert overlapping > 20
    assert apart > 20


def test_overlaps_in_one_plane_are_those_of_discs_in_space() -> None:
    rng, overlapping, apart = np.random.default_rng(5), 0, 0
    for bicycle in random_bicycles(60):
        overlaps = measure_overlaps(constants(bicycle))
        for steer in (0.0, np.pi, -np.pi, 4 * np.pi):
            first, second = discs(bicycle, steer, rng)
            found = find_overlap(steer, overlaps)
            assert found == pytest.approx(first[4] + second[4] - np.linalg.norm(first[0] - second[0]), abs=1e-12)
            distance, spacing = sampled_distance(first, second)
            assert distance <= spacing if found > 0 else distance == pytest.approx(-found, abs=spacing)
            overlapping, apart = overlapping + (found > 0), apart + (found < 0)
    assert overlapping > 20
    assert apart > 20


def test_the_benchmarks_wheels_are_apart_at_every_steer() -> None:
    overlaps = measure_overlaps(constants(BICYCLE))
    assert max(overlaps.ahead, overlaps.reversed, overlaps.turned) < -0.3
    require_separate_wheels(BICYCLE, np.zeros(9))


@pytest.mark.parametrize("excess", [0.0, 1e-15, -1e-15])
def test_wheels_that_just_touch_are_apart(excess: float) -> None:
    """Of equal radius, a wheelbase of two radii: whichever way round-off falls."""
    touching = replace(BICYCLE, front_wheel_radius=0.3, wheelbase=0.6 + excess)
    require_separate_wheels(touching, np.zeros(9))
    with pytest.raises(ValueError, match=r"^the wheels overlap by 0\.001 mm at a steer of 0 rad$"):
        require_separate_wheels(replace(touching, wheelbase=0.6 - 1e-6), np.zeros(9))


@pytest.mark.parametrize("steer", [0.0, 1e-14, -1e-14])
def test_round_off_of_steer_does_not_part_overlapping_wheels(steer: float) -> None:
    # 0.65 m less the distance of the centres, 0.6 m apart and one 0.05 m higher.
    q = np.zeros(9)
    q[STEER] = steer
    with pytest.raises(ValueError, match=rf"^the wheels overlap by {1e3 * (0.65 - np.hypot(0.6, 0.05)):.3g} mm"):
        require_separate_wheels(SHORT, q)
    q[STEER] = 0.1
    require_separate_wheels(SHORT, q)


def test_wheels_collide_where_steer_passes_straight_ahead() -> None:
    q = np.zeros((4, 9))
    q[:, STEER] = [0.3, 0.1, -0.3, 0.2]
    times = np.array([0.0, 1.0, 2.0, 3.0])
    ending = find_wheel_collision(SHORT, times, q)
    assert ending is not None
    assert ending.time == pytest.approx(1.25, abs=1e-15)
    assert ending.why == "the wheels collide at t = 1.25 s: there they overlap by 47.9 mm"
    assert find_wheel_collision(SHORT, times[:2], q[:2]) is None
    assert find_wheel_collision(BICYCLE, times, q) is None
    # With this trail the front wheel is far ahead when its fork is reversed: nothing collides at half a turn.
    trailing = replace(SHORT, trail=0.3)
    q[:, STEER] = [3.0, 3.3, 3.0, 3.3]
    assert find_wheel_collision(trailing, times, q) is None
    q[:, STEER] = [3.0, 6.0, 6.5, 7.0]
    ending = find_wheel_collision(trailing, times, q)
    assert ending is not None
    assert ending.time == pytest.approx(1 + (2 * np.pi - 6.0) / 0.5, abs=1e-12)


def test_wheels_that_both_reach_the_steering_axis_overlap_at_every_steer() -> None:
    tiny = replace(BICYCLE, wheelbase=0.25)
    q, _ = consistent_state(tiny, Plane(), (0.2, 0.0), 0.0, 1.0, (0.0, 0.0, 5.0))
    with pytest.raises(ValueError, match=r"^the wheels overlap by .* at a steer of 1 rad$"):
        require_separate_wheels(tiny, q)
    ending = find_wheel_collision(tiny, np.array([0.5]), q[None])
    assert ending is not None
    assert ending.time == 0.5
