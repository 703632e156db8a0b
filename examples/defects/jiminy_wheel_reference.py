"""The start of Jiminy's wheel constraint, on a disc that leans.

Needs jiminy-py and numpy. The exit status is 1 as long as the defect is there, 0 once it is cured.

`WheelConstraint` keeps a wheel's lowest point on a plane. ``Engine.start`` resets the constraint, which then takes the
centre of the wheel at the start, less the radius along the normal, for a point of the ground. That is right for an
upright wheel. One that leans by L stands r (1 - cos L) too low for it, and the stabilisation, if it is on, lifts it out
of the ground: the force is many times that of a rolling wheel from the first instant.

A disc in steady precession on the level plane shows it, since its contact force is known in closed form. What helps:
switch the stabilisation on after the start only, and set ``reference_transform`` to the centre of an upright wheel.
"""

# Jiminy's compiled bindings carry no types, and it may be missing where types are checked.
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

import math
import sys
from importlib.metadata import version

import jiminy_py.core as jiminy
import numpy as np
from jiminy_py.core import pinocchio as pin

GRAVITY, MASS, RADIUS, LEAN, DISTANCE = 9.81, 15.0, 0.3, 0.5, 2.0
ACROSS, AXIAL = MASS * RADIUS**2 / 4, MASS * RADIUS**2 / 2  # moments of inertia of a thin disc
FREQUENCY = 20.0  # of the stabilisation, that of Jiminy's own contacts [Hz]
UP, AXLE = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0])
# Jiminy adds 1e-11 1/kg to inverse masses of 1 / 15 kg and more, in a matrix whose condition is below 1e2.
ACCURACY = 1e-8


def find_precession() -> tuple[float, np.ndarray]:
    """Return the rate W of the circle on which the disc rolls [rad/s], and the force on the disc (3,) [N].

    The contact runs on a circle of radius r, and the disc's plane leans to the circle's centre by L. The moments about
    the disc's centre require W^2 cos L ((I - J) sin L + J r / a + m a (r - a sin L)) = m g a sin L.
    """
    circle = DISTANCE - RADIUS * math.sin(LEAN)
    resistance = (ACROSS - AXIAL) * math.sin(LEAN) + AXIAL * DISTANCE / RADIUS + MASS * RADIUS * circle
    rate = math.sqrt(MASS * GRAVITY * RADIUS * math.tan(LEAN) / resistance)
    return rate, MASS * np.array([-(rate**2) * circle, 0.0, GRAVITY])


def find_first_force(frequency: float) -> np.ndarray:
    """Return Jiminy's contact force (3,) [N] at the start, with a frequency of stabilisation [Hz]."""
    rate, _ = find_precession()
    up, left = np.array([-math.sin(LEAN), 0, math.cos(LEAN)]), np.array([-math.cos(LEAN), 0, -math.sin(LEAN)])
    turned = np.column_stack([[0.0, 1, 0], left, up])
    spin = np.array([0, 0, rate]) + rate * DISTANCE / RADIUS * left

    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root_joint")
    inertia = pin.Inertia(MASS, np.zeros(3), np.diag([ACROSS, AXIAL, ACROSS]))
    model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    model.addBodyFrame("disc", joint, pin.SE3.Identity(), -1)
    robot = jiminy.Robot()
    robot.initialize(model)
    wheel = jiminy.WheelConstraint("disc", RADIUS, UP, AXLE)
    wheel.baumgarte_freq = frequency
    robot.add_constraint("disc", wheel)
    engine = jiminy.Engine()
    engine.add_robot(robot)
    options = engine.get_options()
    options["world"]["gravity"] = np.array([0.0, 0, -GRAVITY, 0, 0, 0])
    options["constraints"]["regularization"] = 0.0  # the default of 1e-3 is a softness, another matter
    engine.set_options(options)
    place = np.concatenate([np.array([DISTANCE, 0, 0]) + RADIUS * up, pin.Quaternion(turned).coeffs()])
    engine.start(place, np.concatenate([turned.T @ np.cross(spin, RADIUS * up), turned.T @ spin]))
    force = np.array(wheel.lambda_c)
    engine.stop()
    return force


def main() -> int:
    """Print the forces and the verdict; return the exit status."""
    _, exact = find_precession()
    print(f"Jiminy {version('jiminy-py')}, a disc that leans by {LEAN:g} rad in steady precession on the level plane")
    print(f"{'':30} {'force on the disc at the start [N]':>36} {'error':>8}")
    print(f"{'closed form':30} {_format_force(exact):>36} {'-':>8}")
    errors = {}
    for frequency in (0.0, FREQUENCY):
        force = find_first_force(frequency)
        errors[frequency] = np.linalg.norm(force - exact) / np.linalg.norm(exact)
        print(f"stabilisation of {frequency:4g} Hz         {_format_force(force):>36} {errors[frequency]:8.1e}")
    if errors[FREQUENCY] < ACCURACY:
        print("cured: a wheel that leans stands on the ground from the start")
        return 0
    print("defect: the stabilisation takes a wheel that leans for one that is in the ground")
    return 1


def _format_force(force: np.ndarray) -> str:
    return " ".join(f"{round(value, 3) + 0.0:11.3f}" for value in force)


if __name__ == "__main__":
    sys.exit(main())
