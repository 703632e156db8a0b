"""A ride in DART's world: thin cylinders on a plane, and a contact problem in every step.

DART solves for the velocities at the end of a step that are free of slip, and moves the bodies with them. The contact
that is held is a point of the rim that the wheel turns on during the step: on a path of radius R the wheels creep by
the step times v^2 / R.
"""

# DART is an optional library, and its compiled bindings carry no types.
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

from dataclasses import dataclass
from time import process_time
from typing import Any

import dartpy as dart
import numpy as np

from velodrome.engines.coordinates import WHEELS, coordinates_from_bodies
from velodrome.engines.engine import Problem, Progress
from velodrome.engines.problems import steps_per_output

from .settings import DartSettings
from .tree import HINGES, REAR_RATE, STEER_RATE, build_tree

# Turns a cylinder's axis, z, to the wheel's, y.
TO_AXLE = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
HUGE = 1e10


@dataclass(frozen=True)
class Recording:
    """The n samples of a ride.

    Attributes
    ----------
    time : ndarray, shape (n,)
        DART's clock [s].
    q, qd : ndarray, shape (n, 9)
        Coordinates and rates.
    position, rotation : ndarray, shapes (n, 4, 3), (n, 4, 3, 3)
        Centres of mass [m] and orientations of the bodies.
    force : ndarray, shape (n, 2, 3)
        Forces of the ground on the wheels in the step that begins at a sample [N].
    energy : ndarray, shape (n, 2)
        Kinetic and potential energy [J].
    steps : int
    cpu_time : float
        Process CPU time of the steps [s].
    ended : str or None
        Why the ride ended early.
    unconverged_steps : int or None
    """

    time: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    position: np.ndarray
    rotation: np.ndarray
    force: np.ndarray
    energy: np.ndarray
    steps: int
    cpu_time: float
    ended: str | None
    unconverged_steps: int | None


class Rig:
    """A bicycle in DART's world, at its start.

    Parameters
    ----------
    problem : Problem
    settings : DartSettings

    Attributes
    ----------
    world : dartpy.simulation.World
    tree : Tree
    steps : int
        Steps taken.
    """

    def __init__(self, problem: Problem, settings: DartSettings) -> None:
        bicycle = problem.bicycle
        self.tree = build_tree(bicycle)
        self._wheels = {f"{name}_wheel": k for k, name in enumerate(WHEELS)}
        for body in self.tree.bodies:
            if body.getName() in self._wheels:
                radius = getattr(bicycle, f"{body.getName()}_radius")
                node = _add_shape(body, dart.dynamics.CylinderShape(radius, 2 * settings.half_thickness), settings)
                turned = dart.math.Isometry3()
                turned.set_rotation(TO_AXLE)
                node.setRelativeTransform(turned)
        ground = dart.dynamics.Skeleton("ground")
        plane = dart.dynamics.PlaneShape([0.0, 0.0, 1.0], 0.0)
        _add_shape(ground.createWeldJointAndBodyNodePair(None)[1], plane, settings)
        self.world = dart.simulation.World("velodrome")
        self.world.setTimeStep(settings.step)
        self.world.setGravity([0.0, 0.0, -bicycle.gravity])
        asleep = self.world.getDeactivationOptions()
        asleep.mEnabled = False  # slow bodies would stop
        self.world.setDeactivationOptions(asleep)
        self.tree.skeleton.disableSelfCollisionCheck()
        self.world.addSkeleton(self.tree.skeleton)
        self.world.addSkeleton(ground)
        self._nsgs = _choose_solver(self.world.getConstraintSolver(), settings)
        self.tree.set_state(bicycle, problem.q, problem.qd)
        self.steps = 0
        self._inputs = problem.inputs

    @property
    def unconverged(self) -> int | None:
        """Steps in which nsgs stopped before it met its tolerance; None for a method that does not iterate."""
        if self._nsgs is None:
            return None
        stats = self._nsgs.getStats()
        return int(stats.numAcceptedAtCap + stats.numFailed)

    def advance(self) -> None:
        """Take a step."""
        inputs, skeleton = self._inputs, self.tree.skeleton
        rate = skeleton.getVelocity(STEER_RATE)
        skeleton.setForce(STEER_RATE, inputs.steer_torque - inputs.steer_damping * rate)
        skeleton.setForce(REAR_RATE, inputs.rear_wheel_torque)
        self.world.step()
        self.steps += 1

    def read_forces(self) -> np.ndarray:
        """Return the forces on the wheels in the last step, shape (2, 3) [N]."""
        force = np.zeros((2, 3))
        for contact in self.world.getLastCollisionResult().getContacts():
            for sign, node in ((1, contact.collisionObject1), (-1, contact.collisionObject2)):
                k = self._wheels.get(node.getShapeFrame().asShapeNode().getBodyNodePtr().getName())
                if k is not None:
                    force[k] += sign * np.asarray(contact.force)
        return force


def ride_bicycle(problem: Problem, settings: DartSettings, progress: Progress) -> Recording:
    """Ride a problem."""
    rig, stride, n = Rig(problem, settings), steps_per_output(problem.times, settings.step), len(problem.times)
    bicycle, bodies = problem.bicycle, rig.tree.bodies
    arm = bicycle.centre("rear_frame") - bicycle.reference_point
    time, force, energy = np.empty(n), np.empty((n, 2, 3)), np.empty((n, 2))
    position, rotation, spin = np.empty((n, 4, 3)), np.empty((n, 4, 3, 3)), np.empty((n, 4, 3))
    velocity, hinges = np.empty((n, 3)), np.empty((n, 2, 3))
    samples, steps, cpu_time, ended = 0, 0, 0.0, None
    for k in range(n):
        skeleton = rig.tree.skeleton
        state = np.array([skeleton.getPositions(), skeleton.getVelocities()])
        if not np.abs(state).max() < HUGE:
            ended = f"DART's state became infinite or huge before {problem.times[k]:.6g} s"
            break
        time[k], hinges[k], steps = rig.world.getTime(), state[:, 6:], rig.steps
        rotation[k] = rig.tree.read_rotations()
        for i, body in enumerate(bodies):
            position[k, i], spin[k, i] = body.getCOM(), body.getAngularVelocity()
        velocity[k] = bodies[0].getLinearVelocity(arm)
        energy[k] = skeleton.computeKineticEnergy(), skeleton.computePotentialEnergy()
        samples = k + 1
        progress(time[k])
        # The forces of a sample are those of the step that begins there, also of the last one.
        begin = process_time()
        rig.advance()
        force[k] = rig.read_forces()
        if k < n - 1:
            for _ in range(stride - 1):
                rig.advance()
        cpu_time += process_time() - begin
    kept = slice(samples)
    q, qd = coordinates_from_bodies(bicycle, time[kept], position[kept, 0], velocity[kept], rotation[kept], spin[kept])
    q[:, HINGES], qd[:, HINGES] = hinges[kept, 0], hinges[kept, 1]
    return Recording(
        time[kept],
        q,
        qd,
        position[kept],
        rotation[kept],
        force[kept],
        energy[kept],
        steps=steps,
        cpu_time=cpu_time,
        ended=ended,
        unconverged_steps=rig.unconverged,
    )


def _add_shape(body: Any, shape: Any, settings: DartSettings) -> Any:
    """Let a body collide with a shape; return the node of the shape."""
    node = body.createShapeNode(shape)
    node.createCollisionAspect()
    surface = node.createDynamicsAspect()
    surface.setFrictionCoeff(settings.friction)
    surface.setRestitutionCoeff(0.0)
    return node


def _choose_solver(constraints: Any, settings: DartSettings) -> Any | None:
    """Set the collision detector and the contact solver; return the solver if it iterates."""
    detectors = {
        "bullet": dart.collision.BulletCollisionDetector,
        "ode": dart.collision.OdeCollisionDetector,
    }
    constraints.setCollisionDetector(detectors[settings.detector]())
    if settings.solver == "boxed-lcp":
        return None
    solver = dart.constraint.NsgsFrictionSolver()
    options = solver.getOptions()
    options.tolerance, options.maxSweeps = settings.accuracy, settings.iterations
    solver.setOptions(options)
    constraints.setBoxedLcpSolver(solver)
    return solver
