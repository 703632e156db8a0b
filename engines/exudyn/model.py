"""The bicycle as a multibody system in Exudyn: four rigid bodies, three revolute joints, two wheels on the ground."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import exudyn as exu
import numpy as np
from exudyn.itemInterface import SensorBody
from exudyn.rigidBodyUtilities import RigidBodyInertia

from ...reference.bicycle import BODIES, Bicycle
from ...reference.kinematics import angular_velocities, body_positions, body_velocities, rotations
from ..engine import Problem
from .library import connect
from .settings import SolverSettings
from .wheels import LEFT_AXIS, MASS_UNIT, PutOnGround, WheelRolling


@dataclass(frozen=True)
class Model:
    """An assembled system, ready to be solved.

    Attributes
    ----------
    container : exudyn.SystemContainer
        Owner of the system, which must live as long as the system.
    system : exudyn.MainSystem
    rolling : WheelRolling
        Both wheels on the ground.
    sensors : tuple of dict
        For each body, in the order of `BODIES`, sensor numbers of position, velocity, rotation and spin.
    nodes : tuple
        Nodes of the bodies, in the order of `BODIES`.
    """

    container: exu.SystemContainer
    system: exu.MainSystem
    rolling: WheelRolling
    sensors: tuple[dict[str, Any], ...]
    nodes: tuple[Any, ...]


def build_model(problem: Problem, settings: SolverSettings, put_on_ground: PutOnGround) -> Model:
    """Build and assemble the bicycle in its initial state."""
    container = exu.SystemContainer()
    system = container.AddSystem()
    bodies = _add_bodies(system, problem)
    numbers = [body["bodyNumber"] for body in bodies]
    _connect_bodies(system, problem.bicycle, problem.q, numbers)
    _apply_inputs(system, problem, numbers)
    rolling = put_on_ground(system, bodies[2:], problem, settings)
    sensors = tuple(_add_sensors(system, body["bodyNumber"]) for body in bodies)
    system.Assemble()
    return Model(container, system, rolling, sensors, tuple(body["nodeNumber"] for body in bodies))


def _add_bodies(system: exu.MainSystem, problem: Problem) -> list[dict[str, Any]]:
    bicycle, q, qd = problem.bicycle, problem.q[None], problem.qd[None]
    position, rotation = body_positions(bicycle, q)[0], rotations(bicycle, q)[0]
    velocity, spin = body_velocities(bicycle, q, qd)[0], angular_velocities(bicycle, q, qd)[0]
    bodies = []
    for i, body in enumerate(BODIES):
        mass: Any = bicycle.body_mass(body) / MASS_UNIT
        inertia = RigidBodyInertia(mass=mass, inertiaTensor=bicycle.inertia(body) / MASS_UNIT)
        bodies.append(
            system.CreateRigidBody(
                name=body,
                inertia=inertia,
                referencePosition=position[i],
                referenceRotationMatrix=rotation[i],
                initialVelocity=velocity[i],
                initialAngularVelocity=spin[i],
                gravity=[0.0, 0.0, -bicycle.gravity],
                nodeType=exu.NodeType.RotationEulerParameters,
                show=False,
                returnDict=True,
            )
        )
    return bodies


def _connect_bodies(system: exu.MainSystem, bicycle: Bicycle, q: np.ndarray, bodies: list[Any]) -> None:
    """Connect the wheels to their frames and the front frame to the rear one by hinges, along the axes at the start."""
    rear_frame, front_frame, rear_wheel, front_wheel = bodies
    rotation, position = rotations(bicycle, q[None])[0], body_positions(bicycle, q[None])[0]
    for pair, point, axis in (
        ([rear_wheel, rear_frame], position[2], rotation[0] @ LEFT_AXIS),
        ([front_wheel, front_frame], position[3], rotation[1] @ LEFT_AXIS),
        ([rear_frame, front_frame], q[:3], rotation[0] @ bicycle.steer_axis),
    ):
        connect(system.CreateRevoluteJoint, pair, position=point, axis=axis, show=False)


def _apply_inputs(system: exu.MainSystem, problem: Problem, bodies: list[Any]) -> None:
    """Add the torques and the steer damping that are not zero, about the hinges' axes at the start."""
    rear_frame, front_frame, rear_wheel, _ = bodies
    bicycle, q, inputs = problem.bicycle, problem.q, problem.inputs
    rotation, position = rotations(bicycle, q[None])[0], body_positions(bicycle, q[None])[0]
    for pair, point, axis, torque, damping in (
        (
            [rear_frame, front_frame],
            q[:3],
            rotation[0] @ bicycle.steer_axis,
            inputs.steer_torque,
            inputs.steer_damping,
        ),
        ([rear_frame, rear_wheel], position[2], rotation[0] @ LEFT_AXIS, inputs.rear_wheel_torque, 0.0),
    ):
        if torque == damping == 0:
            continue
        connect(
            system.CreateTorsionalSpringDamper,
            pair,
            position=point,
            axis=axis,
            damping=damping / MASS_UNIT,
            # Like the spring's, the connector's torque resists the rotation of the second body.
            torque=-torque / MASS_UNIT,
            unlimitedRotations=False,  # without stiffness the angle itself does not matter
            show=False,
        )


def _add_sensors(system: exu.MainSystem, body: Any) -> dict[str, Any]:
    """Add sensors of a body's motion, stored in memory."""
    kinds: dict[str, Any] = {
        "position": exu.OutputVariableType.Position,
        "velocity": exu.OutputVariableType.Velocity,
        "rotation": exu.OutputVariableType.RotationMatrix,
        "spin": exu.OutputVariableType.AngularVelocity,
    }
    return {
        name: system.AddSensor(
            SensorBody(bodyNumber=body, outputVariableType=kind, storeInternal=True, writeToFile=False)
        )
        for name, kind in kinds.items()
    }


@dataclass(frozen=True)
class BodyMotion:
    """Motion of the four bodies as computed by the engine, in inertial axes.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Sampling times from the engine's own clock [s].
    position, velocity, spin : ndarray, shape (n, 4, 3)
        Positions and velocities of the centres of mass [m, m/s], and angular velocities [rad/s].
    rotation : ndarray, shape (n, 4, 3, 3)
        Body to inertial axes.
    """

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    rotation: np.ndarray
    spin: np.ndarray


_SIZES = {"position": 3, "velocity": 3, "rotation": 9, "spin": 3}  # numbers of values of a body's sensors


def stored_samples(model: Model, sensor: Any) -> np.ndarray:
    """Return the samples of a sensor after a run, shape (n, 1 + k): time and values."""
    return np.atleast_2d(model.system.GetSensorStoredData(sensor))


def read_motion(model: Model) -> BodyMotion:
    """Collect the samples of the bodies' sensors after a run."""
    time = stored_samples(model, model.sensors[0]["position"])[:, 0].copy()
    values = {name: np.empty((len(time), 4, size)) for name, size in _SIZES.items()}
    for body, sensors in enumerate(model.sensors):
        for name, out in values.items():  # one sensor's copy at a time, since a long ride has many samples
            out[:, body] = stored_samples(model, sensors[name])[:, 1:]
    rotation = values["rotation"].reshape(len(time), 4, 3, 3)
    return BodyMotion(time, values["position"], values["velocity"], rotation, values["spin"])
