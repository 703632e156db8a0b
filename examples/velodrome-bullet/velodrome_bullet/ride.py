"""A ride in Bullet: thin cylinders on a plane, and a contact problem in every step.

Bullet solves for the velocities at the end of a step that are free of slip, and moves the bodies with them. The contact
that is held is a point of the rim that the wheel turns on during the step: the wheels creep with the step.

A cylinder is rounded by a margin of 1 mm, so that a wheel that leans by L is 1 mm (1 - cos L) deep in the ground when
its knife edge touches it. The default ``contactERP`` of 0.2 would give it a velocity off the ground of a fifth of that
depth in a step; without it the depth stays.
"""

# PyBullet is an optional library, and its compiled bindings carry no types.
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import process_time

import numpy as np
import pybullet
from scipy.spatial.transform import Rotation

from velodrome.engines.coordinates import (
    angular_velocities,
    body_positions,
    body_velocities,
    coordinates_from_bodies,
    rotations,
)
from velodrome.engines.engine import EngineError, Problem, Progress
from velodrome.engines.problems import steps_per_output

from .settings import BulletSettings
from .tree import COLUMNS, HINGES, compose_rotations, describe_bicycle

HUGE = 1e10
BASE = -1


@dataclass(frozen=True)
class Recording:
    """The n samples of a ride.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Steps taken times the step [s]; Bullet keeps no clock.
    q, qd : ndarray, shape (n, 9)
        Coordinates and rates.
    position, rotation : ndarray, shapes (n, 4, 3), (n, 4, 3, 3)
        Centres of mass [m] and orientations of the bodies.
    force : ndarray, shape (n, 2, 3)
        Forces of the ground on the wheels in the step that begins at a sample [N].
    steps : int
    cpu_time : float
        Process CPU time of the steps [s].
    ended : str or None
        Why the ride ended early.
    """

    time: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    position: np.ndarray
    rotation: np.ndarray
    force: np.ndarray
    steps: int
    cpu_time: float
    ended: str | None


@dataclass(frozen=True)
class State:
    """Centre of mass and velocity of the rear frame, poses and spins of the bodies, angles and rates of the hinges."""

    centre: np.ndarray
    velocity: np.ndarray
    rotation: np.ndarray
    spin: np.ndarray
    angles: np.ndarray
    rates: np.ndarray


class Rig:
    """A bicycle in a world of Bullet's, at its start.

    Parameters
    ----------
    problem : Problem
    settings : BulletSettings
    client : int
        Number of PyBullet's connection.
    """

    def __init__(self, problem: Problem, settings: BulletSettings, client: int) -> None:
        self.steps, self._client, self._problem = 0, client, problem
        bicycle = problem.bicycle
        pybullet.setGravity(0, 0, -bicycle.gravity, physicsClientId=client)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=settings.step,
            numSubSteps=0,
            numSolverIterations=settings.iterations,
            solverResidualThreshold=settings.residual,
            contactERP=settings.contact_erp,
            enableConeFriction=1,
            deterministicOverlappingPairs=1,
            physicsClientId=client,
        )
        plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
        self._ground = pybullet.createMultiBody(0, plane, physicsClientId=client)
        pybullet.changeDynamics(
            self._ground, BASE, lateralFriction=settings.friction, restitution=0, physicsClientId=client
        )
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "bicycle.urdf"
            path.write_text(describe_bicycle(bicycle, settings.half_thickness), encoding="utf-8")
            flags = pybullet.URDF_USE_INERTIA_FROM_FILE | pybullet.URDF_USE_IMPLICIT_CYLINDER
            self._bicycle = pybullet.loadURDF(str(path), flags=flags, physicsClientId=client)
        self._hinges = self._number_hinges()
        self._wheels = (self._hinges[0], self._hinges[2])
        for link in (BASE, *self._hinges):
            pybullet.changeDynamics(
                self._bicycle,
                link,
                lateralFriction=1.0,
                linearDamping=0,  # the default of 0.04 1/s acts on all bodies
                angularDamping=0,
                jointDamping=0,
                restitution=0,
                maxJointVelocity=1e6,
                physicsClientId=client,
            )
        for hinge in self._hinges:  # a joint begins with a motor that brakes it
            pybullet.setJointMotorControl2(
                self._bicycle, hinge, pybullet.VELOCITY_CONTROL, force=0, physicsClientId=client
            )
        described = pybullet.getDynamicsInfo(self._bicycle, BASE, physicsClientId=client)
        self._principal = Rotation.from_quat(described[4])
        self.set_state(problem.q, problem.qd)

    def set_state(self, q: np.ndarray, qd: np.ndarray) -> None:
        """Set coordinates and rates, both of shape (9,)."""
        bicycle, where = self._problem.bicycle, {"physicsClientId": self._client}
        turned = Rotation.from_matrix(rotations(bicycle, q)[0]) * self._principal
        pybullet.resetBasePositionAndOrientation(
            self._bicycle, body_positions(bicycle, q)[0], turned.as_quat(), **where
        )
        pybullet.resetBaseVelocity(
            self._bicycle, body_velocities(bicycle, q, qd)[0], angular_velocities(bicycle, q, qd)[0], **where
        )
        for hinge, column in zip(self._hinges, COLUMNS, strict=True):
            pybullet.resetJointState(self._bicycle, hinge, q[column], qd[column], **where)

    def advance(self) -> None:
        """Take a step."""
        inputs = self._problem.inputs
        if inputs.steer_torque or inputs.steer_damping or inputs.rear_wheel_torque:
            rate = pybullet.getJointState(self._bicycle, self._hinges[1], physicsClientId=self._client)[1]
            torques = (inputs.rear_wheel_torque, inputs.steer_torque - inputs.steer_damping * rate)
            for hinge, torque in zip(self._hinges[:2], torques, strict=True):
                pybullet.setJointMotorControl2(
                    self._bicycle, hinge, pybullet.TORQUE_CONTROL, force=torque, physicsClientId=self._client
                )
        pybullet.stepSimulation(physicsClientId=self._client)
        self.steps += 1

    def read_state(self) -> State:
        """Return the present state."""
        where = {"physicsClientId": self._client}
        centre, turned = pybullet.getBasePositionAndOrientation(self._bicycle, **where)
        velocity, spin = pybullet.getBaseVelocity(self._bicycle, **where)
        joints = [pybullet.getJointState(self._bicycle, hinge, **where)[:2] for hinge in self._hinges]
        angles, rates = np.array(joints).T
        rear = (Rotation.from_quat(turned) * self._principal.inv()).as_matrix()
        rotation, spins = compose_rotations(self._problem.bicycle, rear, np.array(spin), angles, rates)
        return State(np.array(centre), np.array(velocity), rotation, spins, angles, rates)

    def read_forces(self) -> np.ndarray:
        """Return the forces on the wheels in the last step, shape (2, 3) [N]."""
        force = np.zeros((2, 3))
        for k, link in enumerate(self._wheels):
            for contact in pybullet.getContactPoints(
                self._bicycle, self._ground, link, BASE, physicsClientId=self._client
            ):
                normal, along, first, across, second = contact[9], contact[10], contact[11], contact[12], contact[13]
                force[k] += normal * np.array(contact[7]) + along * np.array(first) + across * np.array(second)
        return force

    def _number_hinges(self) -> tuple[int, ...]:
        """Return the numbers of the hinges, which are those of the links that they carry, in the order of `HINGES`."""
        count = pybullet.getNumJoints(self._bicycle, physicsClientId=self._client)
        described = (pybullet.getJointInfo(self._bicycle, i, physicsClientId=self._client) for i in range(count))
        numbers = {entry[1].decode(): entry[0] for entry in described}
        return tuple(numbers[name] for name in HINGES)


@contextmanager
def open_world() -> Iterator[int]:
    """Connect to an empty world of Bullet's in this process; yield the connection's number.

    Raises
    ------
    EngineError
        If PyBullet has no connection left.
    """
    client = pybullet.connect(pybullet.DIRECT)
    if client < 0:
        raise EngineError("PyBullet has no connection left in this process")
    try:
        yield client
    finally:
        pybullet.disconnect(client)


def ride_bicycle(problem: Problem, settings: BulletSettings, progress: Progress) -> Recording:
    """Ride a problem.

    Raises
    ------
    EngineError
        If PyBullet has no connection left.
    """
    stride, n = steps_per_output(problem.times, settings.step), len(problem.times)
    states: list[State] = []
    force, steps, cpu_time, ended = np.empty((n, 2, 3)), 0, 0.0, None
    with open_world() as client:
        rig = Rig(problem, settings, client)
        for k in range(n):
            state = rig.read_state()
            if not max(np.abs(value).max() for value in vars(state).values()) < HUGE:
                ended = f"Bullet's state became infinite or huge before {problem.times[k]:.6g} s"
                break
            states.append(state)
            steps = rig.steps
            progress(steps * settings.step)
            # The forces of a sample are those of the step that begins there, also of the last one.
            begin = process_time()
            rig.advance()
            force[k] = rig.read_forces()
            if k < n - 1:
                for _ in range(stride - 1):
                    rig.advance()
            cpu_time += process_time() - begin
    time = settings.step * stride * np.arange(len(states))
    centre, velocity, rotation, spin, angles, rates = (
        np.array([getattr(state, name) for state in states]) for name in State.__dataclass_fields__
    )
    q, qd = coordinates_from_bodies(problem.bicycle, time, centre, velocity, rotation, spin)
    q[:, COLUMNS], qd[:, COLUMNS] = angles, rates
    position = body_positions(problem.bicycle, q)
    return Recording(time, q, qd, position, rotation, force[: len(time)], steps, cpu_time, ended)
