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


def displaced(reference: Trajectory, creep: float, forward: float) -> Trajectory:
    """The ride with D's rates changed by the slip that creep brings, and the wheels' rates by a slip forward."""
    own = contact_acceleration(Bicycle(), Plane(), reference.q, reference.qd)
    assert reference.contact_point is not None
    qd = reference.qd.copy()
    # On a steady circle J' q' of both wheels is one vector, opposite to the acceleration of D.
    qd[:, :2] += creep * np.linalg.norm(own[:, :1], axis=2) * reference.q[:, :2] / np.hypot(*reference.q[0, :2])
    qd[:, 7] -= forward / Bicycle().rear_wheel_radius
    qd[:, 8] -= forward / Bicycle().front_wheel_radius
    return replace(reference, qd=qd)


def test_a_slip_along_that_acceleration_is_creep(reference: Trajectory) -> None:
    found = measure_creep(displaced(reference, 1e-6, 0.0), Bicycle(), Plane())
    assert found is not None
    # The slip itself changes J' q' by some of its own relative size, 1e-6 s x 12 m/s^2 in 5 m/s.
    assert found.time == pytest.approx(1e-6, rel=1e-4)
    assert found.slip_time == pytest.approx(1e-6, rel=1e-4)
    assert found.share == pytest.approx(1, abs=1e-8)


def test_other_slip_is_not(reference: Trajectory) -> None:
    found = measure_creep(displaced(reference, 0.0, 1e-5), Bicycle(), Plane())
    mixed = measure_creep(displaced(reference, 1e-6, 1e-5), Bicycle(), Plane())
    assert found is not None
    assert mixed is not None
    # The share of the direction forward in J' q', which is the same in both.
    assert found.share < 0.1
    assert mixed.time == pytest.approx(1e-6 + found.time, rel=1e-4)
    assert found.share < mixed.share < 1


def test_a_ride_that_does_not_slip_does_not_creep(reference: Trajectory) -> None:
    found = measure_creep(reference, Bicycle(), Plane())
    assert found is not None
    assert found.slip_time < 1e-12
    assert abs(found.time) <= found.slip_time


def test_there_is_no_creep_before_contacts_have_settled(reference: Trajectory) -> None:
    assert measure_creep(reference.until(0.19), Bicycle(), Plane()) is None
    assert measure_creep(reference.until(0.2), Bicycle(), Plane()) is not None


def test_there_is_no_creep_in_a_straight_ride() -> None:
    changes = {"simulation.duration": 0.5, "perturbation.lean_rate": 0.0}
    problem = make_start(load_scenario("iftomm-2", changes)[1]).problem
    straight = ENGINE.simulate(problem, ENGINE.settings(), lambda _: None)
    assert measure_creep(straight, Bicycle(), Plane()) is None
