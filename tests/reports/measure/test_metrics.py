"""Metrics of trajectories whose errors are known because they were put there."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from velodrome.engines.engine import Trajectory
from velodrome.reference.bicycle import BODIES, Bicycle
from velodrome.reference.contact import observe
from velodrome.reference.fall import heights_above_fallen
from velodrome.reference.families import find_motion
from velodrome.reference.kinematics import LEAN, REAR_ANGLE, YAW
from velodrome.reference.surface import Paraboloid
from velodrome.reports.measure.consistency import evaluate_ride
from velodrome.reports.measure.fall import fell_at, until_fall
from velodrome.reports.measure.metrics import (
    compute_metrics,
    find_horizon,
    orientation_errors,
    position_errors,
)
from velodrome.reports.measure.steady import steady_trajectory

BICYCLE = Bicycle()
BOWL = Paraboloid(0.005)
_, MOTION = find_motion(BICYCLE, Paraboloid(0.005), 18.0, 2)
RADIUS = float(np.hypot(*MOTION.position[:2]))
TIMES = np.arange(401) / 100  # three turns: the polar angle passes pi
N = len(TIMES)
EXACT = steady_trajectory(BICYCLE, MOTION, TIMES)

# Positions are of the size of the radius, 2.4 m: subtracting two of them leaves a few units of 2^-52 of it.
ROUND_OFF = 8 * 2.0**-52 * RADIUS


def measure(
    trajectory: Trajectory, reference: Trajectory | None = EXACT, growth_rate: float = -1.0, circular: bool = True
) -> dict[str, Any]:
    return compute_metrics(trajectory, reference, BICYCLE, BOWL, growth_rate, RADIUS, circular)


def moved(offset: np.ndarray) -> Trajectory:
    """The exact motion with D displaced by (n, 3) or (3,) metres."""
    q = EXACT.q.copy()
    q[:, :3] += offset
    return replace(EXACT, q=q)


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Hamilton product of a quaternion (4,) with many (n, 4)."""
    w = a[0] * b[:, 0] - b[:, 1:] @ a[1:]
    return np.column_stack([w, a[0] * b[:, 1:] + b[:, :1] * a[1:] + np.cross(a[1:], b[:, 1:])])


def rotated(angle: float, axis: np.ndarray) -> Trajectory:
    """The exact motion with every body turned by an angle about a fixed axis."""
    turn = np.append(np.cos(angle / 2), np.sin(angle / 2) * axis)
    return replace(
        EXACT, body_quaternion=np.stack([product(turn, EXACT.body_quaternion[:, b]) for b in range(4)], axis=1)
    )


def test_the_exact_motion_has_no_error() -> None:
    measured = measure(EXACT)
    assert measured["position_error"] == {"max": 0.0, "end": 0.0}
    assert measured["orientation_error"] == {"max": 0.0, "end": 0.0}
    assert measured["rear_rate_error"] == measured["contact_force_error"] == 0.0
    assert measured["radius_drift_rate"] == measured["phase_drift_rate"] == measured["rear_rate_drift_rate"] == 0.0


@pytest.mark.parametrize("axis", range(3))
def test_a_shift_of_a_millimetre_is_a_millimetre(axis: int) -> None:
    error = measure(moved(1e-3 * np.eye(3)[axis]))["position_error"]
    assert error["max"] == pytest.approx(1e-3, rel=0, abs=ROUND_OFF)
    assert error["end"] == pytest.approx(1e-3, rel=0, abs=ROUND_OFF)


def test_the_end_is_told_from_the_largest() -> None:
    offset = np.zeros((N, 3))
    offset[N // 2, 2], offset[-1, 2] = 3e-3, 1e-3
    error = measure(moved(offset))["position_error"]
    assert error["max"] == pytest.approx(3e-3, rel=0, abs=ROUND_OFF)
    assert error["end"] == pytest.approx(1e-3, rel=0, abs=ROUND_OFF)


@given(
    st.floats(-12, np.log10(np.pi)).map(lambda exponent: min(10.0**exponent, np.pi)),
    st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda axis: np.linalg.norm(axis) > 0.1),
)
def test_a_rotation_is_its_angle(angle: float, axis: tuple[float, float, float]) -> None:
    errors = orientation_errors(rotated(angle, np.array(axis) / np.linalg.norm(axis)), EXACT)
    # Quaternions are good to a few units of 2^-52; the chord's inverse multiplies by 4 / 2 / cos(45 deg) at the most.
    np.testing.assert_allclose(errors, angle, rtol=0, atol=2.9 * 8 * 2.0**-52)


def test_a_nanoradian_is_resolved_and_a_quaternions_sign_means_nothing() -> None:
    turned = rotated(1e-9, np.array([0.0, 0.6, 0.8]))
    flipped = replace(turned, body_quaternion=-turned.body_quaternion)
    for trajectory in (turned, flipped):
        assert orientation_errors(trajectory, EXACT).max() == pytest.approx(1e-9, rel=1e-5)


def test_drift_rates_are_the_slopes_that_were_put_in() -> None:
    radial, angular, spin = 3e-4, -2e-3, 5e-3  # m/s, rad/s, rad/s^2
    q, qd = EXACT.q.copy(), EXACT.qd.copy()
    polar = np.arctan2(q[:, 1], q[:, 0]) + angular * TIMES
    radius = RADIUS + radial * TIMES
    q[:, 0], q[:, 1] = radius * np.cos(polar), radius * np.sin(polar)
    qd[:, REAR_ANGLE] += spin * TIMES
    measured = measure(replace(EXACT, q=q, qd=qd))
    # A bounded error b of the samples tilts a line over T by 3 b / T at the most.
    tilt = 3 * ROUND_OFF / TIMES[-1]
    assert measured["radius_drift_rate"] == pytest.approx(radial, rel=1e-12, abs=tilt)
    assert measured["phase_drift_rate"] == pytest.approx(angular, rel=1e-12, abs=tilt)
    assert measured["rear_rate_drift_rate"] == pytest.approx(spin, rel=1e-12, abs=10 * tilt)  # rates are of size 18
    assert measured["rear_rate_error"] == pytest.approx(spin * TIMES[-1], rel=1e-12)


def test_phase_follows_whole_turns() -> None:
    # Two turns a run faster than the reference: the difference of the polar angles wraps twice.
    rate = 4 * np.pi / TIMES[-1]
    q = EXACT.q.copy()
    polar = np.arctan2(q[:, 1], q[:, 0]) + rate * TIMES
    q[:, 0], q[:, 1] = RADIUS * np.cos(polar), RADIUS * np.sin(polar)
    assert measure(replace(EXACT, q=q))["phase_drift_rate"] == pytest.approx(rate, rel=1e-12)


def test_force_error_is_relative_to_the_largest_force_and_says_when() -> None:
    assert EXACT.contact_force is not None
    force = EXACT.contact_force.copy()
    largest = np.linalg.norm(force, axis=2).max()
    force[100, 1, 2] += 0.25 * largest
    measured = measure(replace(EXACT, contact_force=force))
    assert measured["contact_force_error"] == pytest.approx(0.25, rel=1e-12)
    assert measured["contact_force_error_at"] == 1.0


def test_energy_is_that_of_the_coordinates_from_its_first_value() -> None:
    q = EXACT.q.copy()
    q[:, 2] += 1e-3 * TIMES
    q[50, 2] -= 0.05
    measured = measure(replace(EXACT, q=q))
    weight = BICYCLE.gravity * sum(BICYCLE.body_mass(body) for body in BODIES)
    seen = observe(BICYCLE, BOWL, EXACT.q[:1], EXACT.qd[:1])
    size = float(seen.kinetic_energy[0] + seen.potential_energy[0])
    lowest, end = weight * (0.05 - 1e-3 * TIMES[50]), weight * 1e-3 * TIMES[-1]
    assert measured["energy_drift"] == pytest.approx(lowest / size, rel=1e-11)
    assert measured["energy_variation"] == pytest.approx(100 * (lowest + end) / size, rel=1e-11)
    q[50, 2] += 0.05
    assert measure(replace(EXACT, q=q))["energy_drift_rate"] == pytest.approx(1e-3 * weight, rel=1e-11)


def test_gap_and_slip_are_those_of_the_coordinates_whatever_is_reported() -> None:
    q, qd = EXACT.q.copy(), EXACT.qd.copy()
    q[10, 2] += 2e-3
    qd[:, REAR_ANGLE] *= 1.001
    silent = replace(EXACT, gap=np.zeros((N, 2)), slip=np.zeros((N, 2, 2)))
    measured = measure(replace(silent, q=q))
    seen = observe(BICYCLE, BOWL, q[10:11], qd[10:11])
    assert measured["max_gap"] == np.abs(seen.gap).max()
    assert measured["max_gap"] > 1e-3  # the ground is inclined
    # The rear wheel turns too fast by a thousandth, the front wheel rolls.
    slip = 1e-3 * EXACT.qd[0, REAR_ANGLE] * BICYCLE.rear_wheel_radius
    measured = measure(replace(silent, qd=qd))
    assert measured["max_slip"] == pytest.approx(slip, rel=1e-11)
    assert measured["mean_slip"] == pytest.approx(slip / 2, rel=1e-11)


def test_the_rate_error_is_the_largest_of_the_nine_relative_to_the_motions_sizes() -> None:
    speed, fastest = np.linalg.norm(EXACT.qd[:, :3], axis=1).max(), np.abs(EXACT.qd[:, YAW:]).max()
    for column, size in ((0, speed), (2, speed), (LEAN, fastest), (REAR_ANGLE, fastest)):
        qd = EXACT.qd.copy()
        qd[30, column] += 1e-3 * size
        assert measure(replace(EXACT, qd=qd))["rate_error"] == pytest.approx(1e-3, rel=1e-11)


@given(st.floats(-9, -5), st.floats(0.5, 4.0))
def test_horizon_is_where_the_growing_error_reaches_the_motions_size(exponent: float, rate: float) -> None:
    seed = 10.0**exponent
    growing = moved(np.outer(np.minimum(seed * np.exp(rate * TIMES), 10 * RADIUS), [0.0, 0.0, 1.0]))
    found = find_horizon(growing, EXACT, rate, RADIUS)
    # Round-off makes the smallest error wrong by ROUND_OFF / seed; its logarithm moves the horizon by that / rate.
    assert found == pytest.approx(np.log(RADIUS / seed) / rate, rel=1e-12, abs=2 * ROUND_OFF / seed / rate)


def test_an_error_that_has_grown_large_says_nothing_of_its_seed() -> None:
    seed, rate = 1e-6, 4.0
    error = seed * np.exp(rate * TIMES)
    error[error > 0.05 * RADIUS] *= 0.01  # the law holds for small errors only
    found = find_horizon(moved(np.outer(error, [0.0, 0.0, 1.0])), EXACT, rate, RADIUS)
    assert found == pytest.approx(np.log(RADIUS / seed) / rate, rel=1e-12, abs=2 * ROUND_OFF / seed / rate)


def test_an_error_that_outruns_the_law_ends_the_horizon() -> None:
    error = 1e-6 * np.exp(0.1 * TIMES)
    error[TIMES >= 1.0] = 2 * RADIUS  # a fall, say
    assert find_horizon(moved(np.outer(error, [0.0, 0.0, 1.0])), EXACT, 0.1, RADIUS) == 1.0
    everywhere = moved(np.full((len(TIMES), 3), RADIUS))
    assert find_horizon(everywhere, EXACT, 0.1, RADIUS) == 0.0


def test_least_normal_force_sees_a_ground_that_pulls() -> None:
    assert EXACT.contact_force is not None
    seen = observe(BICYCLE, BOWL, EXACT.q, EXACT.qd)
    force = EXACT.contact_force.copy()
    touching = replace(EXACT, contact_point=seen.point, contact_force=force)
    expected = np.einsum("nwi,nwi->nw", force, seen.normal).min()
    assert measure(touching)["min_normal_force"] == pytest.approx(expected, rel=1e-12)
    force[3, 1] = -2 * seen.normal[3, 1]
    assert measure(replace(touching, contact_force=force))["min_normal_force"] == pytest.approx(-2.0, rel=1e-12)
    assert measure(replace(touching, contact_force=None))["min_normal_force"] is None


@pytest.mark.parametrize("rate", [0.0, -0.4])
def test_a_motion_that_amplifies_nothing_has_no_horizon(rate: float) -> None:
    assert find_horizon(moved(np.array([1e-3, 0, 0])), EXACT, rate, RADIUS) is None


def test_a_bicycle_falls_when_its_frame_is_down() -> None:
    # The frame's centre is 0.9 m up when the bicycle stands: a tenth of that is down.
    q, position = EXACT.q.copy(), EXACT.body_position
    ground = BOWL.alpha * (position[:, 0, 0] ** 2 + position[:, 0, 1] ** 2)
    rest = q[:, 2] - position[:, 0, 2]
    sinking = TIMES > 1.5
    # At 1 m/s, through a tenth of 0.9 m between two samples.
    q[sinking, 2] = (rest + ground + 0.09 + 1.9963 - TIMES)[sinking]
    qd = EXACT.qd.copy()
    _, rate = heights_above_fallen(BICYCLE, BOWL, q, qd)
    qd[sinking, 2] -= (1 + rate)[sinking]
    falling = evaluate_ride(replace(EXACT, q=q, qd=qd), BICYCLE, BOWL)
    assert fell_at(falling, BICYCLE, BOWL) == pytest.approx(1.9963, abs=1e-14)
    assert until_fall(falling, BICYCLE, BOWL).time[-1] == TIMES[199] == 1.99
    assert until_fall(falling, BICYCLE, BOWL, beyond=1).time[-1] == TIMES[200]
    # What comes after the sample that has fallen is no ride: nothing of it is measured.
    after = replace(falling, qd=falling.qd + (np.arange(len(TIMES)) > 200)[:, None])
    assert measure(after)["rear_rate_error"] == 0.0
    assert measure(after)["fell_at"] == fell_at(falling, BICYCLE, BOWL)
    for height, fall in ((0.089, 0.0), (0.091, None)):
        q[:, 2] = rest + ground + height
        assert fell_at(evaluate_ride(replace(EXACT, q=q), BICYCLE, BOWL), BICYCLE, BOWL) == fall


def shorter(count: int) -> Trajectory:
    """A run a millimetre too high that ended after so many samples."""
    whole = replace(moved(np.array([0, 0, 1e-3])), ended="it stopped")
    fields = ("time", "q", "qd", "body_position", "body_quaternion", "contact_force")
    return replace(whole, **{name: getattr(whole, name)[:count] for name in fields})


@pytest.mark.parametrize("count", [1, 2, 150])
def test_a_run_that_ended_is_compared_as_far_as_it_went(count: int) -> None:
    measured = measure(shorter(count))
    assert measured["ended"] == "it stopped"
    assert measured["position_error"]["end"] == pytest.approx(1e-3, rel=0, abs=ROUND_OFF)
    assert (measured["radius_drift_rate"] is None) == (count == 1)  # no slope through one point


def test_what_an_engine_does_not_give_is_null() -> None:
    measured = measure(replace(EXACT, contact_force=None))
    for name in (
        "contact_force_error",
        "contact_force_error_at",
        "min_normal_force",
        "real_time_factor",
        "fell_at",
        "ended",
        "unconverged_steps",
        "largest_residual",
    ):
        assert measured[name] is None, name
    alone = measure(EXACT, reference=None)
    for name in (
        "position_error",
        "orientation_error",
        "rate_error",
        "rear_rate_error",
        "radius_drift_rate",
        "horizon",
    ):
        assert alone[name] is None, name
    straight = measure(EXACT, circular=False)
    assert straight["radius_drift_rate"] is None
    assert straight["phase_drift_rate"] is None
    assert straight["rear_rate_drift_rate"] == 0.0


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_numbers_that_are_none_never_reach_json(bad: float) -> None:
    q, force = EXACT.q.copy(), np.full((N, 2, 3), bad)
    q[-1, :YAW] = bad
    broken = replace(EXACT, q=q, contact_force=force, gap=np.full((N, 2), bad), slip=np.full((N, 2, 2), bad))
    with np.errstate(invalid="ignore"):
        measured = measure(broken, growth_rate=1.0)
    json.dumps(measured, allow_nan=False)
    assert measured["position_error"] == {"max": None, "end": None}
    assert measured["max_slip"] is None


def test_other_sample_times_are_refused() -> None:
    with pytest.raises(ValueError, match="not sampled at the same times"):
        position_errors(replace(EXACT, time=TIMES + 1e-9), EXACT)
