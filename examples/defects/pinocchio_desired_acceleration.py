"""A field of Pinocchio 4.1 that its constraint solver does not read, on a disc that rolls.

Needs pinocchio (the package pin) and numpy. The exit status is 1 as long as the defect is there, 0 once it is cured.

A contact of `constraintDynamics` keeps the acceleration of a material point at zero. A wheel that rolls needs
another: its contact runs along the rim with the velocity u, so that the material point at the contact, whose velocity
is zero, has the acceleration -w x u, with w the angular velocity of the wheel. `RigidConstraintModel` has a field for
it, ``desired_contact_acceleration`` ("Desired contact spatial acceleration"). `constraintDynamics` does not read it: it
reads ``RigidConstraintData.contact_acceleration_desired``, which nothing sets.

A disc in steady precession on the level plane shows it, since its contact force is known in closed form.
"""

# pinocchio is an optional library whose compiled bindings carry no types.
# pyright: reportMissingImports=false

from __future__ import annotations

import math
import sys
from typing import Any

import numpy as np
import pinocchio as pin

GRAVITY, MASS, RADIUS, LEAN, DISTANCE = 9.81, 15.0, 0.3, 0.5, 2.0
ACROSS, AXIAL = MASS * RADIUS**2 / 4, MASS * RADIUS**2 / 2  # moments of inertia of a thin disc
# The force is found from a matrix whose condition is some 1e2, to round-off.
ACCURACY = 1e-12


def find_precession() -> tuple[float, np.ndarray]:
    """Return the rate W of the circle on which the disc rolls [rad/s], and the force on the disc (3,) [N].

    The contact runs on a circle of radius r, and the disc's plane leans to the circle's centre by L. The moments about
    the disc's centre require W^2 cos L ((I - J) sin L + J r / a + m a (r - a sin L)) = m g a sin L.
    """
    circle = DISTANCE - RADIUS * math.sin(LEAN)
    resistance = (ACROSS - AXIAL) * math.sin(LEAN) + AXIAL * DISTANCE / RADIUS + MASS * RADIUS * circle
    rate = math.sqrt(MASS * GRAVITY * RADIUS * math.tan(LEAN) / resistance)
    return rate, MASS * np.array([-(rate**2) * circle, 0.0, GRAVITY])


def solve_contact(in_model: bool, in_data: bool) -> np.ndarray:
    """Return Pinocchio's contact force (3,) [N], with the wanted acceleration in the model, the data, both or neither.

    The disc touches the ground at (r, 0, 0) and rolls along y.
    """
    rate, _ = find_precession()
    up, left = np.array([-math.sin(LEAN), 0, math.cos(LEAN)]), np.array([-math.cos(LEAN), 0, -math.sin(LEAN)])
    turned = np.column_stack([[0.0, 1, 0], left, up])
    point = np.array([DISTANCE, 0.0, 0.0])
    centre = point + RADIUS * up
    spin = np.array([0, 0, rate]) + rate * DISTANCE / RADIUS * left
    run = np.array([0, rate * DISTANCE, 0])  # u

    model = pin.Model()
    model.gravity.linear = np.array([0, 0, -GRAVITY])
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "disc")
    inertia = pin.Inertia(MASS, np.zeros(3), np.diag([ACROSS, AXIAL, ACROSS]))
    model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())

    contacts: Any = pin.StdVec_RigidConstraintModel()
    place = pin.SE3(turned.T, turned.T @ (point - centre))
    contacts.append(pin.RigidConstraintModel(pin.ContactType.CONTACT_3D, model, joint, place, pin.LOCAL_WORLD_ALIGNED))
    wanted = pin.Motion(-np.cross(spin, run), np.zeros(3))
    if in_model:
        contacts[0].desired_contact_acceleration = wanted
    datas: Any = pin.StdVec_RigidConstraintData()
    datas.append(contacts[0].createData())
    if in_data:
        datas[0].contact_acceleration_desired = wanted

    data = model.createData()
    pin.initConstraintDynamics(model, data, contacts, datas)
    configuration = np.concatenate([centre, pin.Quaternion(turned).coeffs()])
    velocity = np.concatenate([turned.T @ np.cross(spin, RADIUS * up), turned.T @ spin])
    settings = pin.ProximalSettings(1e-12, 1e-12, 10)
    pin.constraintDynamics(model, data, configuration, velocity, np.zeros(6), contacts, datas, settings)
    return datas[0].contact_force.linear.copy()


def main() -> int:
    """Print the forces and the verdict; return the exit status."""
    _, exact = find_precession()
    size = np.linalg.norm(exact)
    print(f"Pinocchio {pin.__version__}, a disc in steady precession on the level plane")
    print(f"{'wanted acceleration of the contact':44} {'force on the disc [N]':>30} {'error':>8}")
    print(f"{'closed form':44} {_format_force(exact):>30} {'-':>8}")
    errors = {}
    for name, fields in (
        ("none: the material point has none", (False, False)),
        ("model.desired_contact_acceleration", (True, False)),
        ("data.contact_acceleration_desired", (False, True)),
    ):
        force = solve_contact(*fields)
        errors[fields] = np.linalg.norm(force - exact) / size
        print(f"{name:44} {_format_force(force):>30} {errors[fields]:8.1e}")
    if errors[True, False] < ACCURACY:
        print("cured: constraintDynamics reads desired_contact_acceleration of the model")
        return 0
    print("defect: constraintDynamics does not read desired_contact_acceleration of the model; set it in the data")
    return 1


def _format_force(force: np.ndarray) -> str:
    return " ".join(f"{round(value, 3) + 0.0:9.3f}" for value in force)


if __name__ == "__main__":
    sys.exit(main())
