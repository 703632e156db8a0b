"""The acceleration that rolling needs, and the creep of a ride against it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from velodrome.engines.engine import Trajectory
from velodrome.engines.lagrange import ENGINE
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.surface import Plane
from velodrome.reports.measure.creep import contact_acceleration, measure_creep
from velodrome.scenarios.scenario.schema import load_scenario
from velodrome.scenarios.scenario.start import make_start

PROBLEM = make_start(load_scenario("plane-circle", {"simulation.duration": 0.5})[1]).problem


@pytest.fixture(scope="module")
def reference() -> Trajectory:
    return ENGINE.simulate(PROBLEM, ENGINE.settings(), lambda _: None)


def test_on_a_circle_of_the_plane_the_acceleration_is_centripetal(reference: Trajectory) -> None:
    """On a steady circle of the plane only D's coordinates accelerate, by u^2 / R; their part of J is the identity."""
    found = np.linalg.norm(contact_acceleration(Bicycle(), Plane(), reference.q, reference.qd), axis=2)
    speed, radius = np.hypot(*PROBLEM.qd[:2]), np.hypot(*PROBLEM.q[:2])
    # The motion's residual and the projection of the ride are of the order of round-off times the growth of a ride.
    np.testing.assert_allclose(found, speed**2 / radius, rtol=1e-9)


def test_creep_is_the_mean_slip_over_that_acceleration(reference: Trajectory) -> None:
    # A faster front wheel slides forward by radius times the added rate.
    qd = reference.qd.copy()
    qd[:, 8] += 0.1
    found = measure_creep(replace(reference, qd=qd), reference, Bicycle(), Plane())
    assert found is not None
    slip = 0.1 * Bicycle().front_wheel_radius / 2  # the mean of both wheels
    assert found.slip == pytest.approx(slip, rel=1e-9)
    assert found.time == pytest.approx(slip / found.acceleration)


def test_there_is_no_creep_before_contacts_have_settled(reference: Trajectory) -> None:
    assert measure_creep(reference.until(0.19), reference, Bicycle(), Plane()) is None
    assert measure_creep(reference.until(0.2), reference, Bicycle(), Plane()) is not None


def test_there_is_no_creep_in_a_straight_ride() -> None:
    changes = {"simulation.duration": 0.5, "perturbation.lean_rate": 0.0}
    problem = make_start(load_scenario("iftomm-2", changes)[1]).problem
    straight = ENGINE.simulate(problem, ENGINE.settings(), lambda _: None)
    assert measure_creep(straight, straight, Bicycle(), Plane()) is None
