"""From the engine's bodies and multipliers to the suite's quantities."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engines.engine import Problem
from reference.bicycle import BODIES, Bicycle
from reference.kinematics import YAW, coordinates_from_bodies

from . import kernel
from .joint import RollingJoint
from .model import Model, Motion, stored


@dataclass(frozen=True)
class Contacts:
    """Contacts of both wheels along a run, shapes as in `engines.engine.Trajectory`."""

    point: np.ndarray
    force: np.ndarray
    gap: np.ndarray
    slip: np.ndarray


def measure_contacts(problem: Problem, model: Model[RollingJoint], motion: Motion) -> Contacts:
    """Measure gap and slip on the wheels' own bodies, and collect the contact forces.

    The engine adds W^T lambda to the inertia forces' side, so the force on the wheel is minus the
    multipliers along the contact's axes.
    """
    n = len(motion.time)
    point, force, gap, slip = np.empty((n, 2, 3)), np.empty((n, 2, 3)), np.empty((n, 2)), np.empty((n, 2, 2))
    function, parameters = problem.surface.function.real, problem.surface.parameters
    radii = (problem.bicycle.rear_wheel_radius, problem.bicycle.front_wheel_radius)
    for wheel, (radius, joint) in enumerate(zip(radii, model.joints, strict=True)):
        body = 2 + wheel
        frames = np.empty((n, 3, 3))
        kernel.observe(
            *(motion.position[:, body], motion.velocity[:, body], motion.rotation[:, body], motion.spin[:, body]),
            *(radius, function, parameters),
            *(point[:, wheel], frames, gap[:, wheel], slip[:, wheel]),
        )
        tangential = stored(model, joint.slip_multipliers)[:, 1:]
        normal = stored(model, joint.gap_multiplier)[:, 1:]
        force[:, wheel] = -np.einsum("ni,nij->nj", np.hstack([tangential, normal]), frames)
    return Contacts(point, force, gap, slip)


def energies(bicycle: Bicycle, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
    """Kinetic and potential energy of the four bodies, each of shape (n,) [J]."""
    mass = np.array([bicycle.body_mass(body) for body in BODIES])
    inertia = np.stack([bicycle.inertia(body) for body in BODIES])
    spin = np.einsum("nbji,nbj->nbi", motion.rotation, motion.spin)
    translation = np.einsum("b,nbi,nbi->n", mass, motion.velocity, motion.velocity)
    turning = np.einsum("nbi,bij,nbj->n", spin, inertia, spin)
    return 0.5 * (translation + turning), bicycle.gravity * (motion.position[:, :, 2] @ mass)


def coordinates(problem: Problem, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
    """Generalised coordinates and rates (n, 9), the angles on the turn on which the problem starts."""
    q, qd = coordinates_from_bodies(
        problem.bicycle, motion.time, motion.position[:, 0], motion.velocity[:, 0], motion.rotation, motion.spin
    )
    turns = np.round((problem.q[YAW:] - q[0, YAW:]) / (2 * np.pi))
    q[:, YAW:] += 2 * np.pi * turns
    return q, qd
