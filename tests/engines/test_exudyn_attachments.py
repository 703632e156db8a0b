"""What a rolling joint attaches to in Exudyn: every kind of node, kinematic trees, and moving ground."""

from __future__ import annotations

import math
import runpy
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import exudyn as exu
import numpy as np
import pytest
from exudyn.itemInterface import (
    MarkerBodyPosition,
    MarkerBodyRigid,
    MarkerKinematicTreeRigid,
    MarkerNodeRigid,
    NodeGenericODE2,
    ObjectJointSpherical,
    ObjectKinematicTree,
    SensorBody,
    SensorNode,
    SensorObject,
)
from exudyn.rigidBodyUtilities import InertiaCylinder, RigidBodyInertia

from velodrome.engines.exudyn import general, kernel
from velodrome.engines.exudyn.attachment import find_attachment, list_nodes, reference_coordinates, stack_frames
from velodrome.engines.exudyn.joint import CreateRollingJointOnSurface
from velodrome.engines.exudyn.pose import locate_body
from velodrome.engines.exudyn.sensor import CreateRollingJointSensor
from velodrome.engines.exudyn.solve import no_progress
from velodrome.reference.rim import rim_search
from velodrome.reference.surface import Paraboloid, Plane

EXAMPLE = SimpleNamespace(
    **runpy.run_path(str(Path(__file__).parents[2] / "examples" / "rolling_disc_in_bowl.py"), run_name="example")
)
LIBRARY: Any = exu
NODES = LIBRARY.NodeType
KINDS = LIBRARY.OutputVariableType
DISC = InertiaCylinder(density=2000, length=0.02, outerRadius=0.2, axis=2)
SPATIAL = (NODES.RotationEulerParameters, NODES.RotationRxyz, NODES.RotationRotationVector)
NAMES = ("EulerParameters", "Rxyz", "RotationVector")


def new_system() -> tuple[Any, Any]:
    """A container, which must be kept alive, and its system."""
    container: Any = exu.SystemContainer()
    return container, container.AddSystem()


def settings(step: float, duration: float) -> Any:
    options: Any = exu.SimulationSettings()
    options.solution.file.write = False
    options.solution.sensors.writePeriod = 0.01
    options.timeIntegration.verboseMode = 0
    options.timeIntegration.numberOfSteps, options.timeIntegration.endTime = round(duration / step), duration
    options.timeIntegration.generalizedAlpha.spectralRadius = 0.8
    options.timeIntegration.newton.useModifiedNewton = True
    options.timeIntegration.newton.relativeTolerance = 1e-11
    return options


def turned(x: float, y: float, z: float) -> np.ndarray:
    """A rotation matrix from angles about x, y and z, each turning the axes of the next."""
    (cx, cy, cz), (sx, sy, sz) = np.cos([x, y, z]), np.sin([x, y, z])
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return about_x @ about_y @ about_z


def place(rotation: np.ndarray, position: Any) -> np.ndarray:
    placed = np.eye(4)
    placed[:3, :3], placed[:3, 3] = rotation, position
    return placed


def add_tree(mbs: Any, types: list[str], parents: list[int], start: Any, rates: Any) -> Any:
    """A kinematic tree with joints at odd places and odd axes."""
    count = len(types)
    node = mbs.AddNode(
        NodeGenericODE2(
            numberOfODE2Coordinates=count,
            referenceCoordinates=start,
            initialCoordinates=[0.0] * count,
            initialCoordinates_t=rates,
        )
    )
    return mbs.AddObject(
        ObjectKinematicTree(
            nodeNumber=node,
            baseOffset=[0.3, -0.2, 0.5],
            jointTypes=[getattr(LIBRARY.JointType, name) for name in types],
            linkParents=parents,
            jointTransformations=LIBRARY.Matrix3DList([turned(0.3 * i, -0.2, 0.1 * i) for i in range(count)]),
            jointOffsets=LIBRARY.Vector3DList([np.array([0.1 * i, 0.2, -0.1 * i]) for i in range(count)]),
            linkInertiasCOM=LIBRARY.Matrix3DList([np.eye(3)] * count),
            linkCOMs=LIBRARY.Vector3DList([np.zeros(3)] * count),
            linkMasses=[1.0] * count,
        )
    )


def add_marker(mbs: Any, kind: str) -> Any:
    """A marker at an odd pose on a body in an odd motion, or on the fourth link of a tree with a branch."""
    turn = turned(0.4, -0.7, 1.1)
    local = place(turn, [0.1, 0.2, -0.3])
    if kind == "Tree":
        types = ["PrismaticY", "RevoluteX", "PrismaticZ", "RevoluteY", "RevoluteZ", "PrismaticX"]
        start = np.linspace(-0.6, 0.9, 6)
        tree = add_tree(mbs, types, [-1, 0, 1, 1, 3, 4], start, np.linspace(1.0, -2.0, 6))
        return mbs.AddMarker(MarkerKinematicTreeRigid(objectNumber=tree, linkNumber=5, localHT=local))
    if kind == "Ground":
        ground = mbs.CreateGround(referencePosition=[1, 2, 3], referenceRotationMatrix=turned(0.1, 0.2, 0.3))
        return mbs.AddMarker(MarkerBodyRigid(bodyNumber=ground, localHT=local))
    planar = kind == "Planar"
    body = mbs.CreateRigidBody(
        inertia=DISC,
        referencePosition=[1, 2, 0 if planar else 3],
        referenceRotationMatrix=turned(0, 0, 0.8) if planar else turned(0.5, -0.4, 0.8),
        initialVelocity=[0.3, -0.5, 0 if planar else 0.7],
        initialAngularVelocity=[0, 0, 0.9] if planar else [0.4, -1.2, 0.9],
        nodeType=SPATIAL[0] if planar else SPATIAL[NAMES.index(kind)],
        create2D=planar,
        show=False,
        returnDict=True,
    )
    if kind == "Rxyz":
        return mbs.AddMarker(MarkerNodeRigid(nodeNumber=body["nodeNumber"], localHT=place(turn, [0, 0, 0])))
    return mbs.AddMarker(MarkerBodyRigid(bodyNumber=body["bodyNumber"], localHT=local))


@pytest.mark.parametrize("kind", [*NAMES, "Planar", "Tree", "Ground"])
def test_pose_and_motion_of_markers_are_the_engine_s(kind) -> None:
    """Position, axes, velocity and spin from the coordinates, against the engine's own marker; to its round-off."""
    _container, mbs = new_system()
    marker = add_marker(mbs, kind)
    attachment = find_attachment(mbs, marker)
    mbs.Assemble()
    nodes, frames = list_nodes([attachment]), stack_frames([attachment])
    states = [
        np.concatenate([mbs.GetNodeOutput(node, each) for node in nodes] or [np.zeros(0)])
        for each in (KINDS.CoordinatesTotal, KINDS.Coordinates_t)
    ]
    linear, angular = np.full((2, 3, len(states[0])), np.nan)
    origin, body = locate_body(frames, 0, states[0], linear, angular)
    axes = np.column_stack(body)
    arm = axes @ attachment.position
    spin = angular @ states[1]
    found = {
        KINDS.Position: np.array(origin) + arm,
        KINDS.RotationMatrix: (axes @ attachment.rotation).ravel(),
        KINDS.Velocity: linear @ states[1] + np.cross(spin, arm),
        KINDS.AngularVelocity: spin,
    }
    for quantity, value in found.items():
        # Sums of a few dozen products of numbers below 4.
        np.testing.assert_allclose(value, mbs.GetMarkerOutput(marker, quantity), atol=50 * 4 * np.finfo(float).eps)


def test_general_kernel_agrees_with_the_bicycle_s() -> None:
    """The kernel for two bodies with Euler parameters is a shorter way to the same rows."""
    _container, mbs = new_system()
    bodies = [
        mbs.CreateRigidBody(inertia=DISC, referencePosition=[x, 0.4, 0.5], nodeType=SPATIAL[0], show=False)
        for x in (0.5, 1.5)
    ]
    attachments = [find_attachment(mbs, body) for body in bodies]
    joint = CreateRollingJointOnSurface(
        mbs, bodyNumbers=bodies, axisPosition=[0, 0.1, 0], axisVector=[0.1, 1, 0], discRadius=0.3, surface=Paraboloid(1)
    )
    bowl = Paraboloid(0.2)
    where = (rim_search(bowl, joint.radii), bowl.function.real, bowl.parameters)
    start = reference_coordinates(mbs, list_nodes(attachments))
    random = np.random.default_rng(1)
    state = np.stack([start + 0.1 * random.normal(size=14), random.normal(size=14)])
    scale, results = np.array([0.7]), []
    for general_one in (True, False):
        rows, values = np.zeros((6, 14)), np.zeros((2, 6))
        if general_one:
            shape = (joint.frames, joint.triads, joint.radii, joint.order)
            next(general.attached_constraints(state, *shape, *where, scale, rows, values))
        else:
            shape = (joint.frames.positions[:-1], joint.triads, joint.radii)
            next(kernel.constraints(state.reshape(4, 7), *shape, *where, scale, rows, values))
        assert np.all(np.isfinite(values))
        results.append((rows, values))
    np.testing.assert_allclose(results[0][0], results[1][0], atol=1e-14)
    np.testing.assert_allclose(results[0][1], results[1][1], atol=1e-13)


@pytest.mark.parametrize("kind", ["Rxyz", "Planar", "Tree"])
def test_normal_row_is_the_gap_s_gradient(kind) -> None:
    """Central differences of the gap, on ground fixed to a body or a tree and to the wheel's, in every coordinate."""
    _container, mbs = new_system()
    wheel = mbs.CreateRigidBody(inertia=DISC, referencePosition=[1.3, 2.2, 3.1], nodeType=SPATIAL[1], show=False)
    ground = add_marker(mbs, kind)
    attachments = [find_attachment(mbs, wheel), find_attachment(mbs, ground)]
    frames, start = stack_frames(attachments), reference_coordinates(mbs, list_nodes(attachments))
    bowl, radii = Paraboloid(0.2), np.array([0.3])
    where = (rim_search(bowl, radii), bowl.function.real, bowl.parameters)
    triads = np.array([turned(0.2, 0.3, 0.4)])

    def rows_and_gap(q: np.ndarray) -> tuple[np.ndarray, float]:
        rows, values = np.zeros((3, len(q))), np.zeros((2, 3))
        state, order = np.stack([q, np.zeros(len(q))]), np.array([[0, 1, 2]])
        next(general.attached_constraints(state, frames, triads, radii, order, *where, np.ones(1), rows, values))
        return rows, values[0, 2]

    rows, gap = rows_and_gap(start)
    assert abs(gap) > 0.05  # so that the lever arms of gap and contact differ
    away = 1e-5
    for j, column in enumerate(np.eye(len(start))):
        slope = (rows_and_gap(start + away * column)[1] - rows_and_gap(start - away * column)[1]) / (2 * away)
        # Third derivatives are some ten times the arms of a few metres; round-off of 1e-15 over the difference.
        assert rows[2, j] == pytest.approx(slope, abs=100 * away**2 + 1e-15 * 10 / away)


def add_coin(mbs: Any, node: Any) -> Any:
    """A leaning coin that rolls along x and turns; its axle is the body's z axis, where angles may turn freely."""
    forward, left = np.array([1.0, 0.0, 0.0]), np.array([0.0, math.cos(0.1), math.sin(0.1)])
    up = np.cross(forward, left)
    spin = 12.0 * left + np.array([0.0, 0.0, 0.5])
    return mbs.CreateRigidBody(
        inertia=DISC,
        referencePosition=0.2 * up,
        referenceRotationMatrix=np.column_stack([up, forward, left]),
        initialVelocity=np.cross(spin, 0.2 * up),
        initialAngularVelocity=spin,
        gravity=[0, 0, -9.81],
        nodeType=node,
        show=False,
    )


def roll_coin(node: Any, step: float, own: bool) -> tuple[np.ndarray, np.ndarray]:
    """Final centre and local contact force on the plane, with the suite's joint or the engine's own disc."""
    _container, mbs = new_system()
    coin = add_coin(mbs, node)
    if own:
        joint = CreateRollingJointOnSurface(
            mbs, bodyNumbers=[coin], axisVector=[0, 0, 1], discRadius=0.2, surface=Plane()
        ).objectNumber
        kind, sign = KINDS.Force, -1
    else:
        joint = mbs.CreateRollingDisc(
            bodyNumbers=[mbs.CreateGround(), coin],
            axisPosition=[0, 0, 0],
            axisVector=[0, 0, 1],
            discRadius=0.2,
            show=False,
        )
        kind, sign = KINDS.ForceLocal, 1
    force = mbs.AddSensor(SensorObject(objectNumber=joint, outputVariableType=kind, storeInternal=True))
    place_sensor = mbs.AddSensor(SensorBody(bodyNumber=coin, outputVariableType=KINDS.Position, storeInternal=True))
    for sensor in (force, place_sensor):
        mbs.SetSensorParameter(sensor, "writeToFile", False)
    mbs.Assemble()
    with no_progress():
        mbs.SolveDynamic(settings(step, 0.4))
    return mbs.GetSensorStoredData(place_sensor)[-1, 1:], sign * mbs.GetSensorStoredData(force)[-1, 1:]


@pytest.mark.parametrize("node", SPATIAL, ids=NAMES)
def test_every_node_rolls_as_on_the_engine_s_own_disc(node) -> None:
    """On the plane both are right to order two, so their difference falls by four, and that of the forces with h^2."""
    step = 2e-3
    apart = []
    for each in (step, step / 2):
        (centre, force), (other, other_force) = (roll_coin(node, each, own) for own in (True, False))
        apart.append((np.linalg.norm(centre - other), np.linalg.norm(force - other_force)))
        # A turn by k h a step is wrong by (k h)^2 / 12 of the way and of the force, in each of the two.
        error = 2 * (12 * each) ** 2 / 12
        assert apart[-1][0] < error * 12 * 0.2 * 0.4
        assert apart[-1][1] < error * np.linalg.norm(force)
    next_order = 12 * step
    assert apart[0][0] / apart[1][0] == pytest.approx(4, rel=next_order)


def test_ground_at_another_place_moves_the_ride_with_it() -> None:
    """A bowl on a ground object that is moved and turned about z, and all that rolls in it with it."""
    shift, turn = np.array([1.0, -2.0, 0.5]), turned(0, 0, 0.7)
    centres = []
    for moved in (False, True):
        _container, mbs = new_system()
        ground = mbs.CreateGround(referencePosition=shift, referenceRotationMatrix=turn) if moved else None
        motion = EXAMPLE.steady_precession(2.0, 0.5)
        height = 0.2 * 2.0**2
        sine, cosine = math.sin(0.5), math.cos(0.5)
        axes = np.column_stack([[0.0, 1.0, 0.0], [-cosine, 0.0, -sine], [-sine, 0.0, cosine]])
        spin = motion.rate * np.array([0.0, 0.0, 1.0]) + motion.spin * axes[:, 1] + 0.5 * axes[:, 0]
        arm = EXAMPLE.RADIUS * axes[:, 2]
        carry = turn if moved else np.eye(3)
        disc = mbs.CreateRigidBody(
            inertia=EXAMPLE.INERTIA,
            referencePosition=carry @ (np.array([2.0, 0.0, height]) + arm) + moved * shift,
            referenceRotationMatrix=carry @ axes,
            initialVelocity=carry @ np.cross(spin, arm),
            initialAngularVelocity=carry @ spin,
            gravity=[0, 0, -9.81],
            nodeType=SPATIAL[0],
            show=False,
        )
        CreateRollingJointOnSurface(
            mbs,
            bodyNumbers=[disc],
            axisVector=[0, 1, 0],
            discRadius=EXAMPLE.RADIUS,
            surface=EXAMPLE.BOWL,
            groundNumber=ground,
        )
        mbs.Assemble()
        with no_progress():
            mbs.SolveDynamic(settings(2e-3, 0.3))
        centre = mbs.GetObjectOutputBody(disc, KINDS.Position, [0, 0, 0])
        centres.append(carry.T @ (centre - moved * shift))
    # Newton's method leaves 1e-11 of the weight of 150 N as metres, in 150 steps.
    np.testing.assert_allclose(centres[1], centres[0], atol=1e-11 * 150 * 150)


def steady_rate(turn: float, distance: float, lean: float) -> float:
    """Rate of a steady precession on ground that turns about z, from the example's equations.

    The disc rolls relative to the ground, s = (W - turn) r / a, so the moments require
    W^2 cos L ((I - J) sin L + m a (r - a sin L)) + W (W - turn) cos L J r / a = m g a sin L.
    """
    mass, across, axial = EXAMPLE.INERTIA.Mass(), EXAMPLE.INERTIA.InertiaCOM()[0, 0], EXAMPLE.INERTIA.InertiaCOM()[1, 1]
    sine, cosine, radius = math.sin(lean), math.cos(lean), EXAMPLE.RADIUS
    rolling = cosine * axial * distance / radius
    square = cosine * ((across - axial) * sine + mass * radius * (distance - radius * sine)) + rolling
    return float(np.roots([square, -turn * rolling, -mass * EXAMPLE.GRAVITY * radius * sine]).max())


@pytest.mark.parametrize("carrier", ["tree", "planar"])
def test_precession_on_a_turning_bowl(carrier) -> None:
    """The equations of `steady_rate`, on a bowl that turns freely: no moment about its axis slows it down."""
    turn, distance, lean, duration = 0.8, 2.0, 0.5, 0.5
    rate = steady_rate(turn, distance, lean)
    motion = EXAMPLE.Precession(distance, lean, rate, (rate - turn) * distance / EXAMPLE.RADIUS, np.zeros(3))
    assert abs(rate / steady_rate(0.0, distance, lean) - 1) > 0.05
    errors = []
    for step in (2e-3, 1e-3):
        _container, mbs = new_system()
        if carrier == "tree":
            node = mbs.AddNode(
                NodeGenericODE2(
                    numberOfODE2Coordinates=1,
                    referenceCoordinates=[0.0],
                    initialCoordinates=[0.0],
                    initialCoordinates_t=[turn],
                )
            )
            tree = mbs.AddObject(
                ObjectKinematicTree(
                    nodeNumber=node,
                    jointTypes=[LIBRARY.JointType.RevoluteZ],
                    linkParents=[-1],
                    jointTransformations=LIBRARY.Matrix3DList([np.eye(3)]),
                    jointOffsets=LIBRARY.Vector3DList([np.zeros(3)]),
                    linkInertiasCOM=LIBRARY.Matrix3DList([np.eye(3)]),
                    linkCOMs=LIBRARY.Vector3DList([np.zeros(3)]),
                    linkMasses=[1.0],
                )
            )
            ground = mbs.AddMarker(MarkerKinematicTreeRigid(objectNumber=tree, linkNumber=0))
        else:
            ground = mbs.CreateRigidBody(
                inertia=RigidBodyInertia(mass=1, inertiaTensor=np.eye(3)),
                initialAngularVelocity=[0, 0, turn],
                create2D=True,
                show=False,
            )
            post = mbs.AddMarker(MarkerBodyPosition(bodyNumber=ground))
            fixed = mbs.AddMarker(MarkerBodyPosition(bodyNumber=mbs.CreateGround()))
            mbs.AddObject(ObjectJointSpherical(markerNumbers=[fixed, post], constrainedAxes=[1, 1, 0]))
        disc = EXAMPLE.add_disc(mbs, motion, 0.0, EXAMPLE.BOWL)
        # The example lets the disc roll on ground at rest; here the contact moves with the bowl.
        carried = np.cross([0, 0, turn], [distance, 0, 0])
        node_number = mbs.GetObject(disc)["nodeNumber"]
        rates = np.array(mbs.GetNode(node_number)["initialVelocities"])
        rates[:3] += carried
        mbs.SetNodeParameter(node_number, "initialVelocities", rates)
        joint = CreateRollingJointOnSurface(
            mbs,
            bodyNumbers=[disc],
            axisVector=[0, 1, 0],
            discRadius=EXAMPLE.RADIUS,
            surface=EXAMPLE.BOWL,
            groundNumber=ground,
        )
        gap = CreateRollingJointSensor(mbs, joint, "Gap")
        mbs.Assemble()
        with no_progress():
            mbs.SolveDynamic(settings(step, duration))
        # Newton's method leaves 1e-11 of the weight of 150 N as metres.
        assert np.abs(mbs.GetSensorStoredData(gap)[:, 1]).max() < 1e-11 * 150
        centre = mbs.GetObjectOutputBody(disc, KINDS.Position, [0, 0, 0])
        circle, angle = distance - EXAMPLE.RADIUS * math.sin(lean), rate * duration
        errors.append(np.linalg.norm(centre[:2] - circle * np.array([math.cos(angle), math.sin(angle)])))
    spin = motion.spin * 2e-3
    assert errors[0] / errors[1] == pytest.approx(4, rel=spin)
    assert errors[1] < (spin / 2) ** 2 / 12 * motion.spin * EXAMPLE.RADIUS


def test_reaction_acts_on_the_ground_s_body() -> None:
    """A bowl that slides and turns freely on the level: momentum and energy of bowl and disc are kept."""
    mass, moment = 40, 30.0
    drifts = []
    for step in (2e-3, 1e-3):
        _container, mbs = new_system()
        bowl = mbs.CreateRigidBody(
            inertia=RigidBodyInertia(mass=mass, inertiaTensor=moment * np.eye(3)), create2D=True, show=False
        )
        disc = EXAMPLE.add_disc(mbs, EXAMPLE.steady_precession(2.0, 0.5), 0.0, EXAMPLE.BOWL)
        joint = CreateRollingJointOnSurface(
            mbs,
            bodyNumbers=[disc],
            axisVector=[0, 1, 0],
            discRadius=EXAMPLE.RADIUS,
            surface=EXAMPLE.BOWL,
            groundNumber=bowl,
        )
        slip = CreateRollingJointSensor(mbs, joint, "Slip")
        nodes = [mbs.GetObject(body)["nodeNumber"] for body in (bowl, disc)]
        kinds = (KINDS.Position, KINDS.Velocity, KINDS.AngularVelocity, KINDS.AngularVelocityLocal)
        sensors = [
            [
                mbs.AddSensor(
                    SensorNode(nodeNumber=node, outputVariableType=kind, storeInternal=True, writeToFile=False)
                )
                for kind in kinds
            ]
            for node in nodes
        ]
        mbs.Assemble()
        with no_progress():
            mbs.SolveDynamic(settings(step, 1.0))
        (place_b, velocity_b, spin_b, _), (place_d, velocity_d, _, local) = (
            [mbs.GetSensorStoredData(sensor)[:, 1:] for sensor in each] for each in sensors
        )
        weight = EXAMPLE.INERTIA.Mass()
        assert np.abs(mbs.GetSensorStoredData(slip)[:, 1:]).max() < 1e-11 * weight * 9.81 * 10
        assert np.abs(velocity_b[-1] - velocity_b[0]).max() > 0.1  # the bowl has been pushed
        momentum = mass * velocity_b[:, :2] + weight * velocity_d[:, :2]
        energy = 0.5 * mass * np.sum(velocity_b**2, axis=1) + 0.5 * moment * spin_b[:, 2] ** 2
        energy += 0.5 * weight * np.sum(velocity_d**2, axis=1) + weight * 9.81 * place_d[:, 2]
        energy += 0.5 * np.sum(local**2 @ EXAMPLE.INERTIA.InertiaCOM(), axis=1)
        drifts.append((np.abs(momentum - momentum[0]).max(), np.abs(energy / energy[0] - 1).max()))
        assert np.all(np.isfinite(place_b))
    # Forces on both bodies are opposite in every step, so what is lost is what Newton's method leaves.
    assert drifts[1][0] < 1e-11 * EXAMPLE.INERTIA.Mass() * 9.81 * 1000
    assert drifts[0][1] / drifts[1][1] == pytest.approx(4, rel=0.1)


def test_wheelset_needs_one_lateral_constraint_only() -> None:
    """Two wheels of one body: their lateral rows are the same, and without one of them the body rolls straight."""
    _container, mbs = new_system()
    body = mbs.CreateRigidBody(
        inertia=DISC,
        referencePosition=[0, 0, 0.2],
        initialVelocity=[2, 0, 0],
        initialAngularVelocity=[0, 10, 0],
        gravity=[0, 0, -9.81],
        referenceRotationMatrix=turned(-math.pi / 2, 0, 0),
        nodeType=SPATIAL[1],
        show=False,
    )
    joints = [
        CreateRollingJointOnSurface(
            mbs,
            bodyNumbers=[body, body],
            axisPosition=[[0, 0, 0.5], [0, 0, -0.5]],
            axisVector=[0, 0, 1],
            discRadius=0.2,
            surface=Plane(),
            constrainedAxes=flags,
            activeConnector=active,
        )
        for flags, active in (([1, 1, 1], False), ([[1, 1, 1], [0, 1, 1]], True))
    ]
    forces = [CreateRollingJointSensor(mbs, joints[1], "ContactForce", wheel=wheel) for wheel in range(2)]
    mbs.Assemble()
    start = reference_coordinates(mbs, joints[0].nodeNumbers).tolist()
    for joint in joints:
        jacobian = mbs.GetObject(joint.objectNumber)["jacobianUserFunction"]["function"]
        assert np.linalg.matrix_rank(jacobian(mbs, 0.0, 0, start, [0.0] * 6, False)) == 5
    with no_progress():
        mbs.SolveDynamic(settings(1e-3, 0.1))
    # What Newton's method leaves of the weight of 50 N, in 100 steps.
    end = mbs.GetObjectOutputBody(body, KINDS.Position, [0, 0, 0])
    np.testing.assert_allclose(end, [0.2, 0, 0.2], atol=1e-11 * 50 * 100)
    half = DISC.Mass() * 9.81 / 2
    for force in forces:
        np.testing.assert_allclose(mbs.GetSensorStoredData(force)[-1, 1:], [0, 0, half], atol=1e-6 * half)


def test_joints_that_cannot_be_are_refused() -> None:
    _container, mbs = new_system()
    bodies = [mbs.CreateRigidBody(inertia=DISC, nodeType=SPATIAL[0], show=False) for _ in range(3)]
    ground = mbs.CreateGround()
    tree = add_tree(mbs, ["RevoluteX", "RevoluteZ"], [-1, 0], [0, 0], [0, 0])
    links = [mbs.AddMarker(MarkerKinematicTreeRigid(objectNumber=tree, linkNumber=1)) for _ in range(2)]
    point = mbs.CreateMassPoint(mass=1.0, show=False)
    refused: list[tuple[dict[str, Any], str]] = [
        ({"bodyNumbers": bodies}, "belong to 3 nodes"),
        ({"groundNumber": bodies[2], "bodyNumbers": bodies[:2]}, "a joint of its own"),
        ({"bodyNumbers": [ground]}, "all fixed"),
        ({"groundNumber": bodies[0]}, "wheel 0 .body 0. is fixed to the body or link"),
        ({"groundNumber": links[0], "bodyNumbers": [links[1]]}, "wheel 0 .marker 1. is fixed to the body or link"),
        ({"groundNumber": ground, "bodyNumbers": [bodies[0], ground]}, "wheel 1 .body 3. is fixed"),
        ({"bodyNumbers": [tree]}, "MarkerKinematicTreeRigid, which names its link"),
        ({"bodyNumbers": [point]}, "is a MassPoint"),
        ({"bodyNumbers": [mbs.AddMarker(MarkerBodyPosition(bodyNumber=bodies[0]))]}, "is a MarkerBodyPosition"),
        ({"bodyNumbers": [LIBRARY.NodeIndex(mbs.GetObject(tree)["nodeNumber"])]}, "has a NodeGenericODE2"),
        ({"constrainedAxes": [1, 1]}, "must be three flags"),
        ({"constrainedAxes": [1, 2, 1]}, "must be three flags"),
        ({"constrainedAxes": [0, 0, 0]}, "leaves out all constraints"),
        ({"axisPosition": [0, 0]}, "axisPosition is"),
        ({"axisPosition": [[0, 0, 0], [0, 0, 1]]}, "for all wheels or for each"),
    ]
    for change, complaint in refused:
        arguments: dict[str, Any] = {"bodyNumbers": bodies[:1], "discRadius": 0.2, "surface": Plane()}
        with pytest.raises(ValueError, match=complaint):
            CreateRollingJointOnSurface(mbs, **(arguments | change))
