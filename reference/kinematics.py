"""Generalised coordinates and the poses and velocities of the four bodies."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, wraps
from typing import TypeVar, cast

import numpy as np

from .bicycle import BODIES, Bicycle
from .inputs import NO_INPUTS, Inputs
from .kernels import bodies
from .kernels import kinematics as kernel

COORDINATES = ("x", "y", "z", "yaw", "lean", "pitch", "steer", "rear_angle", "front_angle")
YAW, LEAN, PITCH, STEER, REAR_ANGLE, FRONT_ANGLE = range(3, 9)
WHEELS = ("rear", "front")


@lru_cache(maxsize=64)
def constants(bicycle: Bicycle, inputs: Inputs = NO_INPUTS) -> kernel.Constants:
    """Combine the bodies into a rear and a front assembly about D; return the kernels' constants with the inputs."""
    origin = bicycle.reference_point

    def assembly(frame: str, wheel: str) -> tuple[float, np.ndarray, np.ndarray]:
        mass, first, second = 0.0, np.zeros(3), np.zeros((3, 3))
        for body in (frame, wheel):
            m, r = bicycle.body_mass(body), bicycle.centre(body) - origin
            mass, first = mass + m, first + m * r
            second = second + bicycle.inertia(body) + m * ((r @ r) * np.eye(3) - np.outer(r, r))
        return mass, first, second

    m1, s1, i1 = assembly("rear_frame", "rear_wheel")
    m2, s2, i2 = assembly("front_frame", "front_wheel")
    rear, front = bicycle.centre("rear_wheel") - origin, bicycle.centre("front_wheel") - origin
    parameters = {
        "gravity": bicycle.gravity,
        "m1": m1,
        "s1x": s1[0],
        "s1z": s1[2],
        "i1xx": i1[0, 0],
        "i1yy": i1[1, 1],
        "i1zz": i1[2, 2],
        "i1xz": i1[0, 2],
        "m2": m2,
        "s2x": s2[0],
        "s2z": s2[2],
        "i2xx": i2[0, 0],
        "i2yy": i2[1, 1],
        "i2zz": i2[2, 2],
        "i2xz": i2[0, 2],
        "spin_rear": bicycle.rear_wheel_Iyy,
        "spin_front": bicycle.front_wheel_Iyy,
        "rear_x": rear[0],
        "rear_z": rear[2],
        "front_x": front[0],
        "front_z": front[2],
        "rear_radius": bicycle.rear_wheel_radius,
        "front_radius": bicycle.front_wheel_radius,
        "sin_tilt": np.sin(bicycle.steer_axis_tilt),
        "cos_tilt": np.cos(bicycle.steer_axis_tilt),
        "steer_torque": inputs.steer_torque,
        "rear_wheel_torque": inputs.rear_wheel_torque,
        "steer_damping": inputs.steer_damping,
    }
    return kernel.Constants(**{name: float(value) for name, value in parameters.items()})


def _axis_angle(axis: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Rotation matrices (n, 3, 3) about a fixed unit axis."""
    k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    sine, cosine = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.eye(3) + sine * k + (1 - cosine) * (k @ k)


_Map = TypeVar("_Map", bound=Callable[..., np.ndarray])


def _of_one_or_many(map_states: _Map) -> _Map:
    """Let a map of states of shape (n, 9) take a single state of shape (9,) too; its result has no first axis then."""

    @wraps(map_states)
    def mapped(bicycle: Bicycle, q: np.ndarray, *qd: np.ndarray, **named: np.ndarray) -> np.ndarray:
        states = [np.asarray(state) for state in (q, *qd, *named.values())]
        for name, state in zip(("q", "qd"), states, strict=False):
            if state.ndim not in (1, 2) or state.shape[-1] != len(COORDINATES):
                raise ValueError(f"{name} has shape {state.shape}; it must be (9,) or (n, 9)")
            if state.shape != states[0].shape:
                raise ValueError(f"{name} has shape {state.shape}, but q has {states[0].shape}; they must be the same")
        if states[0].ndim == 2:
            return map_states(bicycle, *states)
        return map_states(bicycle, *(state[None] for state in states))[0]

    return cast("_Map", mapped)


@_of_one_or_many
def rotations(bicycle: Bicycle, q: np.ndarray) -> np.ndarray:
    """Compute the rotation matrices of the four bodies along a trajectory.

    Parameters
    ----------
    bicycle : Bicycle
    q : ndarray, shape (n, 9) or (9,)
        Generalised coordinates [m, rad].

    Returns
    -------
    ndarray, shape (n, 4, 3, 3)
        Body to inertial axes, bodies in the order of `BODIES`.
    """
    _, y, _ = np.eye(3)
    rear, front = _frame_rotations(bicycle, q)
    turned = (rear, front, rear @ _axis_angle(y, q[:, REAR_ANGLE]), front @ _axis_angle(y, q[:, FRONT_ANGLE]))
    return np.stack(turned, axis=1)


def _frame_rotations(bicycle: Bicycle, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Compute the rotation matrices of the rear and the front frame, each of shape (n, 3, 3)."""
    x, y, z = np.eye(3)
    rear = _axis_angle(z, q[:, YAW]) @ _axis_angle(x, q[:, LEAN]) @ _axis_angle(y, q[:, PITCH])
    return rear, rear @ _axis_angle(bicycle.steer_axis, q[:, STEER])


@_of_one_or_many
def body_positions(bicycle: Bicycle, q: np.ndarray) -> np.ndarray:
    """Compute the centres of mass of the four bodies, shape (n, 4, 3) [m], from coordinates (n, 9)."""
    offsets = np.array([bicycle.centre(body) - bicycle.reference_point for body in BODIES])
    positions = np.empty((len(q), 4, 3))
    bodies.fill_positions(np.ascontiguousarray(q, float), offsets, constants(bicycle), positions)
    return positions


@_of_one_or_many
def body_quaternions(bicycle: Bicycle, q: np.ndarray) -> np.ndarray:
    """Compute the orientations of the four bodies as unit quaternions from coordinates.

    Parameters
    ----------
    bicycle : Bicycle
    q : ndarray, shape (n, 9) or (9,)
        Generalised coordinates [m, rad].

    Returns
    -------
    ndarray, shape (n, 4, 4)
        (w, x, y, z), body to inertial axes, bodies in the order of `BODIES`; as continuous as the coordinates.
    """
    orientations = np.empty((len(q), 4, 4))
    bodies.fill_quaternions(np.ascontiguousarray(q, float), constants(bicycle), orientations)
    return orientations


@_of_one_or_many
def angular_velocities(bicycle: Bicycle, q: np.ndarray, qd: np.ndarray) -> np.ndarray:
    """Compute the angular velocities of the four bodies in inertial axes, shape (n, 4, 3) [rad/s]."""
    x, _, z = np.eye(3)
    yawed = _axis_angle(z, q[:, YAW])
    turned = rotations(bicycle, q)
    rear_axle, front_axle = turned[:, 0, :, 1], turned[:, 1, :, 1]
    rear = qd[:, [YAW]] * z + qd[:, [LEAN]] * (yawed @ x) + qd[:, [PITCH]] * rear_axle
    front = rear + qd[:, [STEER]] * (turned[:, 0] @ bicycle.steer_axis)
    wheels = (rear + qd[:, [REAR_ANGLE]] * rear_axle, front + qd[:, [FRONT_ANGLE]] * front_axle)
    return np.stack((rear, front, *wheels), axis=1)


@_of_one_or_many
def body_velocities(bicycle: Bicycle, q: np.ndarray, qd: np.ndarray) -> np.ndarray:
    """Compute the velocities of the four centres of mass in inertial axes, shape (n, 4, 3) [m/s]."""
    arms = body_positions(bicycle, q) - q[:, None, :3]
    spins = angular_velocities(bicycle, q, qd)[:, [0, 1, 0, 1]]
    return qd[:, None, :3] + np.cross(spins, arms)


def quaternions(matrices: np.ndarray) -> np.ndarray:
    """Convert rotation matrices (..., 3, 3) to unit quaternions (w, x, y, z), continuous along the first axis."""
    shape = matrices.shape[:-2]
    # Imported here: the import takes a third of a second, and most commands do not need it.
    from scipy.spatial.transform import Rotation

    xyzw = Rotation.from_matrix(matrices.reshape(-1, 3, 3)).as_quat().reshape(*shape, 4)
    wxyz = xyzw[..., [3, 0, 1, 2]]
    if len(shape) > 0 and shape[0] > 1:
        flips = np.cumprod(np.where((wxyz[1:] * wxyz[:-1]).sum(-1, keepdims=True) < 0, -1.0, 1.0), axis=0)
        wxyz = np.concatenate([wxyz[:1], wxyz[1:] * flips])
    return wxyz


def coordinates_from_bodies(
    bicycle: Bicycle,
    times: np.ndarray,
    position: np.ndarray,
    velocity: np.ndarray,
    rotation: np.ndarray,
    spin: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Compute generalised coordinates and rates from the motion of four separate rigid bodies.

    Parameters
    ----------
    bicycle : Bicycle
    times : ndarray, shape (n,)
        Sampling times [s], needed for the continuity of angles that change by more than half a turn between samples.
    position, velocity : ndarray, shape (n, 3)
        Centre of mass of the rear frame and its velocity [m, m/s].
    rotation : ndarray, shape (n, 4, 3, 3)
        Body to inertial axes, bodies in the order of `BODIES`.
    spin : ndarray, shape (n, 4, 3)
        Angular velocities in inertial axes [rad/s].

    Returns
    -------
    q, qd : ndarray, shape (n, 9)
        Angles start in (-pi, pi] and are continuous from then on.
    """
    rear = rotation[:, 0]
    arm = np.einsum("nij,j->ni", rear, bicycle.reference_point - bicycle.centre("rear_frame"))
    steer_axis = bicycle.steer_axis
    across = np.cross(steer_axis, [0.0, 1.0, 0.0])
    lean = np.arcsin(np.clip(rear[:, 2, 1], -1, 1))
    yaw = np.arctan2(-rear[:, 0, 1], rear[:, 1, 1])
    pitch = np.arctan2(-rear[:, 2, 0], rear[:, 2, 2])
    relative = np.einsum("nji,njk->nik", rear, rotation[:, 1])
    left = relative[:, :, 1]
    steer = np.arctan2(left @ across, left[:, 1])
    angles = [yaw, lean, pitch, steer]
    for carrier, wheel in ((0, 2), (1, 3)):
        turned = np.einsum("nji,njk->nik", rotation[:, carrier], rotation[:, wheel])
        angles.append(np.arctan2(turned[:, 0, 2], turned[:, 2, 2]))
    # Rates: w_rear = yaw_rate z + lean_rate a + pitch_rate y_r, with y_r . a = 0 and z . a = 0.
    cosine = np.cos(lean)
    a_lean = np.stack([np.cos(yaw), np.sin(yaw), np.zeros_like(yaw)], axis=1)
    ahead = np.cross(a_lean, rear[:, :, 1])
    yaw_rate = np.einsum("ni,ni->n", spin[:, 0], ahead) / cosine
    lean_rate = np.einsum("ni,ni->n", spin[:, 0], a_lean)
    pitch_rate = np.einsum("ni,ni->n", spin[:, 0], rear[:, :, 1]) - yaw_rate * np.sin(lean)
    steer_rate = np.einsum("ni,ni->n", spin[:, 1] - spin[:, 0], rear @ steer_axis)
    rates = [yaw_rate, lean_rate, pitch_rate, steer_rate]
    for carrier, wheel in ((0, 2), (1, 3)):
        rates.append(np.einsum("ni,ni->n", spin[:, wheel] - spin[:, carrier], rotation[:, carrier, :, 1]))
    q = np.column_stack([position + arm, *(unwrap(times, a, r) for a, r in zip(angles, rates, strict=True))])
    qd = np.column_stack([velocity + np.cross(spin[:, 0], arm), *rates])
    return q, qd


def unwrap(times: np.ndarray, angle: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Make an angle known modulo 2 pi continuous with the help of its rate, both of shape (n,).

    Between two samples, the change nearest to the trapezoidal integral of the rate is taken, so samples may lie more
    than half a turn apart.
    """
    expected = 0.5 * (rate[1:] + rate[:-1]) * np.diff(times)
    step = np.diff(angle)
    step += 2 * np.pi * np.round((expected - step) / (2 * np.pi))
    return np.concatenate([angle[:1], angle[0] + np.cumsum(step)])
