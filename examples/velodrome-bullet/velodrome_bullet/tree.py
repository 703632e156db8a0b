"""The bicycle as a robot description, as Bullet reads it, and poses of its bodies from the state in Bullet.

The rear frame is the base; it carries the rear wheel and the front frame, which carries the front wheel. Bullet keeps
principal moments of inertia alone, in axes of the body's own.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from scipy.spatial.transform import Rotation

from velodrome.engines.coordinates import BODIES, COORDINATES
from velodrome.reference.bicycle import Bicycle

HINGES = ("rear_angle", "steer", "front_angle")
COLUMNS = [COORDINATES.index(name) for name in HINGES]
AXLE = np.array([0.0, 1.0, 0.0])


def describe_bicycle(bicycle: Bicycle, half_thickness: float) -> str:
    """Return the bicycle in the Unified Robot Description Format, with wheels that are cylinders."""
    origin = {name: bicycle.reference_point if "frame" in name else bicycle.centre(name) for name in BODIES}
    parts = [_describe_body(bicycle, name, bicycle.centre(name) - origin[name], half_thickness) for name in BODIES]
    for hinge, parent, child, axis in (
        ("rear_angle", "rear_frame", "rear_wheel", AXLE),
        ("steer", "rear_frame", "front_frame", np.asarray(bicycle.steer_axis)),
        ("front_angle", "front_frame", "front_wheel", AXLE),
    ):
        parts.append(
            f'<joint name="{hinge}" type="continuous"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="{_join(origin[child] - origin[parent])}"/><axis xyz="{_join(axis)}"/></joint>'
        )
    return f'<?xml version="1.0"?><robot name="bicycle">{"".join(parts)}</robot>'


def compose_rotations(
    bicycle: Bicycle, rear: np.ndarray, spin: np.ndarray, angles: np.ndarray, rates: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return orientations (4, 3, 3) and angular velocities (4, 3) of the bodies.

    Parameters
    ----------
    bicycle : Bicycle
    rear : ndarray, shape (3, 3)
        Orientation of the rear frame.
    spin : ndarray, shape (3,)
        Its angular velocity [rad/s].
    angles, rates : ndarray, shape (3,)
        Of the hinges, in the order of `HINGES`.
    """
    front, steering = _turn(rear, spin, np.asarray(bicycle.steer_axis), angles[1], rates[1])
    rear_wheel, rear_spin = _turn(rear, spin, AXLE, angles[0], rates[0])
    front_wheel, front_spin = _turn(front, steering, AXLE, angles[2], rates[2])
    return np.array([rear, front, rear_wheel, front_wheel]), np.array([spin, steering, rear_spin, front_spin])


def _turn(
    parent: np.ndarray, spin: np.ndarray, axis: np.ndarray, angle: float, rate: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return orientation and angular velocity of a body on a hinge."""
    return parent @ Rotation.from_rotvec(angle * axis).as_matrix(), spin + rate * (parent @ axis)


def _describe_body(bicycle: Bicycle, name: str, centre: np.ndarray, half_thickness: float) -> str:
    moments, axes = np.linalg.eigh(bicycle.inertia(name))
    shape = ""
    if name.endswith("wheel"):
        moments, axes = np.diag(bicycle.inertia(name)), np.eye(3)
        radius = float(getattr(bicycle, f"{name}_radius"))
        shape = (
            f'<collision><origin rpy="{np.pi / 2!r} 0 0"/><geometry>'
            f'<cylinder radius="{radius!r}" length="{2 * half_thickness!r}"/></geometry></collision>'
        )
    axes = axes * [np.sign(np.linalg.det(axes)), 1, 1]
    xx, yy, zz = (repr(float(moment)) for moment in moments)
    return (
        f'<link name="{name}"><inertial>'
        f'<origin xyz="{_join(centre)}" rpy="{_join(Rotation.from_matrix(axes).as_euler("xyz"))}"/>'
        f'<mass value="{float(bicycle.body_mass(name))!r}"/>'
        f'<inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="0" ixz="0" iyz="0"/></inertial>{shape}</link>'
    )


def _join(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)
