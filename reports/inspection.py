"""A ride looked at with the suite's own eyes: its state against the exact one, its reports against its state."""

from __future__ import annotations

import numpy as np

from engines.engine import Trajectory
from reference.bicycle import Bicycle
from reference.contact import Observation
from reference.kinematics import FRONT_ANGLE, REAR_ANGLE, YAW, body_positions, quaternions, rotations

from .limits import Scale
from .metrics import SETTLED

# Known up to whole turns.
_TURNING = [YAW, REAR_ANGLE, FRONT_ANGLE]


def state_error(trajectory: Trajectory, exact: Trajectory, scale: Scale) -> float:
    """Root mean square of all coordinates' and rates' differences from the exact motion's, relative to its sizes.

    A largest difference would hide what changes in any coordinate but the worst.

    Parameters
    ----------
    trajectory, exact : Trajectory
        Sampled at the same times; the exact one may be longer.
    scale : Scale
        Positions are measured by its radius, wheel angles by what they turn in its duration, other angles by a
        radian; rates by the wheels', and those of D by its speed.
    """
    return float(np.sqrt(np.mean(relative_differences(trajectory, exact, scale) ** 2)))


def relative_differences(trajectory: Trajectory, exact: Trajectory, scale: Scale) -> np.ndarray:
    """Differences of all coordinates and rates of a ride of n samples, relative to sizes as in `state_error`.

    Returns
    -------
    ndarray, shape (2, n, 9)
    """
    n = len(trajectory.time)
    apart = trajectory.q - exact.q[:n]
    apart[:, _TURNING] -= 2 * np.pi * np.round(apart[:, _TURNING] / (2 * np.pi))
    sizes = np.array([*3 * [scale.radius], *4 * [1.0], *2 * [scale.turned]])
    return np.array([apart / sizes, (trajectory.qd - exact.qd[:n]) / scale.rates])


def rms_force_error(trajectory: Trajectory, exact: Trajectory) -> float | None:
    """Root mean square of the contact forces' differences from the exact ones, relative to the largest of those.

    A largest difference would hide what changes in any sample but the worst. Samples before contacts have settled are
    left out; None where there are no others, or no forces.
    """
    settled = trajectory.time >= SETTLED
    if trajectory.contact_force is None or exact.contact_force is None or not settled.any():
        return None
    force = exact.contact_force[: len(trajectory.time)]
    apart = np.linalg.norm(trajectory.contact_force - force, axis=2)[settled]
    return float(np.sqrt(np.mean(apart**2)) / np.linalg.norm(force, axis=2).max())


def report_mismatch(trajectory: Trajectory, seen: Observation, bicycle: Bicycle, scale: Scale) -> float:
    """How far what an engine reports is from what follows from its coordinates, relative to the motion's sizes.

    Parameters
    ----------
    trajectory : Trajectory
    seen : Observation
        Of its coordinates and rates, by `reference.contact.observe`.
    bicycle : Bicycle
    scale : Scale

    Returns
    -------
    float
        The largest of poses, contact points, gaps, slip and energies, of those that are given.
    """
    own, followed = trajectory.body_quaternion, quaternions(rotations(bicycle, trajectory.q))
    turned = np.minimum(np.linalg.norm(own - followed, axis=-1), np.linalg.norm(own + followed, axis=-1))
    parts = [(trajectory.body_position - body_positions(bicycle, trajectory.q)) / scale.radius, turned]
    size = np.abs(seen.kinetic_energy[0]) + np.abs(seen.potential_energy[0])
    for given, found, unit in (
        (trajectory.contact_point, seen.point, scale.radius),
        (trajectory.gap, seen.gap, scale.radius),
        (trajectory.slip, seen.slip, scale.speed),
        (trajectory.kinetic_energy, seen.kinetic_energy, size),
        (trajectory.potential_energy, seen.potential_energy, size),
    ):
        if given is not None:
            parts.append((given - found) / unit)
    return float(max(np.abs(part).max() for part in parts))
