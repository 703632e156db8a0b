"""What a gated quantity may move by: as derived, and no less than what a disturbance of that size does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from velodrome.reference.bicycle import Bicycle
from velodrome.reference.families import find_motion
from velodrome.reference.kinematics import REAR_ANGLE
from velodrome.reference.stability import linearise
from velodrome.reference.surface import Paraboloid
from velodrome.reports.measure.limits import Scale, eigenvalue_limits, noise, order_limit, ride_limits, step_force
from velodrome.reports.measure.metrics import compute_metrics
from velodrome.reports.measure.steady import steady_trajectory
from velodrome.scenarios.gate.verdict import RIDE_QUANTITIES

SCALE = Scale(radius=2.0, speed=5.0, rear_rate=18.0, growth_rate=-0.1, duration=4.0, gravity=9.81, height=0.9)
BICYCLE, BOWL = Bicycle(), Paraboloid(0.005)
_, MOTION = find_motion(BICYCLE, BOWL, 18.0, 2)
EXACT = steady_trajectory(BICYCLE, MOTION, np.arange(41) / 10)


def test_noise_is_what_the_steps_add_and_the_motion_amplifies() -> None:
    # 1000 steps of 1e-10 each: 1e-7 of every size, and the start's 1e-11 more.
    assert noise(SCALE, 1e-10, 1000) == pytest.approx(1.0001e-7, rel=1e-14)
    assert noise(replace(SCALE, growth_rate=0.0), 1e-10, 1000) == noise(SCALE, 1e-10, 1000)
    growing = noise(replace(SCALE, growth_rate=0.5), 1e-10, 1000)
    assert growing == pytest.approx(1.0001e-7 * np.exp(2.0), rel=1e-14)
    # sqrt(9.81 / 0.9) = 3.3015 1/s over 4 s
    assert noise(SCALE, 1e-10, 1000, fell=True) == pytest.approx(1.0001e-7 * np.exp(4 * 3.30151), rel=1e-4)


def test_limits_are_noise_times_sensitivity() -> None:
    expected = {
        # In 4 s an error of the speed carries D away by ten times as much as one of the radius.
        "short_error": 2e-7 * 11,
        "position_error": 2e-7 * 11,
        "state_error": 1e-7 * 11,
        "radius_drift_rate": 3 * 2e-7 / 4,
        "phase_drift_rate": 3 * 1e-7 / 4,
        "rear_rate_drift_rate": 3 * 18e-7 / 4,
        "energy_drift": 2e-7,
        "max_gap": 2e-7,
        "max_slip": 5e-7,
        "mean_slip": 5e-7,
        "report_mismatch": 1.0,
        "contact_force_error": 1e-7 * 18**2 * 2 / 9.81,
        "settled_force_error": 1e-7 * 18**2 * 2 / 9.81,
        "rms_force_error": 1e-7 * 18**2 * 2 / 9.81,
        "fell_at": 2e-7 / np.sqrt(2 * 9.81 * 0.9),
        "steps": 1.0,
    }
    found = ride_limits(SCALE, 1e-7)
    assert found == pytest.approx(expected, rel=1e-14)
    # Every quantity has a limit, or it would never be judged.
    assert set(found) == set(RIDE_QUANTITIES)
    # What a step's noise adds to the forces, and a step more or less at every border of the ground's pieces.
    more = ride_limits(SCALE, 1e-7, step_force=1e-6, borders=3)
    forces = ("contact_force_error", "settled_force_error", "rms_force_error")
    expected |= {name: expected[name] + 1e-6 for name in forces} | {"steps": 4.0}
    assert more == pytest.approx(expected, rel=1e-14)


def test_a_steps_noise_put_right_within_the_step_takes_a_force() -> None:
    # 1e-12 of 2 m in steps of 1 ms, by a method whose beta is 1/4: 8e-6 m/s^2 of 9.81.
    assert step_force(SCALE, 1e-12, 1e-3) == pytest.approx(8e-6 / 9.81, rel=1e-14)


@given(hnp.arrays(float, len(EXACT.time), elements=st.floats(-1, 1)))
def test_a_bounded_disturbance_tilts_a_line_by_no_more_than_the_limit_says(disturbance: np.ndarray) -> None:
    # ride_limits() lets a slope move by 3 b / T where the samples move by b.
    qd = EXACT.qd.copy()
    qd[:, REAR_ANGLE] += disturbance
    measured = compute_metrics(replace(EXACT, qd=qd), EXACT, BICYCLE, BOWL, -1.0, 1.0, circular=True)
    scale = replace(SCALE, rear_rate=float(np.abs(disturbance).max()), duration=float(EXACT.time[-1]))
    round_off = 18 * 2.0**-50  # of rates of size 18
    assert abs(measured["rear_rate_drift_rate"]) <= ride_limits(scale, 1.0)["rear_rate_drift_rate"] + round_off


@given(st.floats(0.5, 8), st.lists(st.floats(-1, 1), min_size=3, max_size=3))
def test_errors_move_an_order_by_no_more_than_its_limit(order: float, errors: list[float]) -> None:
    size = 1e-5
    values = np.array([(4.0**order), 2.0**order, 1.0]) + size * np.array(errors)
    first, second = values[0] - values[1], values[1] - values[2]
    limit = order_limit(size, (first, second))
    assert limit is not None
    # The limit is of first order in the errors: their squares are 1e-5 of it.
    assert abs(np.log2(first / second) - order) <= limit * (1 + 1e-4) + 1e-14


def test_an_order_that_drowns_is_none() -> None:
    assert order_limit(1e-9, (1e-9, 1e-9)) is None
    assert order_limit(1e-9, (1e-6, 0.0)) is None


def test_errors_of_the_flow_move_eigenvalues_by_no_more_than_their_limits() -> None:
    from scipy.linalg import expm

    exact = linearise(BICYCLE, BOWL, *MOTION.state())
    interval, weight, error = 0.2, 2.0, 1e-9
    disturbances = np.full(7, 1e-3)
    scale = replace(SCALE, duration=1.5 * interval)
    limits = eigenvalue_limits(exact.jacobian, scale, error, disturbances, weight, interval)
    sizes = np.array([2.0, 2.0, 1, 1, 18, 18, 18])[:, None] * error * weight / disturbances
    rng = np.random.default_rng(5)
    first, second = expm(0.5 * interval * exact.jacobian), expm(1.5 * interval * exact.jacobian)
    nearest = 0.0
    for _ in range(50):
        flow = [matrix + sizes * rng.uniform(-1, 1, (7, 7)) for matrix in (first, second)]
        found = np.log(np.linalg.eigvals(flow[1] @ np.linalg.inv(flow[0])).astype(complex)) / interval
        distance = np.abs(exact.eigenvalues[:, None] - found[None, :]).min(axis=1)
        assert np.all(distance <= limits)
        nearest = max(nearest, float((distance / limits).max()))
    # And they are no dam so high that nothing reaches it: the worst of fifty draws comes to a tenth.
    assert nearest > 0.1
