"""The Whipple bicycle on the level plane as symbrim has it: Kane's equations, derived once a process.

symbrim's axes are x forward, y right, z down; its rear frame is aligned with the steering axis. Eight
coordinates q and as many speeds u = q': rear contact's x and y, yaw, roll, pitch, rear-wheel angle, steer,
front-wheel angle. All that is here is in symbrim's axes and coordinates; `coordinates` knows the suite's.

Kane's equations of the eight speeds with the five velocity constraints C(q) u = 0 of the tyres (the front
wheel stays on the ground, neither wheel slips in x or y), one multiplier each:

    [M  -C^T] [u'    ]   [f     ]
    [C    0 ] [lambda] = [-C' u ]

The multipliers of the front wheel are its contact force. symbrim gives all bodies the velocities that they have
when the rear wheel rolls, so the rear wheel's multipliers are no forces; its contact force is what the momentum
P(q, u) of the bicycle needs beside the front wheel's and the weight:

    P_u u' + P_q u = rear force + front force + weight
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from typing import Any

import numpy as np
import symbrim as sb
from sympy import Matrix, Symbol, lambdify
from sympy.physics.mechanics import KanesMethod, Point, System, kinetic_energy, linear_momentum

from velodrome.reference.bicycle import Bicycle

# The suite's own checks run where symbrim is not installed.
# pyright: reportMissingImports=false

SPEEDS, CONSTRAINTS = 8, 5
BODIES = ("rear_frame", "front_frame", "rear_wheel", "front_wheel")
_GRAVITY = Symbol("g")
_ALONG_STEERING_AXIS = Symbol("d")


class Equations:
    """Equations of one bicycle.

    Parameters
    ----------
    bicycle : Bicycle
    """

    def __init__(self, bicycle: Bicycle) -> None:
        bike, motion, observation = _compiled()
        self.tilt = bicycle.steer_axis_tilt
        parameters = constants(bike, bicycle).values()
        self._motion = lambda x: np.array(motion(*x.tolist(), *parameters))
        self._observation = lambda x: np.array(observation(*x.tolist(), *parameters))

    def derivative(self, _: float, x: np.ndarray) -> np.ndarray:
        """Rate of the state x = (q, u), shape (16,), as scipy's integrators call it."""
        return np.concatenate([x[SPEEDS:], self._solve(x)[0]])

    def contact_forces(self, x: np.ndarray) -> np.ndarray:
        """Forces of the ground on the rear and the front wheel, shape (n, 2, 3) [N], along states (n, 16)."""
        found = np.empty((len(x), 2, 3))
        for (rear, front), state in zip(found, x, strict=True):
            _, multipliers, both = self._solve(state)
            up, *along = multipliers[:3]
            front[:] = *along, -up
            rear[:] = both - front
        return found

    def reference_point(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position and velocity of the suite's point D, shapes (n, 3) [m, m/s], along states (n, 16)."""
        seen = self._observe(x)
        return seen[:, :3], seen[:, 3:6]

    def energies(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Kinetic energy, and potential energy above the ground, shapes (n,) [J], along states (n, 16)."""
        seen = self._observe(x)
        return seen[:, 6], seen[:, 7]

    def _observe(self, x: np.ndarray) -> np.ndarray:
        return np.array([self._observation(state) for state in x])

    def _solve(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """u', the multipliers, and the sum of both contact forces, shape (3,) [N]."""
        mass, forcing, constraint, drift, momentum, convected = _cut(self._motion(x))
        matrix = np.zeros((SPEEDS + CONSTRAINTS, SPEEDS + CONSTRAINTS))
        matrix[:SPEEDS, :SPEEDS], matrix[:SPEEDS, SPEEDS:], matrix[SPEEDS:, :SPEEDS] = mass, -constraint.T, constraint
        found = np.linalg.solve(matrix, np.concatenate([forcing, -drift]))
        accelerations, multipliers = found[:SPEEDS], found[SPEEDS:]
        return accelerations, multipliers, momentum @ accelerations + convected


_SHAPES = ((SPEEDS, SPEEDS), (SPEEDS,), (CONSTRAINTS, SPEEDS), (CONSTRAINTS,), (3, SPEEDS), (3,))


def _cut(values: np.ndarray) -> list[np.ndarray]:
    """M, f, C, C' u, P_u, P_q u less the weight, from one row of numbers."""
    sizes = [int(np.prod(shape)) for shape in _SHAPES]
    parts = np.split(values, np.cumsum(sizes)[:-1])
    return [part.reshape(shape) for part, shape in zip(parts, _SHAPES, strict=True)]


def model() -> tuple[Any, System]:
    """Bicycle of rigid frames and knife-edge wheels that roll, and its system under gravity."""
    bike: Any = sb.WhippleBicycle.from_convention("moore", "bike")
    bike.ground = sb.FlatGround("ground")
    bike.rear_frame, bike.front_frame = sb.RigidRearFrame("rear_frame"), sb.RigidFrontFrame("front_frame")
    bike.rear_wheel, bike.front_wheel = sb.KnifeEdgeWheel("rear_wheel"), sb.KnifeEdgeWheel("front_wheel")
    bike.rear_tire, bike.front_tire = sb.NonHolonomicTire("rear_tire"), sb.NonHolonomicTire("front_tire")
    bike.define_all()
    system = bike.to_system()
    system.apply_uniform_gravity(-_GRAVITY * bike.ground.get_normal(bike.ground.origin))
    return bike, system


def constants(bike: Any, bicycle: Bicycle) -> dict[Symbol, float]:
    """Values of symbrim's symbols: lengths and inertia along (u, right, down the steering axis)."""
    along = np.array([np.cos(bicycle.steer_axis_tilt), 0, np.sin(bicycle.steer_axis_tilt)])
    down = -np.asarray(bicycle.steer_axis)
    rear, front = bicycle.centre("rear_wheel"), bicycle.centre("front_wheel")
    rear_frame, front_frame = bicycle.centre("rear_frame") - rear, bicycle.centre("front_frame") - front
    values = {
        bike.rear_wheel.symbols["r"]: bicycle.rear_wheel_radius,
        bike.front_wheel.symbols["r"]: bicycle.front_wheel_radius,
        bike.rear_frame.symbols["d1"]: along @ (bicycle.reference_point - rear),
        bike.front_frame.symbols["d2"]: down @ (front - rear),
        bike.front_frame.symbols["d3"]: along @ (front - bicycle.reference_point),
        bike.rear_frame.symbols["l1"]: along @ rear_frame,
        bike.rear_frame.symbols["l2"]: down @ rear_frame,
        bike.front_frame.symbols["l3"]: along @ front_frame,
        bike.front_frame.symbols["l4"]: down @ front_frame,
        _ALONG_STEERING_AXIS: down @ (bicycle.reference_point - rear),
        _GRAVITY: bicycle.gravity,
    }
    for name in BODIES:
        body = getattr(bike, name).body
        tensor, inertia = body.central_inertia.to_matrix(body.frame), bicycle.inertia(name)
        values[body.mass] = bicycle.body_mass(name)
        values[tensor[0, 0]], values[tensor[1, 1]] = along @ inertia @ along, inertia[1, 1]
        if name.endswith("frame"):
            values[tensor[0, 2]], values[tensor[2, 2]] = along @ inertia @ down, down @ inertia @ down
    return {symbol: float(value) for symbol, value in values.items()}


@lru_cache(maxsize=1)
def _compiled() -> tuple[Any, Callable[..., list[float]], Callable[..., list[float]]]:
    """Bicycle, equations of motion and what is seen of it, as functions of numbers; it takes some 7 s."""
    bike, system = model()
    arguments = [*bike.q, *bike.u, *constants(bike, Bicycle())]
    make = partial(lambdify, arguments, modules="math", cse=True)
    return bike, make(_motion(bike, system)), make(_observation(bike, system))


def _motion(bike: Any, system: System) -> list[Any]:
    """Entries of M, f, C, C' u, P_u, and P_q u less the weight."""
    rates = dict(zip(bike.q.diff(), bike.u, strict=True))
    kane = KanesMethod(system.frame, list(bike.q), list(bike.u), list(system.kdes))
    kane.kanes_equations(system.bodies, system.loads)
    # Of the front contact: its height's rate, its slip in x and y; then the rear one's slip.
    tyres = (bike.front_tire.system, bike.rear_tire.system)
    velocities = Matrix.vstack(*(tyre.velocity_constraints for tyre in tyres)).xreplace(rates)
    drift = velocities.jacobian(bike.q) * bike.u
    momentum = linear_momentum(system.frame, *_bodies(bike)).to_matrix(system.frame).xreplace(rates)
    weight = -_GRAVITY * sum(body.mass for body in _bodies(bike)) * bike.ground.get_normal(system.fixed_point)
    convected = momentum.jacobian(bike.q) * bike.u - weight.to_matrix(system.frame)
    constraint, slope = velocities.jacobian(bike.u), momentum.jacobian(bike.u)
    parts = (kane.mass_matrix, kane.forcing, constraint, drift, slope, convected)
    return _entries([Matrix(part).xreplace(rates) for part in parts])


def _observation(bike: Any, system: System) -> list[Any]:
    """Position and velocity of D in the ground's axes, kinetic and potential energy."""
    ground, origin = system.frame, system.fixed_point
    point = Point("D")
    point.set_pos(bike.rear_frame.steer_hub.point, _ALONG_STEERING_AXIS * bike.rear_frame.body.z)
    position = point.pos_from(origin).to_matrix(ground)
    up = bike.ground.get_normal(origin)
    potential = sum(body.mass * _GRAVITY * body.masscenter.pos_from(origin).dot(up) for body in _bodies(bike))
    energies = Matrix([kinetic_energy(ground, *_bodies(bike)), potential])
    return _entries([position, position.jacobian(bike.q) * bike.u, energies])


def _bodies(bike: Any) -> list[Any]:
    return [getattr(bike, name).body for name in BODIES]


def _entries(matrices: Sequence[Matrix]) -> list[Any]:
    return [entry for matrix in matrices for entry in matrix]
