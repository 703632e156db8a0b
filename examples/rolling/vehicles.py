"""Vehicles on knife-edge wheels, described for any engine: a tricycle, a cart and a tandem.

A vehicle is a tree of rigid bodies: the first is its base, and every further one hangs on a hinge that turns freely.
Poses and velocities are those of the start, in which all wheels touch the ground and roll. SI units; z up; the axes
of all bodies are x forward, y left, z up before the vehicle is put on the ground, except where a wheel is steered.

Rows of wheels on one axle can be redundant: both wheels of a straight axle have the same lateral velocity, and a wheel
steered to a circle that the others keep already needs no lateral constraint of its own. `Wheel.constrained` leaves
such rows out. The lateral force then acts on the wheels that are left.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from velodrome.engines.rolling import observe_wheel
from velodrome.reference.surface import Paraboloid, Plane, Surface, evaluate

GRAVITY = 9.81
BASE_COORDINATES = ("forward", "left", "up", "lean", "pitch", "yaw")  # along and about the base's own axes
ALL_AXES = (True, True, True)
NOT_LATERAL = (False, True, True)


@dataclass(frozen=True)
class Body:
    """A rigid body: mass [kg], inertia about the mass centre in body axes [kg m^2], and its state at the start.

    `position` (3,) is that of the mass centre, `rotation` (3, 3) from body to inertial axes; `velocity` [m/s] and
    `spin` [rad/s] are in inertial axes.
    """

    name: str
    mass: float
    inertia: np.ndarray
    position: np.ndarray
    rotation: np.ndarray = field(default_factory=lambda: np.eye(3))
    velocity: np.ndarray = field(default_factory=lambda: np.zeros(3))
    spin: np.ndarray = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True)
class Hinge:
    """A free hinge between a body and its parent, through `point` [m] along the unit `axis`, in inertial axes."""

    name: str
    parent: str
    body: str
    point: np.ndarray
    axis: np.ndarray


@dataclass(frozen=True)
class Wheel:
    """A knife-edge wheel: the body's mass centre is its centre and the body's y axis its axle; `radius` [m].

    `constrained` tells which velocities of the contact are zero: lateral, forward, normal.
    """

    body: str
    radius: float
    constrained: tuple[bool, bool, bool] = ALL_AXES


@dataclass(frozen=True)
class Vehicle:
    """A vehicle on its ground; hinge number i carries body number i + 1."""

    bodies: tuple[Body, ...]
    hinges: tuple[Hinge, ...]
    wheels: tuple[Wheel, ...]
    surface: Surface

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates: six of the base, and the hinges."""
        return (*BASE_COORDINATES, *(hinge.name for hinge in self.hinges))

    def number(self, name: str) -> int:
        """Return the number of a body."""
        return [body.name for body in self.bodies].index(name)


def find_descendants(vehicle: Vehicle, hinge: int) -> set[str]:
    """Return the names of the bodies that a hinge turns."""
    found = {vehicle.hinges[hinge].body}
    for other in vehicle.hinges[hinge + 1 :]:
        if other.parent in found:
            found.add(other.body)
    return found


def velocity_columns(vehicle: Vehicle, body: str, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return velocity and spin of a body's material point per unit rate of each coordinate, both (3, n)."""
    base, count = vehicle.bodies[0], len(vehicle.coordinates)
    velocity, spin = np.zeros((3, count)), np.zeros((3, count))
    velocity[:, :3] = base.rotation
    axes, points, columns = list(base.rotation.T), [base.position] * 3, [3, 4, 5]
    for i, hinge in enumerate(vehicle.hinges):
        if body in find_descendants(vehicle, i):
            axes.append(hinge.axis)
            points.append(hinge.point)
            columns.append(6 + i)
    for axis, origin, column in zip(axes, points, columns, strict=True):
        velocity[:, column], spin[:, column] = np.cross(axis, point - origin), axis
    return velocity, spin


def rolling_rows(vehicle: Vehicle) -> tuple[np.ndarray, np.ndarray]:
    """Return the gaps (k,) and the contacts' velocities (k, 3, n) per unit rates: lateral, forward and normal."""
    gaps, rows = [], []
    for wheel in vehicle.wheels:
        body = vehicle.bodies[vehicle.number(wheel.body)]
        seen = observe_wheel(vehicle.surface, wheel.radius, body.position, body.rotation[:, 1])
        velocity, _ = velocity_columns(vehicle, wheel.body, seen.point)
        gaps.append(float(seen.gap))
        rows.append(np.stack([seen.lateral, seen.forward, seen.normal]) @ velocity)
    return np.array(gaps), np.array(rows)


def rotation_about(axis: np.ndarray, angle: float) -> np.ndarray:
    """Return the rotation matrix of a turn about a unit axis (Rodrigues)."""
    cross = np.cross(np.eye(3), axis)
    return np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross


def _turn(vehicle: Vehicle, names: set[str], point: np.ndarray, rotation: np.ndarray) -> Vehicle:
    """Turn some bodies, and the hinges that they carry, about a point."""
    bodies = tuple(
        replace(body, position=point + rotation @ (body.position - point), rotation=rotation @ body.rotation)
        if body.name in names
        else body
        for body in vehicle.bodies
    )
    hinges = tuple(
        replace(hinge, point=point + rotation @ (hinge.point - point), axis=rotation @ hinge.axis)
        if hinge.parent in names
        else hinge
        for hinge in vehicle.hinges
    )
    return replace(vehicle, bodies=bodies, hinges=hinges)


def move(vehicle: Vehicle, **changes: float) -> Vehicle:
    """Change coordinates by their names, one after the other."""
    for name, change in changes.items():
        base, column = vehicle.bodies[0], vehicle.coordinates.index(name)
        if column < 3:
            shift = change * base.rotation[:, column]
            vehicle = replace(
                vehicle,
                bodies=tuple(replace(body, position=body.position + shift) for body in vehicle.bodies),
                hinges=tuple(replace(hinge, point=hinge.point + shift) for hinge in vehicle.hinges),
            )
        elif column < 6:
            everything = {body.name for body in vehicle.bodies}
            vehicle = _turn(vehicle, everything, base.position, rotation_about(base.rotation[:, column - 3], change))
        else:
            hinge = vehicle.hinges[column - 6]
            turned = find_descendants(vehicle, column - 6)
            vehicle = _turn(vehicle, turned, hinge.point, rotation_about(hinge.axis, change))
    return vehicle


def set_down(vehicle: Vehicle, *free: str) -> Vehicle:
    """Close all gaps by changing as many coordinates (Newton's method, to round-off)."""
    columns = [vehicle.coordinates.index(name) for name in free]
    for _ in range(20):
        gaps, rows = rolling_rows(vehicle)
        if np.abs(gaps).max() < 1e-14:
            break
        changes = np.linalg.solve(rows[:, 2][:, columns], -gaps)
        vehicle = move(vehicle, **dict(zip(free, changes.tolist(), strict=True)))
    gaps, _ = rolling_rows(vehicle)
    if not np.abs(gaps).max() < 1e-12:
        raise ValueError(f"the wheels do not come down to the ground: gaps {gaps} m")
    return vehicle


def set_rolling(vehicle: Vehicle, **given: float) -> Vehicle:
    """Set all velocities: some rates as given, the rest such that the wheels roll without slip."""
    _, rows = rolling_rows(vehicle)
    chosen = rows[np.array([wheel.constrained for wheel in vehicle.wheels])]
    fixed = np.eye(len(vehicle.coordinates))[[vehicle.coordinates.index(name) for name in given]]
    values = np.concatenate([np.zeros(len(chosen)), list(given.values())])
    rates = np.linalg.solve(np.vstack([chosen, fixed]), values)
    bodies = []
    for body in vehicle.bodies:
        velocity, spin = velocity_columns(vehicle, body.name, body.position)
        bodies.append(replace(body, velocity=velocity @ rates, spin=spin @ rates))
    return replace(vehicle, bodies=tuple(bodies))


def _disc(name: str, mass: float, radius: float, centre: tuple[float, float], steer: float = 0.0) -> Body:
    """Return a uniform thin disc that stands on the plane."""
    across, axial = mass * radius**2 / 4, mass * radius**2 / 2
    turned = rotation_about(np.array([0.0, 0.0, 1.0]), steer)
    return Body(name, mass, np.diag([across, axial, across]), np.array([*centre, radius]), turned)


def _axle_hinge(parent: str, wheel: Body) -> Hinge:
    return Hinge(wheel.name, parent, wheel.name, wheel.position, wheel.rotation[:, 1])


CART_BOWL, TANDEM_BOWL = Paraboloid(0.05), Paraboloid(0.02)
TRICYCLE_RADIUS = 2.0  # of the circle of the middle of the rear axle [m]
TRICYCLE_RATE = 0.5  # [rad/s]


def make_tricycle() -> Vehicle:
    """Make a tricycle on the plane whose wheels roll on circles about one point: (0, `TRICYCLE_RADIUS`).

    The front wheel's axle points to it, as do those of the rear wheels. The chassis turns about it at `TRICYCLE_RATE`.
    Nothing drives or brakes it: all forces are constant in its axes, so the rate is kept.
    """
    base, half = 1.1, 0.35
    steer = math.atan2(base, TRICYCLE_RADIUS)
    wheels = (
        _disc("left", 2.0, 0.3, (0.0, half)),
        _disc("right", 2.0, 0.3, (0.0, -half)),
        _disc("front", 1.5, 0.25, (base, 0.0), steer),
    )
    chassis = Body("chassis", 25.0, np.array([[1.5, 0, 0.2], [0, 3.0, 0], [0.2, 0, 3.5]]), np.array([0.45, 0.02, 0.55]))
    vehicle = Vehicle(
        bodies=(chassis, *wheels),
        hinges=tuple(_axle_hinge("chassis", wheel) for wheel in wheels),
        wheels=(Wheel("left", 0.3), Wheel("right", 0.3, NOT_LATERAL), Wheel("front", 0.25)),
        surface=Plane(),
    )
    return set_rolling(vehicle, yaw=TRICYCLE_RATE)


def find_tricycle_positions(vehicle: Vehicle, time: float) -> np.ndarray:
    """Return the exact positions (4, 3) of the tricycle's bodies at a time [s]: they turn about the circles' centre."""
    centre = np.array([0.0, TRICYCLE_RADIUS, 0.0])
    turned = rotation_about(np.array([0.0, 0.0, 1.0]), TRICYCLE_RATE * time)
    return np.array([centre + turned @ (body.position - centre) for body in vehicle.bodies])


def find_tricycle_force(vehicle: Vehicle, time: float) -> np.ndarray:
    """Return the exact sum of all contact forces (3,): the masses times their accelerations, less their weights [N]."""
    centre = np.array([0.0, TRICYCLE_RADIUS, 0.0])
    force = np.zeros(3)
    for body, position in zip(vehicle.bodies, find_tricycle_positions(vehicle, time), strict=True):
        inward = (centre - position) * [1.0, 1.0, 0.0]
        force += body.mass * (TRICYCLE_RATE**2 * inward + np.array([0.0, 0.0, GRAVITY]))
    return force


def make_cart(surface: Surface = CART_BOWL, speed: float = 1.5) -> Vehicle:
    """Make a cart of four wheels in a bowl: a rigid rear axle, and a front beam that rocks about the forward axis.

    The front wheels are steered for good, each to the circles of 3 m about the rear axle's line. On the plane three
    of the four lateral constraints would say the same. So one rear wheel and one front wheel hold the cart laterally.
    """
    base, half, radius, turn = 1.0, 0.4, 0.25, 3.0
    left, right = math.atan2(base, turn - half), math.atan2(base, turn + half)
    wheels = (
        _disc("rear-left", 2.0, radius, (0.0, half)),
        _disc("rear-right", 2.0, radius, (0.0, -half)),
        _disc("front-left", 2.0, radius, (base, half), left),
        _disc("front-right", 2.0, radius, (base, -half), right),
    )
    chassis = Body("chassis", 60.0, np.diag([3.0, 8.0, 9.0]), np.array([0.45, 0.0, 0.45]))
    beam = Body("beam", 5.0, np.diag([0.4, 0.05, 0.4]), np.array([base, 0.0, radius]))
    rocking = Hinge("rocking", "chassis", "beam", beam.position, np.array([1.0, 0.0, 0.0]))
    vehicle = Vehicle(
        bodies=(chassis, beam, *wheels),
        hinges=(
            rocking,
            *(_axle_hinge(parent, wheel) for parent, wheel in zip(["chassis"] * 2 + ["beam"] * 2, wheels, strict=True)),
        ),
        wheels=tuple(
            Wheel(wheel.name, radius, ALL_AXES if wheel.name.endswith("left") else NOT_LATERAL) for wheel in wheels
        ),
        surface=surface,
    )
    return set_rolling(set_down(_place(vehicle, 2.5), "up", "lean", "pitch", "rocking"), forward=speed)


def make_tandem(surface: Surface = TANDEM_BOWL, speed: float = 5.0) -> Vehicle:
    """Make a tandem in a bowl: a frame with two riders, a fork, two wheels, and cranks that swing freely.

    It starts upright and straight ahead, across the slope, with a lean rate, and steers by itself.

    The cranks' mass centre is off their axis, since one pedal carries a load, so they move the whole tandem a little.
    """
    base, trail, tilt, rear, front = 1.75, 0.07, math.radians(17.0), 0.33, 0.35
    wheels = (_disc("rear-wheel", 2.5, rear, (0.0, 0.0)), _disc("front-wheel", 3.0, front, (base, 0.0)))
    frame = Body("frame", 165.0, np.array([[22.0, 0, 4.0], [0, 45.0, 0], [4.0, 0, 26.0]]), np.array([0.75, 0.0, 1.0]))
    fork = Body("fork", 4.5, np.array([[0.2, 0, -0.03], [0, 0.18, 0], [-0.03, 0, 0.04]]), np.array([1.66, 0.0, 0.7]))
    hub = np.array([0.55, 0.0, 0.3])
    cranks = Body("cranks", 4.0, np.diag([0.08, 0.06, 0.05]), hub + np.array([0.04, 0.0, -0.1]))
    vehicle = Vehicle(
        bodies=(frame, fork, cranks, *wheels),
        hinges=(
            Hinge(
                "steer",
                "frame",
                "fork",
                np.array([base + trail, 0.0, 0.0]),
                np.array([-math.sin(tilt), 0.0, math.cos(tilt)]),
            ),
            Hinge("crank", "frame", "cranks", hub, np.array([0.0, 1.0, 0.0])),
            _axle_hinge("frame", wheels[0]),
            _axle_hinge("fork", wheels[1]),
        ),
        wheels=(Wheel("rear-wheel", rear), Wheel("front-wheel", front)),
        surface=surface,
    )
    standing = set_down(_place(vehicle, 10.0), "up", "pitch")
    return set_rolling(standing, forward=speed, lean=0.05, steer=0.0, crank=1.0)


def _place(vehicle: Vehicle, distance: float) -> Vehicle:
    """Move a vehicle from the origin, heading along x, to a distance on the x axis, heading along y."""
    turned = rotation_about(np.array([0.0, 0.0, 1.0]), math.pi / 2)
    placed = _turn(vehicle, {body.name for body in vehicle.bodies}, np.zeros(3), turned)
    height = evaluate(vehicle.surface, np.array([distance]), np.zeros(1))[0, 0]
    return move(placed, left=-distance, up=height)
