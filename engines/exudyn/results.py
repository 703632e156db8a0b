"""The suite's quantities from the engine's bodies and multipliers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...reference.bicycle import BODIES, Bicycle
from ...reference.kernels.wheel import observe_wheels
from ...reference.rim import rim_search
from ..coordinates import coordinates_from_bodies, start_on_turn
from ..engine import Problem
from .model import BodyMotion, Model
from .wheels import MASS_UNIT, wheel_radii


@dataclass(frozen=True)
class Contacts:
    """Contacts of both wheels along a run, shapes as in `velodrome.engines.engine.Trajectory`."""

    point: np.ndarray
    force: np.ndarray
    gap: np.ndarray
    slip: np.ndarray


def measure_contacts(problem: Problem, model: Model, motion: BodyMotion) -> Contacts:
    """Measure gap and slip at the wheels' bodies, and transform the contact forces to inertial axes."""
    n = len(motion.time)
    point, force, gap, slip = np.empty((n, 2, 3)), np.empty((n, 2, 3)), np.empty((n, 2)), np.empty((n, 2, 2))
    function, parameters = problem.surface.function.real, problem.surface.parameters
    looking = rim_search(problem.surface, wheel_radii(problem))
    local_forces = model.rolling.local_forces(model.system)
    for wheel, radius in enumerate(wheel_radii(problem)):
        body = 2 + wheel
        frames, unused = np.empty((n, 3, 3)), np.empty((3, n, 3))
        observe_wheels(
            motion.position[:, body],
            motion.velocity[:, body],
            motion.rotation[:, body],
            motion.spin[:, body],
            np.full(n, radius),
            looking,
            function,
            parameters,
            point[:, wheel],
            frames,
            gap[:, wheel],
            slip[:, wheel],
            *unused,
        )
        force[:, wheel] = np.einsum("ni,nij->nj", local_forces[:, wheel], frames)
    return Contacts(point, force, gap, slip)


def weights(bicycle: Bicycle) -> np.ndarray:
    """Return the weights of the four bodies in the model's unit of force, shape (4,)."""
    return bicycle.gravity / MASS_UNIT * np.array([bicycle.body_mass(body) for body in BODIES])


def read_energies(bicycle: Bicycle, motion: BodyMotion) -> tuple[np.ndarray, np.ndarray]:
    """Compute kinetic and potential energy of the four bodies, each of shape (n,) [J]."""
    mass = np.array([bicycle.body_mass(body) for body in BODIES])
    inertia = np.stack([bicycle.inertia(body) for body in BODIES])
    spin = np.einsum("nbji,nbj->nbi", motion.rotation, motion.spin)
    translation = np.einsum("b,nbi,nbi->n", mass, motion.velocity, motion.velocity)
    turning = np.einsum("nbi,bij,nbj->n", spin, inertia, spin)
    return 0.5 * (translation + turning), bicycle.gravity * (motion.position[:, :, 2] @ mass)


def read_coordinates(problem: Problem, motion: BodyMotion) -> tuple[np.ndarray, np.ndarray]:
    """Compute generalised coordinates and rates (n, 9), with angles on the same turn as the problem's start."""
    q, qd = coordinates_from_bodies(
        problem.bicycle, motion.time, motion.position[:, 0], motion.velocity[:, 0], motion.rotation, motion.spin
    )
    return start_on_turn(q, problem.q), qd
