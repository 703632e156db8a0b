"""Reports and rates against the coordinates: what follows, how far apart they may be, and what is found."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from velodrome.engines.engine import REFERENCE, Trajectory
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.contact import observe
from velodrome.reference.families import find_motion
from velodrome.reference.kinematics import LEAN, YAW, body_positions, quaternions, rotations
from velodrome.reference.surface import Paraboloid
from velodrome.reports.measure.consistency import (
    LARGEST_NOISE,
    ROOM,
    Mismatch,
    _integrate_samples,
    describe_mismatch,
    evaluate_ride,
    find_mismatches,
)
from velodrome.reports.measure.limits import START_ERROR
from velodrome.reports.measure.steady import steady_trajectory

BICYCLE, BOWL = Bicycle(), Paraboloid(0.005)
_, MOTION = find_motion(BICYCLE, BOWL, 18.0, 2)
RADIUS = float(np.hypot(*MOTION.position[:2]))
TIMES = np.arange(201) / 100
EXACT = evaluate_ride(steady_trajectory(BICYCLE, MOTION, TIMES), BICYCLE, BOWL)


def found(ride: Trajectory, exact: Trajectory | None = EXACT, noise: float = 0.0) -> dict[str, Mismatch]:
    followed = evaluate_ride(ride, BICYCLE, BOWL)
    return {mismatch.quantity: mismatch for mismatch in find_mismatches(ride, followed, exact, RADIUS, noise)}


def test_what_follows_is_what_the_kinematics_and_the_contact_equations_say() -> None:
    seen = observe(BICYCLE, BOWL, EXACT.q, EXACT.qd)
    np.testing.assert_array_equal(EXACT.body_position, body_positions(BICYCLE, EXACT.q))
    turned = quaternions(rotations(BICYCLE, EXACT.q))
    dot = np.abs(np.sum(turned * EXACT.body_quaternion, axis=-1))
    np.testing.assert_allclose(dot, 1, rtol=0, atol=8 * 2.0**-52)
    for name, values in (("contact_point", seen.point), ("gap", seen.gap), ("slip", seen.slip)):
        np.testing.assert_array_equal(getattr(EXACT, name), values)


def test_a_wheel_without_a_contact_point_has_none_in_that_sample_only() -> None:
    q = EXACT.q.copy()
    q[7, LEAN] = np.nan
    followed = evaluate_ride(replace(EXACT, q=q), BICYCLE, BOWL)
    for values, exact in ((followed.gap, EXACT.gap), (followed.slip, EXACT.slip)):
        assert values is not None
        assert exact is not None
        assert np.isnan(values[7]).all()
        np.testing.assert_array_equal(np.delete(values, 7, axis=0), np.delete(exact, 7, axis=0))


@pytest.mark.parametrize("even", [True, False])
@pytest.mark.parametrize("samples", [2, 4, 6])
def test_the_quadrature_is_exact_for_polynomials_of_its_degree(samples: int, even: bool) -> None:
    time = np.linspace(0, 2, 12) if even else np.cumsum(np.linspace(0.1, 0.3, 12))
    values = np.column_stack([time**k for k in range(samples)])
    integral = np.column_stack([np.diff(time ** (k + 1)) / (k + 1) for k in range(samples)])
    np.testing.assert_allclose(_integrate_samples(time, values, samples), integral, rtol=1e-11, atol=1e-12)


@pytest.mark.parametrize("samples", [4, 6])
def test_the_quadratures_error_falls_with_its_order(samples: int) -> None:
    errors = []
    for n in (41, 81):
        time = np.linspace(0, 2, n)
        exact = np.diff(np.sin(3 * time))[:, None]
        inside = slice(samples, -samples)
        errors.append(np.abs(_integrate_samples(time, 3 * np.cos(3 * time)[:, None], samples) - exact)[inside].max())
    # Of an interval: one power more than of the whole. The next power is (3 h)^2 smaller.
    assert np.log2(errors[0] / errors[1]) == pytest.approx(samples + 1, abs=0.1)


def test_what_agrees_has_no_difference() -> None:
    for mismatch in found(EXACT).values():
        assert mismatch.holds
        assert mismatch.difference < 1e-11


def test_a_report_is_named_with_its_part_its_time_and_its_limit() -> None:
    position = EXACT.body_position.copy()
    position[30, 3, 1] += 2e-3
    mismatch = found(replace(EXACT, body_position=position), noise=1e-10)["body_position"]
    assert (mismatch.part, mismatch.time, mismatch.unit, mismatch.holds) == ("front_wheel", 0.3, "m", False)
    assert mismatch.difference == pytest.approx(2e-3, rel=1e-12)
    assert mismatch.limit == pytest.approx(RADIUS * (START_ERROR + 1e-10), rel=1e-2)  # and the last digit of an angle
    words = (
        "its position of the front wheel is 0.002 m from what follows from its coordinates at 0.3 s, limit 2.6e-10 m"
    )
    assert describe_mismatch(mismatch.as_json()) == words


def test_no_claim_of_noise_makes_more_room_than_there_is() -> None:
    limits = [found(EXACT, noise=noise)["gap"].limit for noise in (LARGEST_NOISE, 1.0)]
    assert limits[0] == limits[1]


def test_an_error_of_the_coordinates_makes_room_from_then_on_and_not_before() -> None:
    error = 1e-4
    q, late = EXACT.q.copy(), TIMES[:, None] > 0.5
    q[:, :2] += late * error * RADIUS
    wrong = evaluate_ride(replace(EXACT, q=q), BICYCLE, BOWL)
    within = 0.9 * ROOM * error * RADIUS
    for when, allowed in ((late, True), (~late, False)):
        ride = replace(wrong, body_position=wrong.body_position + when[..., None] * [0, 0, within])
        assert found(ride)["body_position"].holds == allowed


def test_rates_must_be_the_derivatives_of_the_coordinates() -> None:
    for column, unit in ((0, "m/s"), (YAW, "rad/s")):
        qd = EXACT.qd.copy()
        qd[:, column] += 1e-6
        mismatch = found(replace(EXACT, qd=qd))["qd"]
        assert not mismatch.holds
        assert mismatch.unit == unit
        assert mismatch.difference == pytest.approx(1e-6, rel=1e-3)
    # A whole turn is none.
    q = EXACT.q.copy()
    q[50:, YAW] += 2 * np.pi
    assert found(replace(EXACT, q=q))["qd"].holds


def test_rates_too_large_to_integrate_are_no_derivatives() -> None:
    for samples in (slice(None, None, 2), slice(50, None), slice(20, 21)):
        qd = EXACT.qd.copy()
        qd[samples, 0] = 1e308
        mismatch = found(replace(EXACT, qd=qd))["qd"]
        assert not mismatch.holds
        json.dumps(mismatch.as_json(), allow_nan=False)


def test_one_error_of_coordinates_and_rates_is_no_contradiction() -> None:
    # An engine that rides another motion is wrong, not inconsistent.
    q, qd = EXACT.q.copy(), EXACT.qd.copy()
    q[:, LEAN] += 1e-3 * np.sin(5 * TIMES)
    qd[:, LEAN] += 5e-3 * np.cos(5 * TIMES)
    assert all(mismatch.holds for mismatch in found(evaluate_ride(replace(EXACT, q=q, qd=qd), BICYCLE, BOWL)).values())


def test_without_a_reference_the_start_is_judged_and_the_reference_all_along() -> None:
    for name, since, holds in (("own", 0, False), ("own", 1, True), (REFERENCE, 1, False)):
        position = EXACT.body_position.copy()
        position[since:] += 1e-3
        ride = replace(EXACT, engine=name, body_position=position)
        assert found(ride, exact=None)["body_position"].holds == holds, (name, since)


def test_what_is_not_given_or_no_number_is_not_judged() -> None:
    assert EXACT.slip is not None
    ride = replace(EXACT, gap=None, slip=np.full_like(EXACT.slip, np.nan), kinetic_energy=None)
    mismatch = found(ride)
    assert {"gap", "kinetic_energy"}.isdisjoint(mismatch)
    assert mismatch["slip"].holds
    assert set(found(EXACT.first(3))) == set(found(EXACT)) - {"qd"}
