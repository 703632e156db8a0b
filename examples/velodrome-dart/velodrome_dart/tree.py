"""The bicycle as a tree of bodies in DART, and its state.

The rear frame's node has its origin in D and is on a free joint; it carries the rear wheel and the front frame, which
carries the front wheel. Degrees of freedom are those of the free joint (6), rear_angle, steer and front_angle.
"""

# DART is an optional library, and its compiled bindings carry no types.
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import dartpy as dart
import numpy as np

from velodrome.engines.coordinates import BODIES, COORDINATES, angular_velocities, rotations
from velodrome.reference.bicycle import Bicycle

HINGES = [COORDINATES.index(name) for name in ("rear_angle", "steer", "front_angle")]
REAR_RATE, STEER_RATE = 6, 7  # among the degrees of freedom


@dataclass(frozen=True)
class Tree:
    """The bicycle's skeleton, and its bodies in the order of `BODIES`."""

    skeleton: Any
    bodies: tuple[Any, ...]

    def set_state(self, bicycle: Bicycle, q: np.ndarray, qd: np.ndarray) -> None:
        """Set coordinates and rates, both of shape (9,)."""
        turned, spin = rotations(bicycle, q)[0], angular_velocities(bicycle, q, qd)[0]
        place = shift_frame(q[:3])
        place.set_rotation(turned)
        joint = self.skeleton.getJoint(0)
        self.skeleton.setPositions(np.concatenate([joint.convertToPositions(place), q[HINGES]]))
        # The joint's own speeds are derivatives of a rotation vector; its Jacobian makes them the body's twist.
        twist = np.concatenate([turned.T @ spin, turned.T @ qd[:3]])
        speeds = np.linalg.solve(np.array(joint.getRelativeJacobian()), twist)
        self.skeleton.setVelocities(np.concatenate([speeds, qd[HINGES]]))

    def read_rotations(self) -> np.ndarray:
        """Return the orientations of the bodies, shape (4, 3, 3)."""
        return np.array([body.getWorldTransform().rotation() for body in self.bodies])


def shift_frame(offset: np.ndarray) -> Any:
    """Return a frame that is shifted by a vector (3,) and not turned."""
    place = dart.math.Isometry3()
    place.set_translation(np.asarray(offset, float))
    return place


def build_tree(bicycle: Bicycle) -> Tree:
    """Return the bicycle in DART, without shapes."""
    skeleton = dart.dynamics.Skeleton("bicycle")
    origin = {name: bicycle.reference_point if "frame" in name else bicycle.centre(name) for name in BODIES}

    def hang(parent: Any, name: str, offset: np.ndarray, axis: np.ndarray) -> Any:
        joint = dart.dynamics.RevoluteJointProperties()
        joint.mAxis, joint.mT_ParentBodyToJoint = np.asarray(axis, float), shift_frame(offset)
        return skeleton.createRevoluteJointAndBodyNodePair(parent, joint)[1]

    axle, still = np.array([0.0, 1.0, 0.0]), np.zeros(3)
    rear = skeleton.createFreeJointAndBodyNodePair(None)[1]
    rear_wheel = hang(rear, "rear_wheel", origin["rear_wheel"] - origin["rear_frame"], axle)
    front = hang(rear, "front_frame", still, bicycle.steer_axis)
    front_wheel = hang(front, "front_wheel", origin["front_wheel"] - origin["front_frame"], axle)
    bodies = dict(zip(BODIES, (rear, front, rear_wheel, front_wheel), strict=True))
    for name, body in bodies.items():
        inertia = dart.dynamics.Inertia()
        inertia.setMass(bicycle.body_mass(name))
        inertia.setLocalCOM(bicycle.centre(name) - origin[name])
        inertia.setMoment(bicycle.inertia(name))
        body.setInertia(inertia)
        body.setName(name)
    return Tree(skeleton, tuple(bodies.values()))
