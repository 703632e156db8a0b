"""The same vehicles as one kinematic tree of Exudyn: `python examples/rolling/exudyn_tree.py`.

The base has three prismatic joints along the inertial axes and three revolute joints: yaw, lean and pitch. Every hinge
is one revolute joint more. So the rolling constraints are the only ones, and all wheels belong to one node: one rolling
joint holds them all.
"""

from __future__ import annotations

import math
from typing import Any

import exudyn as exu
import numpy as np
from exudyn.itemInterface import (
    MarkerKinematicTreeRigid,
    NodeGenericODE2,
    ObjectKinematicTree,
    SensorKinematicTree,
    VObjectKinematicTree,
)
from exudyn_vehicles import VehicleRide, ride_vehicle, solver_settings, total_energy
from vehicles import GRAVITY, Vehicle, make_tandem

from velodrome.engines.exudyn.joint import CreateRollingJointOnSurface
from velodrome.engines.exudyn.sensor import CreateRollingJointSensor

_exu: Any = exu
_BASE_JOINTS = ("PrismaticX", "PrismaticY", "PrismaticZ", "RevoluteZ", "RevoluteX", "RevoluteY")


def link_axes(axis: np.ndarray) -> np.ndarray:
    """Return a rotation matrix whose z axis is a unit axis."""
    other = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = np.cross(other, axis)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(axis, x), axis])


def base_angles(rotation: np.ndarray) -> np.ndarray:
    """Return yaw, lean and pitch of a rotation: about z, then the turned x, then the turned y."""
    lean = math.asin(rotation[2, 1])
    return np.array(
        [
            math.atan2(-rotation[0, 1], rotation[1, 1]),
            lean,
            math.atan2(-rotation[2, 0], rotation[2, 2]),
        ]
    )


def base_rates(vehicle: Vehicle, angles: np.ndarray) -> np.ndarray:
    """Return the rates of yaw, lean and pitch of the base."""
    base = vehicle.bodies[0]
    course = np.array([math.cos(angles[0]), math.sin(angles[0]), 0.0])
    axes = np.column_stack([[0.0, 0.0, 1.0], course, base.rotation[:, 1]])
    return np.linalg.solve(axes, base.spin)


def add_tree(mbs: Any, vehicle: Vehicle) -> tuple[Any, list[np.ndarray]]:
    """Add a vehicle as a kinematic tree; return its object and the rotations from the links' axes to the bodies'."""
    base, bodies = vehicle.bodies[0], vehicle.bodies
    angles = base_angles(base.rotation)
    rates = [*base.velocity, *base_rates(vehicle, angles)]
    turns, offsets = [np.eye(3)] * 6, [np.zeros(3)] * 6
    origins, axes = [base.position], [base.rotation]  # of the bodies' links at the start
    parents = [-1, 0, 1, 2, 3, 4]
    for hinge in vehicle.hinges:
        parent = vehicle.number(hinge.parent)
        origins.append(hinge.point)
        axes.append(link_axes(hinge.axis))
        parents.append(5 + parent)
        turns.append(axes[parent].T @ axes[-1])
        offsets.append(axes[parent].T @ (hinge.point - origins[parent]))
        rates.append(hinge.axis @ (bodies[vehicle.number(hinge.body)].spin - bodies[parent].spin))
    to_body = [body.rotation.T @ link for body, link in zip(bodies, axes, strict=True)]
    count = len(vehicle.hinges)
    node = mbs.AddNode(
        NodeGenericODE2(
            numberOfODE2Coordinates=6 + count,
            referenceCoordinates=[*base.position, *angles, *[0.0] * count],
            initialCoordinates=[0.0] * (6 + count),
            initialCoordinates_t=rates,
        )
    )
    centres = [link.T @ (body.position - origin) for body, link, origin in zip(bodies, axes, origins, strict=True)]
    inertias = [turn.T @ body.inertia @ turn for body, turn in zip(bodies, to_body, strict=True)]
    types = [*_BASE_JOINTS, *["RevoluteZ"] * count]
    tree = mbs.AddObject(
        ObjectKinematicTree(
            nodeNumber=node,
            gravity=[0.0, 0.0, -GRAVITY],
            jointTypes=[getattr(_exu.JointType, name) for name in types],
            linkParents=parents,
            jointTransformations=_exu.Matrix3DList(turns),
            jointOffsets=_exu.Vector3DList(offsets),
            linkInertiasCOM=_exu.Matrix3DList([np.zeros((3, 3))] * 5 + inertias),
            linkCOMs=_exu.Vector3DList([np.zeros(3)] * 5 + centres),
            linkMasses=[0.0] * 5 + [body.mass for body in bodies],
            visualization=VObjectKinematicTree(show=False),
        )
    )
    return tree, to_body


def ride_tree(vehicle: Vehicle, step: float, duration: float) -> VehicleRide:
    """Ride a vehicle as a kinematic tree from its start."""
    container: Any = exu.SystemContainer()
    mbs = container.AddSystem()
    tree, to_body = add_tree(mbs, vehicle)
    centres = mbs.GetObject(tree)["linkCOMs"]
    kinds = [_exu.OutputVariableType.Position, _exu.OutputVariableType.Velocity]
    kinds.append(_exu.OutputVariableType.AngularVelocityLocal)
    options: Any = {"objectNumber": tree, "storeInternal": True, "writeToFile": False}
    motion = [
        [
            mbs.AddSensor(
                SensorKinematicTree(linkNumber=5 + i, localPosition=centres[5 + i], outputVariableType=kind, **options)
            )
            for i in range(len(vehicle.bodies))
        ]
        for kind in kinds
    ]
    numbers = [vehicle.number(wheel.body) for wheel in vehicle.wheels]
    joint = CreateRollingJointOnSurface(
        mbs,
        bodyNumbers=[
            mbs.AddMarker(MarkerKinematicTreeRigid(objectNumber=tree, linkNumber=5 + i, localPosition=centres[5 + i]))
            for i in numbers
        ],
        axisVector=[to_body[i][1] for i in numbers],  # the bodies' y axes in the links' axes
        discRadius=[wheel.radius for wheel in vehicle.wheels],
        surface=vehicle.surface,
        constrainedAxes=[wheel.constrained for wheel in vehicle.wheels],
    )
    wheels = [
        {name: CreateRollingJointSensor(mbs, joint, name, wheel=i) for name in ("ContactForce", "Gap", "Slip")}
        for i in range(len(numbers))
    ]
    mbs.Assemble()
    mbs.SolveDynamic(solver_settings(step, duration))

    def samples(sensors: list[Any]) -> np.ndarray:
        return np.stack([mbs.GetSensorStoredData(sensor)[:, 1:] for sensor in sensors], axis=1)

    position, velocity, spin = (samples(sensors) for sensors in motion)
    spin = np.einsum("bij,nbj->nbi", np.array(to_body), spin)
    force, gap, slip = (samples([wheel[name] for wheel in wheels]) for name in wheels[0])
    time = mbs.GetSensorStoredData(motion[0][0])[:, 0]
    return VehicleRide(time, position, force, gap[..., 0], slip, total_energy(vehicle, position, velocity, spin))


def main() -> None:
    """Print how far the tandem as a tree is from the tandem of single bodies at two steps, which halves by four."""
    vehicle = make_tandem()
    for step in (2e-3, 1e-3):
        tree, bodies = ride_tree(vehicle, step, 2.0), ride_vehicle(vehicle, step, 2.0)
        apart = np.abs(tree.position - bodies.position).max()
        drift = np.abs(tree.energy / tree.energy[0] - 1).max()
        print(f"step {step:g} s: apart by {apart:.2e} m, energy of the tree within {drift:.1e}")


if __name__ == "__main__":
    main()
