"""Convert between the suite's coordinates and MuJoCo's.

    qpos = (D (3), quaternion of the rear frame (4), rear_angle, steer, front_angle)
    qvel = (velocity of D (3), angular velocity of the rear frame in its own axes (3), their rates)

With yaw, lean and pitch (3-1-2) R = Rz Rx Ry, and the angular velocity in body axes is

    w = (cos(pitch) lean' - cos(lean) sin(pitch) yaw',
         pitch' + sin(lean) yaw',
         sin(pitch) lean' + cos(lean) cos(pitch) yaw')
"""

from __future__ import annotations

import numpy as np

from ...reference.kinematics import FRONT_ANGLE, LEAN, PITCH, REAR_ANGLE, STEER, YAW, unwrap

# Order of the hinges in the tree.
HINGES = [REAR_ANGLE, STEER, FRONT_ANGLE]


def to_mujoco(q: np.ndarray, qd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Convert one state of the bicycle to MuJoCo's state.

    Parameters
    ----------
    q, qd : ndarray, shape (9,)
        Generalised coordinates and rates.

    Returns
    -------
    qpos : ndarray, shape (10,)
    qvel : ndarray, shape (9,)
    """
    (cy, cl, cp), (sy, sl, sp) = np.cos(q[3:6] / 2), np.sin(q[3:6] / 2)
    # product of the three quaternions (cy, 0, 0, sy) (cl, sl, 0, 0) (cp, 0, sp, 0)
    quaternion = [
        cy * cl * cp - sy * sl * sp,
        cy * sl * cp - sy * cl * sp,
        cy * cl * sp + sy * sl * cp,
        cy * sl * sp + sy * cl * cp,
    ]
    qpos = np.concatenate([q[:3], quaternion, q[HINGES]])
    qvel = np.concatenate([qd[:3], spin_matrix(q) @ qd[3:6], qd[HINGES]])
    return qpos, qvel


def spin_matrix(q: np.ndarray) -> np.ndarray:
    """Return the matrix (3, 3) from yaw, lean and pitch rates to the angular velocity in the rear frame's axes."""
    cl, cp, sl, sp = np.cos(q[LEAN]), np.cos(q[PITCH]), np.sin(q[LEAN]), np.sin(q[PITCH])
    return np.array([[-cl * sp, cp, 0.0], [sl, 0.0, 1.0], [cl * cp, sp, 0.0]])


def from_mujoco(
    times: np.ndarray, qpos: np.ndarray, qvel: np.ndarray, start: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Convert a trajectory of MuJoCo's states to generalised coordinates and rates.

    Parameters
    ----------
    times : ndarray, shape (n,)
        Sampling times [s], for continuity of the angles beyond half a turn.
    qpos : ndarray, shape (n, 10)
    qvel : ndarray, shape (n, 9)
    start : ndarray, shape (9,)
        Coordinates at the start, which determine the whole turns of yaw and pitch.

    Returns
    -------
    q, qd : ndarray, shape (n, 9)
    """
    w, x, y, z = qpos[:, 3:7].T
    sine, cosine = 2 * (y * z + w * x), np.hypot(2 * (x * y - w * z), 1 - 2 * (x * x + z * z))
    yaw = np.arctan2(2 * (w * z - x * y), 1 - 2 * (x * x + z * z))
    pitch = np.arctan2(2 * (w * y - x * z), 1 - 2 * (x * x + y * y))
    spin = qvel[:, 3:6]
    lean_rate = np.cos(pitch) * spin[:, 0] + np.sin(pitch) * spin[:, 2]
    yaw_rate = (np.cos(pitch) * spin[:, 2] - np.sin(pitch) * spin[:, 0]) / cosine
    pitch_rate = spin[:, 1] - sine * yaw_rate
    q, qd = np.empty((len(times), 9)), np.empty((len(times), 9))
    q[:, :3], q[:, HINGES] = qpos[:, :3], qpos[:, 7:]
    qd[:, :3], qd[:, HINGES] = qvel[:, :3], qvel[:, 6:]
    q[:, LEAN], qd[:, LEAN] = np.arctan2(sine, cosine), lean_rate
    for index, angle, rate in ((YAW, yaw, yaw_rate), (PITCH, pitch, pitch_rate)):
        turns = 2 * np.pi * np.round((start[index] - angle[0]) / (2 * np.pi))
        q[:, index], qd[:, index] = unwrap(times, angle + turns, rate), rate
    return q, qd
