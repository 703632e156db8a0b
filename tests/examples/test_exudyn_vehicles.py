"""Vehicles of the examples in Exudyn alone: closed form, energy, and bodies against a kinematic tree."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from typing import Any

import exudyn as exu
import numpy as np
import pytest

from velodrome.engines.exudyn.solve import no_progress
from velodrome.engines.rolling import observe_wheel

sys.path.insert(0, str(Path(__file__).parents[2] / "examples" / "rolling"))
VEHICLES: Any = importlib.import_module("vehicles")
RIDES: Any = importlib.import_module("exudyn_vehicles")
TREES: Any = importlib.import_module("exudyn_tree")
NODES: Any = exu.NodeType
# Newton's method leaves this part of a residual that starts as forces of the size of the weights.
LEFT = 1e-11


def ride(vehicle: Any, step: float, duration: float, **options: Any) -> Any:
    with no_progress():
        return RIDES.ride_vehicle(vehicle, step, duration, **options)


def weight(vehicle: Any) -> float:
    return VEHICLES.GRAVITY * sum(body.mass for body in vehicle.bodies)


def check_rolling(vehicle: Any, found: Any) -> None:
    """Gaps and constrained slips within what Newton's method leaves."""
    held = np.array([wheel.constrained[:2] for wheel in vehicle.wheels])
    assert np.abs(found.gap).max() < LEFT * weight(vehicle)
    assert np.abs(found.slip[:, held]).max() < LEFT * weight(vehicle)


@pytest.mark.parametrize("name", ["tricycle", "cart", "tandem"])
def test_start_stands_and_rolls(name) -> None:
    """Contacts of the start from the suite's own observation, within round-off of lengths and speeds of 10."""
    vehicle = getattr(VEHICLES, f"make_{name}")()
    for wheel in vehicle.wheels:
        body = vehicle.bodies[vehicle.number(wheel.body)]
        seen = observe_wheel(
            vehicle.surface, wheel.radius, body.position, body.rotation[:, 1], body.velocity, body.spin
        )
        slip = seen.slip[np.array(wheel.constrained[:2])]
        np.testing.assert_allclose([seen.gap, seen.gap_rate, *slip], 0, atol=1e-12)
    for (
        hinge
    ) in vehicle.hinges:  # both bodies have the same velocity there, and no spin across the axis but a common one
        pair = [vehicle.bodies[vehicle.number(each)] for each in (hinge.parent, hinge.body)]
        first, second = (each.velocity + np.cross(each.spin, hinge.point - each.position) for each in pair)
        np.testing.assert_allclose(first, second, atol=1e-12)
        np.testing.assert_allclose(np.cross(hinge.axis, pair[1].spin - pair[0].spin), 0, atol=1e-12)


def test_tricycle_keeps_its_circle() -> None:
    """Against the closed form: order two, and within 1e-7 m after a second at a step of 1 ms.

    A step of a motion that turns at a rate k is wrong by (k h)^3 / 12 of its radius, in 1 / h steps. The yaw rate is
    0.5 rad/s on circles of 2 m: 2e-8 m at h = 1 ms.
    """
    vehicle = VEHICLES.make_tricycle()
    errors, forces = [], []
    for step in (2e-3, 1e-3):
        found = ride(vehicle, step, 1.0)
        check_rolling(vehicle, found)
        errors.append(np.abs(found.position[-1] - VEHICLES.find_tricycle_positions(vehicle, 1.0)).max())
        exact = VEHICLES.find_tricycle_force(vehicle, 1.0)
        forces.append(np.abs(found.force[-1].sum(axis=0) - exact).max() / weight(vehicle))
        # The wheels' spins turn at up to 4 rad/s.
        assert np.abs(found.energy / found.energy[0] - 1).max() < (4 * step) ** 2
    assert errors[1] < 1e-7
    assert errors[0] / errors[1] == pytest.approx(4, rel=4 * 2e-3)
    assert forces[1] < (4 * 1e-3) ** 2


@pytest.mark.parametrize("node", [NODES.RotationRxyz, NODES.RotationRotationVector], ids=["Rxyz", "RotationVector"])
def test_tricycle_rides_on_other_nodes(node) -> None:
    """Until a wheel's angle about y, the second of Rxyz, is 1 rad: the angles' rates grow with 1 / cos towards pi/2."""
    vehicle = VEHICLES.make_tricycle()
    errors = []
    for step in (2e-3, 1e-3):
        found = ride(vehicle, step, 0.25, node_type=node)
        check_rolling(vehicle, found)
        errors.append(np.abs(found.position[-1] - VEHICLES.find_tricycle_positions(vehicle, 0.25)).max())
    # (k h)^2 / 12 of the way of the fastest body, for spins of 4 rad/s.
    assert errors[1] < (4 * 1e-3) ** 2 / 12 * 1.2 * 0.25 / np.cos(1.0) ** 2
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.1)


def test_cart_rides_in_its_bowl() -> None:
    """Eleven degrees of freedom, and ten constraints without the two redundant ones: it rides, on all four wheels."""
    vehicle = VEHICLES.make_cart()
    drifts = []
    for step in (4e-3, 2e-3):
        found = ride(vehicle, step, 2.0)
        check_rolling(vehicle, found)
        assert found.force[..., 2].min() > 0
        drifts.append(np.abs(found.energy / found.energy[0] - 1).max())
    # What is left out hardly slips: the lateral axes of an axle's wheels differ by the bowl's slope over the track.
    assert 1e-7 < np.abs(found.slip[:, [1, 3], 0]).max() < 1e-3
    spin = 1.7 / 0.25  # of the fastest wheel [rad/s]
    assert drifts[1] < (spin * 2e-3) ** 2
    assert drifts[0] / drifts[1] == pytest.approx(4, rel=spin * 4e-3)


def test_tandem_rides_as_bodies_and_as_a_tree() -> None:
    """Redundant coordinates and a kinematic tree with one joint for both wheels: apart by order two."""
    vehicle = VEHICLES.make_tandem()
    apart, forces = [], []
    for step in (4e-3, 2e-3):
        bodies = ride(vehicle, step, 1.0)
        with no_progress():
            tree = TREES.ride_tree(vehicle, step, 1.0)
        for found in (bodies, tree):
            check_rolling(vehicle, found)
            assert found.force[..., 2].min() > 0
        apart.append(np.abs(bodies.position - tree.position).max())
        forces.append(np.abs(bodies.force[-1] - tree.force[-1]).max() / weight(vehicle))
    spin = 5.0 / 0.33  # of the wheels [rad/s]
    assert apart[0] / apart[1] == pytest.approx(4, rel=spin * 4e-3)
    assert apart[1] < (spin * 2e-3) ** 2 / 12 * 5.0
    assert forces[1] < (spin * 2e-3) ** 2
