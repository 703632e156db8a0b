"""A residual of Pinocchio 4.1 that is not one, on a body that rests on a point.

Needs pinocchio (the package pin) and numpy. The exit status is 1 as long as the defect is there, 0 once it is cured.

The proximal iteration of `constraintDynamics` stops where ``ProximalSettings.absolute_residual``, what is left of the
contacts' accelerations, is below the absolute accuracy, or where the forces change by less than the relative accuracy
from one iteration to the next. The absolute residual lacks J M^-1 (tau - h), the acceleration without contacts: at the
solution it is as large as gravity. So the first criterion never holds, and what is read as the solver's error is none.
"""

# pinocchio is an optional library whose compiled bindings carry no types.
# pyright: reportMissingImports=false

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pinocchio as pin

GRAVITY, MASS = 9.81, 2.0
# Of gravity: some roundings.
ACCURACY = 1e-12


def solve_rest() -> tuple[float, float]:
    """Return what is left of a contact's acceleration, computed and as Pinocchio reports it [m/s^2].

    A ball is held at its centre of mass, so that its force is its weight.
    """
    model = pin.Model()
    model.gravity.linear = np.array([0, 0, -GRAVITY])
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "ball")
    model.appendBodyToJoint(joint, pin.Inertia(MASS, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    contacts: Any = pin.StdVec_RigidConstraintModel()
    contacts.append(pin.RigidConstraintModel(pin.ContactType.CONTACT_3D, model, joint, pin.LOCAL_WORLD_ALIGNED))
    datas: Any = pin.StdVec_RigidConstraintData()
    datas.append(contacts[0].createData())
    data = model.createData()
    pin.initConstraintDynamics(model, data, contacts, datas)
    settings = pin.ProximalSettings(1e-12, 1e-12, 10)
    rest = pin.neutral(model), np.zeros(6)
    rates = pin.constraintDynamics(model, data, *rest, np.zeros(6), contacts, datas, settings)
    # The contact is at rest and in the body's origin: its acceleration is the first half of the joint's.
    return float(np.abs(rates[:3]).max()), float(settings.absolute_residual)


def main() -> int:
    """Print both residuals and the verdict; return the exit status."""
    left, reported = solve_rest()
    print(f"Pinocchio {pin.__version__}, a ball of {MASS:g} kg held in its centre")
    print(f"acceleration that is left of the contact: {left:.1e} m/s^2")
    print(f"ProximalSettings.absolute_residual:       {reported:.1e} m/s^2")
    if abs(reported - left) < ACCURACY * GRAVITY:
        print("cured: the absolute residual is what is left of the contact's acceleration")
        return 0
    print("defect: the absolute residual lacks the acceleration without contacts; use the relative one")
    return 1


if __name__ == "__main__":
    sys.exit(main())
