"""The bicycle as a tree of bodies in the Pinocchio that Jiminy brings along, and its states there.

configuration (10,) = (D (3), quaternion x, y, z, w of the rear frame (4), rear_angle, steer, front_angle)
velocity (9,)       = (velocity of D and angular velocity in the rear frame's axes (3, 3), rates of the hinges)
"""

# Jiminy is an optional library, and its compiled bindings carry no types.
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jiminy_py.core import pinocchio as pin

from velodrome.engines.coordinates import (
    BODIES,
    COORDINATES,
    angular_velocities,
    body_quaternions,
    coordinates_from_bodies,
    rotations,
)
from velodrome.reference.bicycle import Bicycle

HINGES = [COORDINATES.index(name) for name in ("rear_angle", "steer", "front_angle")]
REAR_RATE, STEER_RATE = 6, 7  # in the velocity
# Joints that carry the bodies, in the order of BODIES; joint 0 is the world.
JOINTS = (1, 3, 2, 4)


def build_model(bicycle: Bicycle) -> Any:
    """Return the bicycle as a Pinocchio model; each body's frame has the name of the body."""
    model = pin.Model()
    origin = {name: bicycle.reference_point if "frame" in name else bicycle.centre(name) for name in BODIES}

    def add(parent: int, joint: Any, name: str, offset: np.ndarray) -> int:
        # Jiminy knows a free joint by this name.
        label = "root_joint" if parent == 0 else name
        number = model.addJoint(parent, joint, pin.SE3(np.eye(3), offset), label)
        inertia = pin.Inertia(bicycle.body_mass(name), bicycle.centre(name) - origin[name], bicycle.inertia(name))
        model.appendBodyToJoint(number, inertia, pin.SE3.Identity())
        model.addBodyFrame(name, number, pin.SE3.Identity(), -1)
        return number

    still = np.zeros(3)
    rear = add(0, pin.JointModelFreeFlyer(), "rear_frame", still)
    add(rear, pin.JointModelRY(), "rear_wheel", origin["rear_wheel"] - origin["rear_frame"])
    front = add(rear, pin.JointModelRevoluteUnaligned(*bicycle.steer_axis), "front_frame", still)
    add(front, pin.JointModelRY(), "front_wheel", origin["front_wheel"] - origin["front_frame"])
    model.gravity.linear = np.array([0.0, 0.0, -bicycle.gravity])
    # Jiminy would stop a joint at its limit.
    model.lowerPositionLimit, model.upperPositionLimit = np.full(model.nq, -np.inf), np.full(model.nq, np.inf)
    return model


def to_jiminy(bicycle: Bicycle, q: np.ndarray, qd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Convert coordinates and rates, both of shape (9,), to a configuration (10,) and a velocity (9,)."""
    turned = rotations(bicycle, q)[0]
    quaternion = body_quaternions(bicycle, q)[0, [1, 2, 3, 0]]
    spin = angular_velocities(bicycle, q, qd)[0]
    configuration = np.concatenate([q[:3], quaternion, q[HINGES]])
    return configuration, np.concatenate([turned.T @ qd[:3], turned.T @ spin, qd[HINGES]])


@dataclass(frozen=True)
class Motion:
    """What follows from the states of a ride, n samples.

    Attributes
    ----------
    q, qd : ndarray, shape (n, 9)
        Coordinates and rates.
    position, rotation : ndarray, shapes (n, 4, 3), (n, 4, 3, 3)
        Centres of mass [m] and orientations of the bodies.
    energy : ndarray, shape (n, 2)
        Kinetic and potential energy [J].
    """

    q: np.ndarray
    qd: np.ndarray
    position: np.ndarray
    rotation: np.ndarray
    energy: np.ndarray


def from_jiminy(bicycle: Bicycle, time: np.ndarray, configuration: np.ndarray, velocity: np.ndarray) -> Motion:
    """Compute coordinates, poses and energies from configurations (n, 10) and velocities (n, 9) at n times [s]."""
    model = build_model(bicycle)
    data = model.createData()
    n = len(time)
    position, rotation, energy = np.empty((n, 4, 3)), np.empty((n, 4, 3, 3)), np.empty((n, 2))
    linear, spin = np.empty((n, 3)), np.empty((n, 4, 3))
    for k, state in enumerate(zip(configuration, velocity, strict=True)):
        energy[k] = pin.computeKineticEnergy(model, data, *state), pin.computePotentialEnergy(model, data, state[0])
        for body, joint in enumerate(JOINTS):
            place = data.oMi[joint]
            moving = pin.getVelocity(model, data, joint, pin.LOCAL_WORLD_ALIGNED)
            position[k, body] = place.act(model.inertias[joint].lever)
            rotation[k, body], spin[k, body] = place.rotation, moving.angular
            if joint == JOINTS[0]:
                linear[k] = moving.linear
    centre = position[:, 0]
    carried = linear + np.cross(spin[:, 0], centre - configuration[:, :3])
    q, qd = coordinates_from_bodies(bicycle, time, centre, carried, rotation, spin)
    # D and the hinges are coordinates of Jiminy too, without round-off.
    q[:, :3], qd[:, :3] = configuration[:, :3], linear
    q[:, HINGES], qd[:, HINGES] = configuration[:, 7:], velocity[:, 6:]
    return Motion(q, qd, position, rotation, energy)
