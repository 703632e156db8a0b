"""Vehicles in plain Exudyn with the suite's rolling joint: `python examples/rolling/exudyn_vehicles.py`.

Every body is a rigid body of the library, every hinge its revolute joint, and every wheel has a joint of its own.
Redundant rows are left out by the joint's `constrainedAxes`. The script rides a tricycle on the exact circle of its
wheels, a cart and a tandem in bowls, at three steps each.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import exudyn as exu
import numpy as np
from exudyn.itemInterface import SensorBody
from exudyn.rigidBodyUtilities import RigidBodyInertia
from vehicles import GRAVITY, Vehicle, find_tricycle_positions, make_cart, make_tandem, make_tricycle

from velodrome.engines.exudyn.joint import CreateRollingJointOnSurface
from velodrome.engines.exudyn.sensor import CreateRollingJointSensor

_exu: Any = exu
_make_inertia: Any = RigidBodyInertia  # whose annotation asks for a whole number of kilograms
EULER_PARAMETERS = _exu.NodeType.RotationEulerParameters
SAMPLE_INTERVAL = 0.01


@dataclass(frozen=True)
class VehicleRide:
    """Samples of a ride: times (n,); of b bodies position (n, b, 3); of k wheels force (n, k, 3), gap and slip.

    `gap` is (n, k), `slip` (n, k, 2) lateral and forward, and `energy` (n,), kinetic and potential.
    """

    time: np.ndarray
    position: np.ndarray
    force: np.ndarray
    gap: np.ndarray
    slip: np.ndarray
    energy: np.ndarray


def add_vehicle(mbs: Any, vehicle: Vehicle, node_type: Any = EULER_PARAMETERS) -> list[Any]:
    """Add the bodies and hinges of a vehicle to an Exudyn model; return the bodies' object numbers."""
    bodies = [
        mbs.CreateRigidBody(
            name=body.name,
            inertia=_make_inertia(mass=body.mass, inertiaTensor=body.inertia),
            referencePosition=body.position,
            referenceRotationMatrix=body.rotation,
            initialVelocity=body.velocity,
            initialAngularVelocity=body.spin,
            gravity=[0.0, 0.0, -GRAVITY],
            nodeType=node_type,
            show=False,
        )
        for body in vehicle.bodies
    ]
    for hinge in vehicle.hinges:
        pair = [bodies[vehicle.number(hinge.parent)], bodies[vehicle.number(hinge.body)]]
        mbs.CreateRevoluteJoint(itemNumbers=pair, position=hinge.point, axis=hinge.axis, show=False)
    return bodies


def roll_wheels(mbs: Any, vehicle: Vehicle, bodies: list[Any], ground: Any = None) -> list[dict[str, Any]]:
    """Put each wheel on a rolling joint; return the sensors of its force, gap and slip."""
    sensors = []
    for wheel in vehicle.wheels:
        joint = CreateRollingJointOnSurface(
            mbs,
            bodyNumbers=[bodies[vehicle.number(wheel.body)]],
            axisVector=[0, 1, 0],
            discRadius=wheel.radius,
            surface=vehicle.surface,
            constrainedAxes=wheel.constrained,
            groundNumber=ground,
        )
        quantities = ("ContactForce", "Gap", "Slip")
        sensors.append({each: CreateRollingJointSensor(mbs, joint, each) for each in quantities})
    return sensors


def solver_settings(step: float, duration: float) -> Any:
    """Return settings for generalized alpha, without files and messages."""
    settings: Any = exu.SimulationSettings()
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = SAMPLE_INTERVAL
    settings.linearSolver.solverType = _exu.LinearSolverType.EigenDense
    settings.timeIntegration.verboseMode = 0
    settings.timeIntegration.numberOfSteps = round(duration / step)
    settings.timeIntegration.endTime = duration
    settings.timeIntegration.adaptiveStep = False
    settings.timeIntegration.generalizedAlpha.spectralRadius = 0.8
    settings.timeIntegration.newton.useModifiedNewton = True
    settings.timeIntegration.newton.relativeTolerance = 1e-11
    return settings


def ride_vehicle(vehicle: Vehicle, step: float, duration: float, node_type: Any = EULER_PARAMETERS) -> VehicleRide:
    """Ride a vehicle from its start; all bodies' nodes are of one type."""
    container: Any = exu.SystemContainer()
    mbs = container.AddSystem()
    bodies = add_vehicle(mbs, vehicle, node_type)
    kinds = [_exu.OutputVariableType.Position, _exu.OutputVariableType.Velocity]
    kinds.append(_exu.OutputVariableType.AngularVelocityLocal)
    motion = [
        [
            mbs.AddSensor(SensorBody(bodyNumber=body, outputVariableType=kind, storeInternal=True, writeToFile=False))
            for body in bodies
        ]
        for kind in kinds
    ]
    wheels = roll_wheels(mbs, vehicle, bodies)
    mbs.Assemble()
    mbs.SolveDynamic(solver_settings(step, duration))

    def samples(sensors: list[Any]) -> np.ndarray:
        return np.stack([mbs.GetSensorStoredData(sensor)[:, 1:] for sensor in sensors], axis=1)

    position, velocity, spin = (samples(sensors) for sensors in motion)
    force, gap, slip = (samples([wheel[name] for wheel in wheels]) for name in wheels[0])
    time = mbs.GetSensorStoredData(motion[0][0])[:, 0]
    return VehicleRide(time, position, force, gap[..., 0], slip, total_energy(vehicle, position, velocity, spin))


def total_energy(vehicle: Vehicle, position: np.ndarray, velocity: np.ndarray, spin: np.ndarray) -> np.ndarray:
    """Return kinetic and potential energy (n,) [J]; ``spin`` is in the bodies' axes."""
    energy = np.zeros(len(position))
    for i, body in enumerate(vehicle.bodies):
        energy += body.mass * (0.5 * np.sum(velocity[:, i] ** 2, axis=1) + GRAVITY * position[:, i, 2])
        energy += 0.5 * np.einsum("ni,ij,nj->n", spin[:, i], body.inertia, spin[:, i])
    return energy


def main() -> None:
    """Print errors of position, the drift of energy, and the largest gap and slip, at three steps.

    The tricycle's error is that against its closed form; those of the others follow from half the step, at order two.
    """
    _exu.config.printToConsole = False  # the engine's remarks on memory
    print(f"{'vehicle':10}{'step':>8}{'position [m]':>14}{'energy':>9}{'gap [m]':>9}{'slip [m/s]':>12}")
    for name, vehicle, duration in (
        ("tricycle", make_tricycle(), 1.0),
        ("cart", make_cart(), 2.0),
        ("tandem", make_tandem(), 2.0),
    ):
        held = np.array([wheel.constrained[:2] for wheel in vehicle.wheels])
        finer = ride_vehicle(vehicle, 2.5e-4, duration)
        for step in (5e-4, 1e-3, 2e-3):
            found = ride_vehicle(vehicle, step, duration)
            if name == "tricycle":
                error = np.abs(found.position[-1] - find_tricycle_positions(vehicle, duration)).max()
            else:
                error = 4 / 3 * np.abs(found.position[-1] - finer.position[-1]).max()
            finer = found
            drift, gap = np.abs(found.energy / found.energy[0] - 1).max(), np.abs(found.gap).max()
            print(f"{name:10}{step:8g}{error:14.2e}{drift:9.1e}{gap:9.0e}{np.abs(found.slip[:, held]).max():12.0e}")


if __name__ == "__main__":
    main()
