"""Circular motions as trajectories in closed form, against which drift is measured."""

from __future__ import annotations

import numpy as np

from ...engines.engine import Trajectory
from ...reference.bicycle import Bicycle
from ...reference.circular import CircularMotion
from ...reference.kinematics import FRONT_ANGLE, REAR_ANGLE, YAW, body_positions, body_quaternions


def steady_trajectory(bicycle: Bicycle, motion: CircularMotion, times: np.ndarray) -> Trajectory:
    """Return samples of a circular motion: everything turns about z at the yaw rate (Xiong et al. 2020, Eqs. 9-11).

    Parameters
    ----------
    bicycle : Bicycle
    motion : CircularMotion
    times : ndarray, shape (n,)
        [s]; at 0 the yaw and both wheel angles are 0.

    Returns
    -------
    Trajectory
        Has coordinates, poses and contact forces; steps and CPU time are 0.
    """
    start, rates = motion.state()
    q, qd = np.tile(start, (len(times), 1)), np.tile(rates, (len(times), 1))
    for index in (YAW, REAR_ANGLE, FRONT_ANGLE):
        q[:, index] = rates[index] * times
    cosine, sine = np.cos(q[:, YAW]), np.sin(q[:, YAW])
    q[:, :2] = _rotate(cosine, sine, start[:2])
    qd[:, :2] = _rotate(cosine, sine, rates[:2])
    force = np.tile(motion.force, (len(times), 1, 1))
    for wheel in range(2):
        force[:, wheel, :2] = _rotate(cosine, sine, motion.force[wheel, :2])
    return Trajectory(
        engine="circular motion",
        version="",
        settings={},
        time=times,
        q=q,
        qd=qd,
        body_position=body_positions(bicycle, q),
        body_quaternion=body_quaternions(bicycle, q),
        contact_force=force,
        steps=0,
        cpu_time=0.0,
    )


def _rotate(cosine: np.ndarray, sine: np.ndarray, vector: np.ndarray) -> np.ndarray:
    return np.column_stack([cosine * vector[0] - sine * vector[1], sine * vector[0] + cosine * vector[1]])
