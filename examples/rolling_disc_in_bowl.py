"""A disc rolling in a bowl, in plain Exudyn with one rolling joint: `python examples/rolling_disc_in_bowl.py`.

Steady precession: the disc's centre circles the bowl's axis at the rate W, at a constant lean L towards the
axis. With e_r outward, e_t forward and e_z up, the disc's upward axis is u = -sin L e_r + cos L e_z, its
axle b = -cos L e_r - sin L e_z (to the left), and the contact P = C - a u is at a distance r from the
axis. Its angular velocity is W e_z + s b. For mass m, radius a, and moments of inertia I about a diameter and J
about the axle, the equations are

    rolling           v_C + w x (P - C) = 0                 so  s = W r / a
    forces            m v_C' = F - m g e_z                  so  F = -m W^2 (r - a sin L) e_r + m g e_z
    moments about C   W e_z x (I W cos L u + J (s - W sin L) b) = (P - C) x F

whose forward component is

    W^2 cos L ((I - J) sin L + J r / a + m a (r - a sin L)) = m g a sin L.

The surface enters only through the height of P, the point of the disc that is closest to it.
The script starts the disc in that motion and, a second time, with a kick, and shows that halving the
step divides all errors by four.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import exudyn as exu
import numpy as np
from exudyn.itemInterface import SensorBody
from exudyn.rigidBodyUtilities import InertiaCylinder

from velodrome.engines.exudyn.joint import CreateRollingJointOnSurface
from velodrome.engines.exudyn.sensor import CreateRollingJointSensor
from velodrome.reference.surface import Paraboloid, Surface, evaluate

GRAVITY = 9.81
RADIUS = 0.3
INERTIA = InertiaCylinder(density=2700, length=0.02, outerRadius=RADIUS, axis=1)
BOWL = Paraboloid(0.2)


@dataclass(frozen=True)
class Precession:
    """A steady precession: rate of the circle and spin [rad/s], force on the disc in (e_r, e_t, e_z) [N]."""

    distance: float
    lean: float
    rate: float
    spin: float
    force: np.ndarray


def steady_precession(distance: float, lean: float) -> Precession:
    """Solve the equations above for the rate, at a contact's distance r from the axis [m] and a lean [rad]."""
    mass, across, axial = INERTIA.Mass(), INERTIA.InertiaCOM()[0, 0], INERTIA.InertiaCOM()[1, 1]
    sine, cosine = math.sin(lean), math.cos(lean)
    circle = distance - RADIUS * sine
    resistance = (across - axial) * sine + axial * distance / RADIUS + mass * RADIUS * circle
    rate = math.sqrt(mass * GRAVITY * RADIUS * sine / (cosine * resistance))
    force = np.array([-mass * rate**2 * circle, 0.0, mass * GRAVITY])
    return Precession(distance, lean, rate, rate * distance / RADIUS, force)


@dataclass(frozen=True)
class Ride:
    """Samples of a ride: times (n,), and centre, force, contact point (n, 3), gap, energy (n,), slip (n, 2)."""

    time: np.ndarray
    centre: np.ndarray
    force: np.ndarray
    point: np.ndarray
    gap: np.ndarray
    slip: np.ndarray
    energy: np.ndarray


def ride(motion: Precession, step: float, duration: float, kick: float = 0.0, surface: Surface = BOWL) -> Ride:
    """Simulate the disc from a steady precession, with a lean rate [rad/s] added about its contact."""
    container: Any = exu.SystemContainer()
    mbs = container.AddSystem()
    disc: Any = add_disc(mbs, motion, kick, surface)
    joint = CreateRollingJointOnSurface(
        mbs, bodyNumbers=[disc], axisVector=[0, 1, 0], discRadius=RADIUS, surface=surface
    )
    sensors = {
        name: CreateRollingJointSensor(mbs, joint, name) for name in ("ContactForce", "ContactPoint", "Gap", "Slip")
    }
    kinds: Any = exu.OutputVariableType
    bodies = {
        kind: mbs.AddSensor(SensorBody(bodyNumber=disc, outputVariableType=kind, storeInternal=True, writeToFile=False))
        for kind in (kinds.Position, kinds.Velocity, kinds.AngularVelocityLocal)
    }
    mbs.Assemble()
    settings: Any = exu.SimulationSettings()
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = 0.01
    settings.timeIntegration.verboseMode = 0
    settings.timeIntegration.numberOfSteps = round(duration / step)
    settings.timeIntegration.endTime = duration
    settings.timeIntegration.generalizedAlpha.spectralRadius = 0.8
    settings.timeIntegration.newton.useModifiedNewton = True
    settings.timeIntegration.newton.relativeTolerance = 1e-10
    mbs.SolveDynamic(settings)

    def samples(sensor: Any) -> np.ndarray:
        return mbs.GetSensorStoredData(sensor)[:, 1:]

    position, velocity, spin = (samples(bodies[kind]) for kind in bodies)
    force, point, gap, slip = (samples(sensor) for sensor in sensors.values())
    kinetic = 0.5 * (INERTIA.Mass() * np.sum(velocity**2, axis=1) + np.sum(spin**2 @ INERTIA.InertiaCOM(), axis=1))
    energy = kinetic + INERTIA.Mass() * GRAVITY * position[:, 2]
    time = mbs.GetSensorStoredData(sensors["Gap"])[:, 0]
    return Ride(time, position, force, point, gap[:, 0], slip, energy)


def add_disc(mbs: Any, motion: Precession, kick: float, surface: Surface) -> Any:
    """Add the disc on the x axis (e_r), rolling along y (e_t)."""
    sine, cosine = math.sin(motion.lean), math.cos(motion.lean)
    up, left = np.array([-sine, 0.0, cosine]), np.array([-cosine, 0.0, -sine])
    forward = np.array([0.0, 1.0, 0.0])
    height = evaluate(surface, np.array([motion.distance]), np.zeros(1))[0, 0]
    arm = RADIUS * up
    spin = motion.rate * np.array([0.0, 0.0, 1.0]) + motion.spin * left - kick * forward
    return mbs.CreateRigidBody(
        inertia=INERTIA,
        referencePosition=np.array([motion.distance, 0.0, height]) + arm,
        referenceRotationMatrix=np.column_stack([forward, left, up]),
        initialVelocity=np.cross(spin, arm),
        initialAngularVelocity=spin,
        gravity=[0.0, 0.0, -GRAVITY],
        nodeType=exu.NodeType.RotationEulerParameters,
        show=False,
    )


def errors(motion: Precession, found: Ride) -> tuple[float, float]:
    """Return the largest distance of the centre from the steady precession [m], and the relative one of the force."""
    angle = motion.rate * found.time
    circle = motion.distance - RADIUS * math.sin(motion.lean)
    centre = np.column_stack([circle * np.cos(angle), circle * np.sin(angle), np.full(len(angle), found.centre[0, 2])])
    force = np.column_stack([motion.force[0] * np.cos(angle), motion.force[0] * np.sin(angle), 0 * angle])
    force[:, 2] = motion.force[2]
    apart = np.linalg.norm(found.force - force, axis=1).max() / np.linalg.norm(motion.force)
    return float(np.linalg.norm(found.centre - centre, axis=1).max()), float(apart)


def main() -> None:
    """Print the errors at three steps."""
    motion = steady_precession(distance=2.0, lean=0.5)
    print(f"steady precession at r = 2 m, lean 0.5: {motion.rate:.6f} rad/s, spin {motion.spin:.6f} rad/s")
    print(f"{'step':>8} {'centre [m]':>12} {'force':>10} {'energy, kicked':>15} {'gap [m]':>9} {'slip [m/s]':>11}")
    for step in (2e-3, 1e-3, 5e-4):
        steady, kicked = ride(motion, step, 2.0), ride(motion, step, 2.0, kick=0.5)
        position, force = errors(motion, steady)
        energy = np.abs(kicked.energy / kicked.energy[0] - 1).max()
        gap, slip = np.abs(kicked.gap).max(), np.abs(kicked.slip).max()
        print(f"{step:8g} {position:12.2e} {force:10.1e} {energy:15.1e} {gap:9.0e} {slip:11.0e}")


if __name__ == "__main__":
    main()
