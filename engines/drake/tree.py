"""The bicycle as a tree of Drake's rigid bodies, and the conversion of its states.

The root is the free rear frame. It carries the rear wheel and the front frame, which carries the front wheel. The
hinges are revolute joints without friction. The frames' bodies have their origin in D, the wheels' in their centres; at
rest the axes of every body are the inertial ones.
"""

# Drake is not among the suite's own dependencies.
# pyright: reportMissingImports=false

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.tree import FixedOffsetFrame, RevoluteJoint, SpatialInertia, UnitInertia

from ...reference.bicycle import BODIES, Bicycle
from ...reference.inputs import Inputs
from ...reference.kinematics import FRONT_ANGLE, REAR_ANGLE, STEER, angular_velocities, rotations
from ..engine import EngineError


@dataclass(frozen=True)
class DrakeTree:
    """The bicycle's bodies and hinges in a plant.

    Attributes
    ----------
    plant : MultibodyPlant
    bodies : tuple
        The four bodies, in the order of `BODIES`.
    hinges : dict
        Joints by index of the coordinate.
    centres : ndarray, shape (4, 3)
        Centres of mass in the bodies' own axes [m].
    """

    plant: Any
    bodies: tuple[Any, ...]
    hinges: dict[int, Any]
    centres: np.ndarray

    @property
    def wheels(self) -> tuple[Any, Any]:
        """The bodies of the rear and the front wheel."""
        return self.bodies[2], self.bodies[3]


def add_bicycle_tree(plant: Any, bicycle: Bicycle, steer_damping: float = 0.0) -> DrakeTree:
    """Add the bicycle to a plant that is not finalised.

    Parameters
    ----------
    plant : MultibodyPlant
    bicycle : Bicycle
    steer_damping : float
        Damping of the steering joint [N m s/rad].

    Raises
    ------
    EngineError
        If Drake refuses the inertia of a body.
    """
    d = bicycle.reference_point
    origins = {body: bicycle.centre(body) if body.endswith("wheel") else d for body in BODIES}
    bodies = {}
    for name in BODIES:
        try:
            inertia = _make_inertia(bicycle, name, bicycle.centre(name) - origins[name])
            bodies[name] = plant.AddRigidBody(name, inertia)
        except RuntimeError as error:
            raise EngineError(f"Drake refuses the {name}: {_first_line(error)}") from error

    def add_hinge(coordinate: str, parent: str, child: str, axis: np.ndarray, damping: float) -> Any:
        place = RigidTransform(origins[child] - origins[parent])
        frame = plant.AddFrame(FixedOffsetFrame(f"{coordinate}_hinge", bodies[parent].body_frame(), place))
        return plant.AddJoint(RevoluteJoint(coordinate, frame, bodies[child].body_frame(), axis, damping=damping))

    lateral = np.array([0.0, 1.0, 0.0])
    hinges = {
        REAR_ANGLE: add_hinge("rear_angle", "rear_frame", "rear_wheel", lateral, 0.0),
        STEER: add_hinge("steer", "rear_frame", "front_frame", bicycle.steer_axis, steer_damping),
        FRONT_ANGLE: add_hinge("front_angle", "front_frame", "front_wheel", lateral, 0.0),
    }
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -bicycle.gravity])
    centres = np.array([bicycle.centre(name) - origins[name] for name in BODIES])
    return DrakeTree(plant, tuple(bodies[name] for name in BODIES), hinges, centres)


def _make_inertia(bicycle: Bicycle, name: str, centre: np.ndarray) -> Any:
    """Return the inertia of a body about its origin; ``centre`` is the centre of mass there."""
    mass = bicycle.body_mass(name)
    if mass == 0:
        # Drake aborts the process where it is to divide moments of inertia by such a mass.
        return SpatialInertia.Zero()
    unit = bicycle.inertia(name) / mass + (centre @ centre) * np.eye(3) - np.outer(centre, centre)
    moments, products = unit[[0, 1, 2], [0, 1, 2]], unit[[0, 0, 1], [1, 2, 2]]
    # Measured moments may miss the triangle inequality by some percent, which Drake would refuse.
    return SpatialInertia(mass, centre, UnitInertia(*moments, *products), skip_validity_check=True)


def _first_line(error: Exception) -> str:
    return next(iter(str(error).strip().splitlines()), type(error).__name__)


def input_torques(tree: DrakeTree, inputs: Inputs) -> np.ndarray:
    """Return the generalised forces (nv,) of the steer torque and the rear wheel's torque."""
    forces = np.zeros(tree.plant.num_velocities())
    forces[tree.hinges[STEER].velocity_start()] = inputs.steer_torque
    forces[tree.hinges[REAR_ANGLE].velocity_start()] = inputs.rear_wheel_torque
    return forces


def set_plant_state(tree: DrakeTree, context: Any, bicycle: Bicycle, q: np.ndarray, qd: np.ndarray) -> None:
    """Set the state of a plant's context to the coordinates and rates (9,)."""
    frame = tree.bodies[0]
    pose = RigidTransform(RotationMatrix.ProjectToRotationMatrix(rotations(bicycle, q)[0]), q[:3])
    tree.plant.SetFreeBodyPose(context, frame, pose)
    twist = SpatialVelocity(angular_velocities(bicycle, q, qd)[0], qd[:3])
    set_velocity = tree.plant.SetFreeBodySpatialVelocity
    # Renamed; the docstring of the bindings holds the signatures with the names of their arguments.
    name = "V_JpJc" if "V_JpJc" in str(set_velocity.__doc__) else "V_PB"
    set_velocity(context=context, body=frame, **{name: twist})
    for index, joint in tree.hinges.items():
        joint.set_angle(context, q[index])
        joint.set_angular_rate(context, qd[index])


@dataclass(frozen=True)
class BodyMotions:
    """Poses and twists of bodies in inertial axes, in arrays that are filled anew; (k,) bodies, or (n, k) along a ride.

    Attributes
    ----------
    position, velocity : ndarray, shape (..., k, 3)
        Centres of mass and their velocities [m, m/s].
    rotation : ndarray, shape (..., k, 3, 3)
        Body to inertial axes.
    spin : ndarray, shape (..., k, 3)
        Angular velocities [rad/s].
    """

    position: np.ndarray
    velocity: np.ndarray
    rotation: np.ndarray
    spin: np.ndarray

    @classmethod
    def empty(cls, *shape: int) -> BodyMotions:
        """Return arrays for as many bodies, filled with zeros."""
        return cls(np.zeros((*shape, 3)), np.zeros((*shape, 3)), np.zeros((*shape, 3, 3)), np.zeros((*shape, 3)))

    @classmethod
    def stack(cls, parts: Sequence[BodyMotions]) -> BodyMotions:
        """Return the motions of k bodies at several times as one, (n, k)."""
        names = ("position", "velocity", "rotation", "spin")
        return cls(*(np.stack([getattr(part, name) for part in parts]) for name in names))

    def __getitem__(self, rows: int | slice) -> BodyMotions:
        """Return views of some rows."""
        return BodyMotions(self.position[rows], self.velocity[rows], self.rotation[rows], self.spin[rows])


def read_body_motions(tree: DrakeTree, context: Any, out: BodyMotions) -> None:
    """Read the motion of all four bodies from a plant's context."""
    _read_origins(tree.plant, context, tree.bodies, out)
    arms = np.einsum("kij,kj->ki", out.rotation, tree.centres)
    out.position[:] += arms
    out.velocity[:] += np.cross(out.spin, arms)


def read_wheel_motions(tree: DrakeTree, context: Any, out: BodyMotions) -> None:
    """Read the motion of both wheels, whose origins are their centres, from a plant's context."""
    _read_origins(tree.plant, context, tree.wheels, out)


def _read_origins(plant: Any, context: Any, bodies: Sequence[Any], out: BodyMotions) -> None:
    for k, body in enumerate(bodies):
        pose, twist = plant.EvalBodyPoseInWorld(context, body), plant.EvalBodySpatialVelocityInWorld(context, body)
        out.position[k], out.rotation[k] = pose.translation(), pose.rotation().matrix()
        out.velocity[k], out.spin[k] = twist.translational(), twist.rotational()
