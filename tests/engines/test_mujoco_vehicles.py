"""Vehicles of the examples on knife edges in MuJoCo: closed form, energy, redundant rows, and Exudyn."""

import importlib
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from velodrome.engines.engine import EngineError
from velodrome.engines.mujoco.compiled import INDEPENDENT, solve_dependent_rows, solve_independent_rows
from velodrome.engines.rolling import observe_wheel

sys.path.insert(0, str(Path(__file__).parents[2] / "examples" / "rolling"))
VEHICLES: Any = importlib.import_module("vehicles")
RIDES: Any = importlib.import_module("mujoco_vehicles")
# RK4's error of a step is (w h)^5 / 120 of what turns at the rate w; the fastest are the wheels, at less than 25 rad/s.
RATE, ROUND_OFF = 25.0, 2.0**-52


def local_error(step: float) -> float:
    return (RATE * step) ** 5 / 120


def find_weight(vehicle: Any) -> float:
    return VEHICLES.GRAVITY * sum(body.mass for body in vehicle.bodies)


def find_speeds(vehicle: Any) -> float:
    return max(float(np.linalg.norm(body.velocity)) for body in vehicle.bodies)


@pytest.mark.parametrize("rolling", ["contacts", "forces"])
def test_tricycle_keeps_its_circle(rolling) -> None:
    """Closed form, 1 s: within 1e-7 m at 2 ms.

    The speeds are constant, so RK4 turns every wheel by a constant angle and errs in the yaw alone, by far less than in
    the wheels' turns. Rows of the softness R creep by R F / b; 1e-5 of MuJoCo's R = (1e-4 / 0.9999) A, A the wheel's
    inverse weight of about 1 / kg, at a few hundred N and b = 40 1/s, are 1e-8 m/s.
    """
    vehicle = VEHICLES.make_tricycle()
    found = RIDES.ride_vehicle(vehicle, 1.0, 0.002, rolling)
    exact = np.array([VEHICLES.find_tricycle_positions(vehicle, time) for time in found.time])
    off = np.linalg.norm(found.position - exact, axis=2).max()
    creep = 1e-8 if rolling == "contacts" else 0.0
    assert off < creep + 500 * local_error(0.002) * 2.0
    assert off < 1e-7
    force = np.array([VEHICLES.find_tricycle_force(vehicle, time) for time in found.time])
    # Forces are accelerations of the state's error, at rates of the stabilisation.
    np.testing.assert_allclose(found.force.sum(axis=1), force, rtol=0, atol=1e-6 * find_weight(vehicle))
    assert np.ptp(found.energy) < 1e-7 * abs(found.energy[0])
    assert found.standing


def test_redundant_rows_change_nothing_but_the_division_of_forces() -> None:
    """All three wheels of the tricycle held laterally: the rear ones say the same."""
    vehicle = VEHICLES.make_tricycle()
    whole = replace(vehicle, wheels=tuple(replace(wheel, constrained=(True, True, True)) for wheel in vehicle.wheels))
    found, expected = (RIDES.ride_vehicle(each, 0.5, 0.002, "forces") for each in (whole, vehicle))
    np.testing.assert_allclose(found.position, expected.position, rtol=0, atol=250 * local_error(0.002))
    total = find_weight(vehicle)
    np.testing.assert_allclose(found.force.sum(axis=1), expected.force.sum(axis=1), rtol=0, atol=1e-9 * total)
    # The smallest forces are shared by both rear wheels, not carried by one.
    assert np.abs(expected.force[0, 1, 1]) < 1e-9 * total
    assert np.abs(found.force[0, 1, 1]) > 0.1 * np.abs(expected.force[0, 0, 1])


def test_contradicting_rows_are_seen() -> None:
    """All four wheels of the cart held laterally, in a bowl."""
    cart = VEHICLES.make_cart()
    whole = replace(cart, wheels=tuple(replace(wheel, constrained=(True, True, True)) for wheel in cart.wheels))
    with pytest.raises(EngineError, match="constraints of rolling contradict each other"):
        RIDES.ride_vehicle(whole, 0.01, 0.001, "forces", samples=1)


def make_toe(angle: float) -> Any:
    """Return the tricycle with all wheels held laterally and the right axle turned by an angle [rad]."""
    vehicle = VEHICLES.make_tricycle()
    number, turn = vehicle.number("right"), VEHICLES.rotation_about(np.array([0.0, 0.0, 1.0]), angle)
    bodies, hinges = list(vehicle.bodies), list(vehicle.hinges)
    bodies[number] = replace(bodies[number], rotation=bodies[number].rotation @ turn)
    hinges = [replace(h, axis=bodies[number].rotation[:, 1]) if h.body == "right" else h for h in hinges]
    wheels = tuple(replace(wheel, constrained=(True, True, True)) for wheel in vehicle.wheels)
    return replace(vehicle, wheels=wheels, bodies=tuple(bodies), hinges=tuple(hinges))


@pytest.mark.parametrize("angle", [1e-7, 1e-5, 1e-3])
def test_axles_that_nearly_agree_are_refused_by_name(angle) -> None:
    """The right wheel's lateral direction turns by the angle, and the wheel's acceleration across it remains."""
    with pytest.raises(EngineError, match=r"contradict each other by .* on the wheels 'left', 'right'") as error:
        RIDES.ride_vehicle(make_toe(angle), 0.1, 0.001, "forces", samples=1)
    share = float(str(error.value).split(" by ")[1].split()[0])
    # A share of accelerations of about its own size, and no more than the angle.
    assert angle / 30 < share < angle


def test_axles_that_agree_but_for_round_off_roll() -> None:
    """An angle of 1e-10 moves the vehicle by as much of its way, and no force by more than its share."""
    found, expected = (RIDES.ride_vehicle(make_toe(angle), 0.5, 0.001, "forces", samples=5) for angle in (1e-10, 0.0))
    assert found.standing
    np.testing.assert_allclose(found.position, expected.position, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.force, expected.force, rtol=0, atol=1e-8 * find_weight(make_toe(0.0)))


@pytest.mark.parametrize("name", ["cart", "tandem"])
def test_forces_of_rolling_ride_in_a_bowl(name) -> None:
    """Energy is kept, gaps stay closed, and the motion converges with the step's fourth power."""
    vehicle = getattr(VEHICLES, f"make_{name}")()
    rides = {step: RIDES.ride_vehicle(vehicle, 1.0, step, "forces") for step in (0.004, 0.002, 0.001)}
    ends = {step: ride.position[-1] for step, ride in rides.items()}
    order = np.log2(np.linalg.norm(ends[0.004] - ends[0.002]) / np.linalg.norm(ends[0.002] - ends[0.001]))
    assert order > 3.5
    found, speed = rides[0.001], find_speeds(vehicle)
    # The step's error moves lengths by as much as it does speeds in 1 s.
    bound = 1000 * local_error(0.001) * speed
    assert np.abs(found.gap).max() < bound
    assert np.ptp(found.energy) < bound * find_weight(vehicle)
    assert found.standing


def test_tandem_under_contacts_is_the_one_under_forces() -> None:
    """Nearly rigid rows creep by 1e-8 m/s (see the tricycle), which its falling over amplifies by e^(3 t) or so."""
    vehicle = VEHICLES.make_tandem()
    contacts, forces = (RIDES.ride_vehicle(vehicle, 1.0, 0.001, rolling) for rolling in ("contacts", "forces"))
    np.testing.assert_allclose(contacts.position, forces.position, rtol=0, atol=1e-8 * np.exp(3.0))
    np.testing.assert_allclose(contacts.force, forces.force, rtol=0, atol=1e-6 * find_weight(vehicle))


def test_cart_under_contacts_scrubs() -> None:
    """Friction holds all four wheels laterally, which cannot all roll: they strain, and energy is lost, never won."""
    vehicle = VEHICLES.make_cart()
    found = RIDES.ride_vehicle(vehicle, 1.0, 0.001, "contacts")
    free = RIDES.ride_vehicle(vehicle, 1.0, 0.001, "forces")
    assert found.standing
    assert np.all(np.diff(found.energy) < 1e-9 * abs(found.energy[0]))
    strain = np.abs(found.force - free.force).max()
    assert strain > 10.0
    # Inside the cone of friction 2 at the start, and not far from where it rolls.
    for wheel, force in zip(vehicle.wheels, found.force[0], strict=True):
        body = vehicle.bodies[vehicle.number(wheel.body)]
        normal = observe_wheel(vehicle.surface, wheel.radius, body.position, body.rotation[:, 1]).normal
        load = force @ normal
        assert np.linalg.norm(force - load * normal) < 2.0 * load * (1 + 1e-6)
    assert np.linalg.norm(found.position - free.position, axis=2).max() < 1e-3


@pytest.mark.parametrize(
    ("name", "rolling"),
    [pytest.param("tandem", "contacts", marks=pytest.mark.slow), ("tandem", "forces"), ("cart", "forces")],
)
def test_vehicles_agree_with_exudyn(name, rolling) -> None:
    """At 1 ms within 1e-5 m: what Exudyn's second-order method leaves."""
    other: Any = pytest.importorskip("exudyn_vehicles")
    vehicle = getattr(VEHICLES, f"make_{name}")()
    found, expected = RIDES.ride_vehicle(vehicle, 1.0, 0.001, rolling), other.ride_vehicle(vehicle, 0.001, 1.0)
    np.testing.assert_allclose(found.time, expected.time, atol=1e-9)
    np.testing.assert_allclose(found.position, expected.position, rtol=0, atol=1e-5)
    coarse = other.ride_vehicle(vehicle, 0.002, 1.0).position
    ratio = np.abs(coarse - found.position).max() / np.abs(expected.position - found.position).max()
    # The difference falls with Exudyn's step as its method's second order says, or faster: it is Exudyn's.
    assert ratio > 2**1.5


@pytest.mark.slow
def test_script_tells_all_rides(capsys) -> None:
    RIDES.main()
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[1:]] == ["tricycle"] * 4 + ["cart"] * 4 + ["tandem"] * 4
    # The tricycle's distance from its exact circle.
    assert all(float(line.split()[4]) < 1e-7 for line in lines[1:5])


# ---------------------------------------------------------------------------------------------- redundant rows


def make_rows(scales: list[float]) -> tuple[np.ndarray, np.ndarray]:
    """Return J M^-1 J^T of three independent rows and two that depend on them, and J."""
    rng = np.random.default_rng(1)
    rows = rng.normal(size=(3, 8))
    rows = np.vstack([rows, rows[0] + 2 * rows[1], rows[2]]) * np.array(scales)[:, None]
    return rows @ rows.T, rows


def test_cost_of_forces_decides_which_are_the_smallest() -> None:
    schur, rows = make_rows([1.0] * 5)
    target, cost = rows @ np.ones(8), np.array([1.0, 4.0, 0.5, 2.0, 9.0])
    found = target.copy()
    solve_dependent_rows(schur, found, cost, np.empty((2, 5)))
    root = np.sqrt(cost)
    least = np.linalg.lstsq(schur / root, target, rcond=1e-10)[0] / root
    np.testing.assert_allclose(found, least, rtol=0, atol=1e-10 * np.abs(least).max())


@pytest.mark.parametrize("scales", [[1.0] * 5, [1.0, 1e3, 1e-3, 1e2, 1.0]])
def test_redundant_rows_have_the_smallest_forces(scales) -> None:
    schur, rows = make_rows(scales)
    target = rows @ np.random.default_rng(2).normal(size=8)
    found = target.copy()
    assert not solve_independent_rows(schur, found, 5)
    residual, dependence = solve_dependent_rows(schur, found, np.diag(schur).copy(), np.empty((2, 5)))
    assert residual < 1e-12 * np.abs(target).max()
    assert dependence == 0
    np.testing.assert_allclose(schur @ found, target, rtol=0, atol=1e-12 * np.abs(target).max())
    # Of all solutions the least in sqrt(S_ii) F_i: a least-squares problem without a weight.
    weight = np.sqrt(np.diag(schur))
    least = np.linalg.lstsq(schur / weight[:, None] / weight, target / weight, rcond=1e-10)[0] / weight
    np.testing.assert_allclose(found * weight, least * weight, rtol=0, atol=1e-6 * np.abs(least * weight).max())


def test_contradicting_rows_leave_a_residual() -> None:
    schur, rows = make_rows([1.0] * 5)
    target = rows @ np.ones(8)
    target[4] += 1e-3 * np.abs(target).max()
    share = np.empty((2, 5))
    residual, dependence = solve_dependent_rows(schur, target, np.ones(5), share)
    assert residual > 1e-4 * np.abs(target).max()
    assert dependence == 0
    # Row 4 is row 2 again: these two contradict each other, and no other.
    np.testing.assert_allclose(share[0, [0, 1, 3]], 0, atol=1e-12 * share[0].max())


def test_independent_rows_are_solved_directly() -> None:
    rows = np.random.default_rng(3).normal(size=(4, 8))
    schur, target = rows @ rows.T, np.arange(1.0, 5.0)
    found = target.copy()
    assert solve_independent_rows(schur, found, 4)
    assert np.linalg.det(schur / np.diag(schur)) > INDEPENDENT
    condition = np.linalg.cond(schur)
    np.testing.assert_allclose(found, np.linalg.solve(schur, target), rtol=10 * condition * ROUND_OFF)


@pytest.mark.parametrize("angle", [1e-5, 1e-4, 1e-3])
def test_nearly_dependent_rows_are_told_and_have_no_large_forces(angle) -> None:
    """Two rows at an angle have the eigenvalue 1 - cos(angle) of their Gram matrix; which force parts them is moot."""
    rows = np.array([[1.0, 0.0], [np.cos(angle), np.sin(angle)]])
    schur, target, share = rows @ rows.T, np.array([1.0, 1.0 + 0.5 * angle]), np.empty((2, 2))
    assert not solve_independent_rows(schur, target.copy(), 2)
    residual, dependence = solve_dependent_rows(schur, target, np.ones(2), share)
    # The entries of the matrix are rounded.
    np.testing.assert_allclose(dependence, 1 - np.cos(angle), rtol=0, atol=10 * ROUND_OFF)
    np.testing.assert_allclose(residual, 0.25 * angle, rtol=1e-3)
    np.testing.assert_allclose(share[1], 0.5, rtol=1e-9)
    np.testing.assert_allclose(target, 0.5, atol=angle)
