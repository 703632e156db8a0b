"""Build the bicycle on Drake's own contacts: one fixed plane, or one per wheel that moves with the tangent plane.

Drake has no curved ground of its own but meshes, whose contacts jump from facet to facet. Before every step each half
space is put into the tangent plane of the surface below its wheel, where distance and normal are those of the surface.
It belongs to a body that is welded to the world by a frame whose pose is a parameter of Drake's context, so that the
ground has no inertia and no velocity.
"""

# Drake is not among the suite's own dependencies.
# pyright: reportMissingImports=false

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from pydrake.geometry import (
    AddContactMaterial,
    CollisionFilterDeclaration,
    Ellipsoid,
    GeometrySet,
    HalfSpace,
    ProximityProperties,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import (
    AddMultibodyPlantSceneGraph,
    ContactModel,
    CoulombFriction,
    DiscreteContactApproximation,
)
from pydrake.multibody.tree import FixedOffsetFrame, SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from ...reference.kinematics import WHEELS
from ...reference.surface import is_level
from ..engine import Problem
from .contacts import HALF_THICKNESS, WheelContactFinder
from .ride import DrakeRig
from .settings import DrakeContactSettings
from .tree import DrakeTree, add_bicycle_tree, input_torques, read_wheel_motions, set_plant_state

LOOK_INTERVAL = 0.01  # between two checks of the contacts on level ground [s]


def build_contact_plant(problem: Problem, settings: DrakeContactSettings) -> DrakeRig:
    """Build a plant with discrete contacts at the start of a problem.

    Raises
    ------
    EngineError
        If Drake refuses the bicycle.
    """
    moving = not is_level(problem.surface)
    builder = DiagramBuilder()
    plant, scene = AddMultibodyPlantSceneGraph(builder, settings.step)
    plant.set_discrete_contact_approximation(getattr(DiscreteContactApproximation, f"k{settings.solver.capitalize()}"))
    plant.set_contact_model(ContactModel.kPoint)
    plant.set_sap_near_rigid_threshold(settings.near_rigid_threshold)
    # Otherwise the forces of the first sample would be zero and those of the others would belong to the step before.
    plant.SetUseSampledOutputPorts(False)
    tree = add_bicycle_tree(plant, problem.bicycle, problem.inputs.steer_damping)
    material = _make_material(settings)
    for wheel, radius in zip(
        tree.wheels, (problem.bicycle.rear_wheel_radius, problem.bicycle.front_wheel_radius), strict=True
    ):
        shape = Ellipsoid(radius, HALF_THICKNESS, radius)
        plant.RegisterCollisionGeometry(wheel, RigidTransform(), shape, wheel.name(), material)
    frames = [_add_ground(plant, name, material) for name in WHEELS] if moving else []
    if not moving:
        plant.RegisterCollisionGeometry(plant.world_body(), RigidTransform(), HalfSpace(), "ground", material)
    plant.Finalize()
    plant.set_stiction_tolerance(settings.stiction_tolerance)
    _keep_apart(plant, scene, tree, moving)
    with _hide_warning():
        simulator = Simulator(builder.Build())
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    set_plant_state(tree, context, problem.bicycle, problem.q, problem.qd)
    plant.get_applied_generalized_force_input_port().FixValue(context, input_torques(tree, problem.inputs))
    finder = WheelContactFinder(problem.bicycle, problem.surface)
    stride = 1 if moving else max(1, int(LOOK_INTERVAL / settings.step))

    def follow(steps: int) -> None:
        if steps % stride:
            return
        read_wheel_motions(tree, context, finder.motion)
        finder.find()
        for k, frame in enumerate(frames):
            frame.SetPoseInParentFrame(context, _place_plane(finder.point[k], finder.frames[k, 2], finder.gap[k]))

    return DrakeRig(simulator, tree, context, follow, lambda: _read_forces(tree, context))


@contextmanager
def _hide_warning() -> Iterator[None]:
    """Hide Drake's warning that half spaces do not touch deformable bodies, of which there are none."""

    def is_wanted(record: logging.LogRecord) -> bool:
        return "deformable" not in record.getMessage()

    logger = logging.getLogger("drake")
    logger.addFilter(is_wanted)
    try:
        yield
    finally:
        logger.removeFilter(is_wanted)


def _make_material(settings: DrakeContactSettings) -> Any:
    """Return the properties of the wheels and the ground."""
    material = ProximityProperties()
    AddContactMaterial(
        dissipation=settings.dissipation,
        point_stiffness=settings.stiffness,
        friction=CoulombFriction(settings.friction, settings.friction),
        properties=material,
    )
    material.AddProperty("material", "relaxation_time", settings.relaxation_time)
    return material


def _add_ground(plant: Any, wheel: str, material: Any) -> Any:
    """Add the half space of a wheel; return the frame whose pose in the world is the half space's."""
    body = plant.AddRigidBody(f"{wheel}_ground", SpatialInertia.Zero())
    plant.RegisterCollisionGeometry(body, RigidTransform(), HalfSpace(), body.name(), material)
    frame = plant.AddFrame(FixedOffsetFrame(f"{wheel}_tangent_plane", plant.world_frame(), RigidTransform()))
    plant.WeldFrames(frame, body.body_frame())
    return frame


def _keep_apart(plant: Any, scene: Any, tree: DrakeTree, moving: bool) -> None:
    """Let each wheel touch nothing but the ground, and of two half spaces its own only."""
    rear, front = tree.wheels
    pairs = [(rear, front)]
    if moving:
        pairs += [(plant.GetBodyByName("rear_ground"), front), (plant.GetBodyByName("front_ground"), rear)]
    for pair in pairs:
        sets = (GeometrySet(plant.GetCollisionGeometriesForBody(body)) for body in pair)
        scene.collision_filter_manager().Apply(CollisionFilterDeclaration().ExcludeBetween(*sets))


def _place_plane(point: np.ndarray, normal: np.ndarray, gap: float) -> Any:
    """Return the pose of the tangent plane below a wheel's contact, by the shortest rotation of z to the normal."""
    x, y, z = normal
    share = 1 / (1 + z)
    rotation = np.array([[1 - x * x * share, -x * y * share, x], [-x * y * share, 1 - y * y * share, y], [-x, -y, z]])
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, point - gap * normal
    return RigidTransform(pose)


def _read_forces(tree: DrakeTree, context: Any) -> np.ndarray:
    """Return the contact forces on the wheels (2, 3) during the step that begins at the context's state [N]."""
    results = tree.plant.get_contact_results_output_port().Eval(context)
    wheels = [wheel.index() for wheel in tree.wheels]
    forces = np.zeros((2, 3))
    for k in range(results.num_point_pair_contacts()):
        contact = results.point_pair_contact_info(k)
        # The force is that on the second body.
        for body, sign in ((contact.bodyA_index(), -1.0), (contact.bodyB_index(), 1.0)):
            if body in wheels:
                forces[wheels.index(body)] += sign * contact.contact_force()
    return forces
