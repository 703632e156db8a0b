"""A value that Exudyn's own test of the rolling disc stores, and that contains a wrong contact force.

Needs exudyn 1.13. The exit status is 1 as long as the defect is there, 0 once it is cured.

Exudyn's test model rollingCoinTest.py rolls a ring of 1 cm, tilted by one degree and turned about the vertical, for
0.5 s by the trapezoidal rule with index 2, and stores x + 0.1 (F1 + F2 + F3) of the contact point and the contact force
at the end. Its initial accelerations ignore how the directions of rolling turn (`examples/exudyn_contact_forces.py`):
the first lateral force is a quarter too large. The trapezoidal rule damps nothing, so that all forces alternate about
the right ones, at any step; the stored value depends on whether the number of steps is even. The path is right, as the
test's former value, x alone, was.

This is the test's model. Beside it stand the equations of the ring, integrated by Runge-Kutta's method, and Exudyn from
right initial accelerations, with which nothing alternates.
"""

from __future__ import annotations

import math
import sys
from importlib.metadata import version
from typing import Any, NamedTuple

import exudyn as exu
import numpy as np
from exudyn.itemInterface import MarkerBodyRigid, ObjectGround, ObjectJointRollingDisc, SensorObject
from exudyn.rigidBodyUtilities import RigidBodyInertia

MASS: Any = 1.0  # [kg]
RADIUS: Any = 0.01  # [m]
GRAVITY = 9.81  # [m/s^2]
TILT, TURN = math.radians(1), 10 * math.pi  # [rad], about the vertical [rad/s]
STEP, DURATION = 0.0005, 0.5  # [s]
STORED = 1.0634381189385853  # the value that the test compares with
UP = np.array([0.0, 0.0, 1.0])
AXLE = np.array([math.cos(TILT), 0.0, -math.sin(TILT)])
START = np.concatenate([AXLE, TURN * UP, np.zeros(3)])  # axle, angular velocity, contact point
# Three times what the trapezoidal rule's step leaves of the error from right accelerations.
ACCURACY = 1e-4


class Roll(NamedTuple):
    """What is measured of a ride.

    Attributes
    ----------
    first, before, last : ndarray, shape (3,)
        Force of the ground at the start, one step before the end and at the end: lateral, forward, normal [N]. Of
        given accelerations Exudyn computes no force at the start: NaN.
    value : float
        What the test stores.
    """

    first: np.ndarray
    before: np.ndarray
    last: np.ndarray
    value: float


def find_ring_motion(axle: np.ndarray, omega: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return angular acceleration, force on a ring and velocity of its contact point, from its momenta.

    With e from the contact to the centre over the radius r, the centre's velocity is w x r e and its acceleration
    w' x r e + w x r e'; the inertia is m r^2 (1 + n n) / 4 with n the axle.
    """
    steep = UP - (UP @ axle) * axle
    up = steep / np.linalg.norm(steep)
    turned = np.cross(omega, axle)
    rate = -(UP @ turned) * axle - (UP @ axle) * turned
    rate = (rate - (rate @ up) * up) / np.linalg.norm(steep)
    inertia = MASS * RADIUS**2 / 4 * (np.eye(3) + np.outer(axle, axle))
    carried = np.cross(omega, RADIUS * rate)
    about_contact = inertia + MASS * RADIUS**2 * (np.eye(3) - np.outer(up, up))
    moment = np.cross(omega, inertia @ omega) + RADIUS * np.cross(up, MASS * (carried + GRAVITY * UP))
    angular = np.linalg.solve(about_contact, -moment)
    force = MASS * (np.cross(angular, RADIUS * up) + carried + GRAVITY * UP)
    return angular, force, np.cross(omega, RADIUS * up) - RADIUS * rate


def resolve_force(axle: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Return a force along the axle's level part, along the path and upwards, the axes of Exudyn's joint."""
    lateral = axle - (axle @ UP) * UP
    lateral /= np.linalg.norm(lateral)
    return np.array([force @ lateral, force @ np.cross(lateral, UP), force @ UP])


def measure_exact_roll(steps: int = 1000) -> Roll:
    """Roll the ring by its equations, with Runge-Kutta's method of order 4."""

    def slope(state: np.ndarray) -> np.ndarray:
        angular, _, velocity = find_ring_motion(state[:3], state[3:6])
        return np.concatenate([np.cross(state[3:6], state[:3]), angular, velocity])

    states, step = [START], DURATION / steps
    for _ in range(steps):
        state = states[-1]
        k1 = slope(state)
        k2 = slope(state + step / 2 * k1)
        k3 = slope(state + step / 2 * k2)
        k4 = slope(state + step * k3)
        states.append(state + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4))
    shown = (states[0], states[-1 - round(STEP / step)], states[-1])
    first, before, last = (resolve_force(s[:3], find_ring_motion(s[:3], s[3:6])[1]) for s in shown)
    return Roll(first, before, last, float(states[-1][6] + 0.1 * last.sum()))


def measure_roll(right_start: bool = False, step: float = STEP) -> Roll:
    """Roll the ring in Exudyn as the test does, or from right initial accelerations."""
    container: Any = exu.SystemContainer()
    mbs: Any = container.AddSystem()
    up = np.array([math.sin(TILT), 0.0, math.cos(TILT)])
    diagonal = MASS * RADIUS**2 * np.array([0.5, 0.25, 0.25])
    ring = mbs.CreateRigidBody(
        inertia=RigidBodyInertia(mass=MASS, inertiaTensor=np.diag(diagonal)),
        referencePosition=RADIUS * up,
        referenceRotationMatrix=np.column_stack([AXLE, [0, 1, 0], up]),
        initialVelocity=np.cross(TURN * UP, RADIUS * up),
        initialAngularVelocity=TURN * UP,
        gravity=[0, 0, -GRAVITY],
        nodeType=exu.NodeType.RotationEulerParameters,
        show=False,
    )
    bodies = [mbs.AddObject(ObjectGround()), ring]
    markers = [mbs.AddMarker(MarkerBodyRigid(bodyNumber=body)) for body in bodies]
    joint = mbs.AddObject(ObjectJointRollingDisc(markerNumbers=markers, constrainedAxes=[1, 1, 1], discRadius=RADIUS))
    kinds: Any = exu.OutputVariableType
    sensor = mbs.AddSensor(SensorObject(objectNumber=joint, storeInternal=True, outputVariableType=kinds.ForceLocal))
    mbs.Assemble()
    settings: Any = exu.SimulationSettings()
    settings.timeIntegration.numberOfSteps = round(DURATION / step)
    settings.timeIntegration.endTime = DURATION
    settings.solution.sensors.writePeriod = step
    settings.solution.file.write = False
    method = settings.timeIntegration.generalizedAlpha
    method.useIndex2Constraints = method.useNewmark = method.computeInitialAccelerations = True
    if right_start:
        angular, force, _ = find_ring_motion(AXLE, TURN * UP)
        theta = mbs.systemData.GetODE2CoordinatesTotal()[3:]
        rates = multiply_quaternion(0.5 * TURN * UP, theta)
        second = multiply_quaternion(0.5 * angular, theta) + multiply_quaternion(0.5 * TURN * UP, rates)
        linear = force / MASS - GRAVITY * UP
        mbs.systemData.SetODE2Coordinates_tt([*linear, *second], exu.ConfigurationType.Initial)
        method.computeInitialAccelerations = False
    mbs.SolveDynamic(settings)
    forces = mbs.GetSensorStoredData(sensor)[:, 1:]
    path = mbs.GetObjectOutput(joint, kinds.Position)
    first = np.full(3, np.nan) if right_start else forces[0]
    return Roll(first, forces[-2], forces[-1], float(path[0] + 0.1 * forces[-1].sum()))


def multiply_quaternion(vector: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """Return the quaternion product of (0, vector) and theta."""
    return np.array([-vector @ theta[1:], *(theta[0] * vector + np.cross(vector, theta[1:]))])


def main() -> int:
    """Print forces, the test's value and the verdict; return the exit status."""
    exact = measure_exact_roll()
    rolls = {"Exudyn's test": measure_roll(), "right accelerations": measure_roll(right_start=True), "exact": exact}
    print(f"Exudyn {version('exudyn')}: lateral force on a ring at the start, a step before the end and at the end")
    for name, roll in rolls.items():
        forces = ", ".join(f"{force[0]:.5f}" for force in (roll.first, roll.before, roll.last))
        print(f"{name:20} {forces} N, the test's value {roll.value:.7f}")
    print(f"{'stored by the test':20} {STORED:.7f}")
    error = abs(rolls["Exudyn's test"].value - exact.value)
    if error < ACCURACY:
        print("cured: the test's forces are right")
        return 0
    print(f"defect: the test's value is wrong by {error:.5f}, all of it by its force; start from right accelerations")
    return 1


if __name__ == "__main__":
    sys.exit(main())
