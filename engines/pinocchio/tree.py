"""The bicycle as a tree of bodies in Pinocchio, and the maps between its configuration and the suite's coordinates.

    configuration (10,) = (D (3), quaternion x, y, z, w of the rear frame (4), rear_angle, steer, front_angle)
    velocity (9,)       = (velocity of D and angular velocity in the rear frame's axes (3, 3), rates of the hinges)

The rear frame is on a free-flyer joint whose origin is D; it carries the rear wheel and the front frame, which carries
the front wheel. At rest the axes of every joint are the inertial ones.
"""

# pinocchio is an optional library whose compiled bindings carry no types.
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from ...reference.bicycle import BODIES, Bicycle
from ...reference.kinematics import (
    FRONT_ANGLE,
    REAR_ANGLE,
    STEER,
    angular_velocities,
    body_quaternions,
    coordinates_from_bodies,
    rotations,
)

HINGES = [REAR_ANGLE, STEER, FRONT_ANGLE]  # coordinates of the hinges in Pinocchio's order
STEER_RATE, REAR_RATE = 6 + HINGES.index(STEER), 6 + HINGES.index(REAR_ANGLE)  # in the velocity
# Joints that carry the bodies, in the order of BODIES; joint 0 is the world.
JOINTS = (1, 3, 2, 4)


def build_pinocchio_model(bicycle: Bicycle) -> Any:
    """Return the bicycle as a `pinocchio.Model` whose joints are numbered as in `JOINTS`."""
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -bicycle.gravity])
    origin = {name: bicycle.reference_point if "frame" in name else bicycle.centre(name) for name in BODIES}

    def add(parent: int, joint: Any, name: str, offset: np.ndarray) -> int:
        place = pin.SE3(np.eye(3), offset)
        number = model.addJoint(parent, joint, place, name)
        inertia = pin.Inertia(bicycle.body_mass(name), bicycle.centre(name) - origin[name], bicycle.inertia(name))
        model.appendBodyToJoint(number, inertia, pin.SE3.Identity())
        return number

    still = np.zeros(3)
    rear = add(0, pin.JointModelFreeFlyer(), "rear_frame", still)
    add(rear, pin.JointModelRY(), "rear_wheel", origin["rear_wheel"] - origin["rear_frame"])
    front = add(rear, pin.JointModelRevoluteUnaligned(bicycle.steer_axis), "front_frame", still)
    add(front, pin.JointModelRY(), "front_wheel", origin["front_wheel"] - origin["front_frame"])
    return model


def to_pinocchio(bicycle: Bicycle, q: np.ndarray, qd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Convert coordinates and rates, both of shape (9,), to Pinocchio's configuration (10,) and velocity (9,)."""
    turned = rotations(bicycle, q)[0]
    quaternion = body_quaternions(bicycle, q)[0, [1, 2, 3, 0]]
    spin = angular_velocities(bicycle, q, qd)[0]
    configuration = np.concatenate([q[:3], quaternion, q[HINGES]])
    return configuration, np.concatenate([turned.T @ qd[:3], turned.T @ spin, qd[HINGES]])


def from_pinocchio(
    bicycle: Bicycle,
    times: np.ndarray,
    configuration: np.ndarray,
    velocity: np.ndarray,
    centre: np.ndarray,
    rotation: np.ndarray,
    spin: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Convert a trajectory of Pinocchio's to coordinates and rates.

    Parameters
    ----------
    bicycle : Bicycle
    times : ndarray, shape (n,)
        [s]
    configuration, velocity : ndarray, shapes (n, 10), (n, 9)
    centre : ndarray, shape (n, 3)
        Centre of mass of the rear frame [m].
    rotation, spin : ndarray, shapes (n, 4, 3, 3), (n, 4, 3)
        Orientations of the four bodies, and their angular velocities in inertial axes [rad/s].

    Returns
    -------
    q, qd : ndarray, shape (n, 9)
        Yaw, lean and pitch are continuous from (-pi, pi] at the start; the other angles are Pinocchio's own.
    """
    linear = np.einsum("nij,nj->ni", rotation[:, 0], velocity[:, :3])
    arm = centre - configuration[:, :3]
    q, qd = coordinates_from_bodies(bicycle, times, centre, linear + np.cross(spin[:, 0], arm), rotation, spin)
    q[:, HINGES], qd[:, HINGES] = configuration[:, 7:], velocity[:, 6:]
    q[:, :3], qd[:, :3] = configuration[:, :3], linear
    return q, qd
