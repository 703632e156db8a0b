"""The bound of friction in DART's default contact solver, on a rod that leans.

Needs dartpy and numpy. The exit status is 1 as long as the defect is there, 0 once it is cured.

A rod stands on the ground with its lower end and begins to fall. Coulomb's law bounds the friction by the coefficient
times the normal force. DART's default solver bounds it by the coefficient times another force: the normal force that
there would be without friction. Where the friction itself raises the normal force, as here, it slides though it should
stick. A bicycle that leans by 0.73 rad rolls in DART with a coefficient of 6.6 where the forces need 0.996.

The forces at the lower end are known in closed form: it has the mobility A (its accelerations for a unit force along
the ground and along the normal), so that it sticks for the force A^-1 (0, g), and has the normal force g / A_nn without
friction. `dartpy.constraint.NsgsFrictionSolver` has the right bound.
"""

# DART's compiled bindings carry no types, and it may be missing where types are checked.
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

import math
import sys
from importlib.metadata import version
from typing import Any

import dartpy as dart
import numpy as np

GRAVITY, MASS, HALF_LENGTH, RADIUS = 9.81, 2.0, 0.5, 0.02
INERTIA = MASS * HALF_LENGTH**2 / 3  # of a thin rod about its centre
LEAN = 1.0  # of the rod from the vertical [rad]
FRICTION = 0.85
STEP = 1e-3
DEPTH = 1e-9  # of the ball in the ground, without which it might not be found [m]
# DART softens contacts by 1e-5 of their mobility, whose condition here is below 10.
ACCURACY = 1e-4


def find_forces() -> tuple[np.ndarray, float]:
    """Return friction and normal force of a lower end that sticks [N], and the normal force without friction [N]."""
    # From the contact, below the middle of the ball at the lower end, to the centre of mass.
    x, z = HALF_LENGTH * math.sin(LEAN), RADIUS + HALF_LENGTH * math.cos(LEAN)
    mobility = np.array(
        [[1 / MASS + z * z / INERTIA, -x * z / INERTIA], [-x * z / INERTIA, 1 / MASS + x * x / INERTIA]]
    )
    return np.linalg.solve(mobility, [0, GRAVITY]), GRAVITY / mobility[1, 1]


def step_rod(solver: Any | None = None) -> np.ndarray:
    """Return DART's friction and normal force (2,) in a step from rest [N], by its own solver or another."""
    world = dart.simulation.World("rod")
    world.setTimeStep(STEP)
    world.setGravity([0, 0, -GRAVITY])
    constraints = world.getConstraintSolver()
    constraints.setCollisionDetector(dart.collision.BulletCollisionDetector())
    if solver is not None:
        constraints.setBoxedLcpSolver(solver)

    rod = dart.dynamics.Skeleton("rod")
    joint, body = rod.createFreeJointAndBodyNodePair(None)
    inertia = dart.dynamics.Inertia()
    inertia.setMass(MASS)
    inertia.setMoment(np.diag([INERTIA, INERTIA, INERTIA]))
    body.setInertia(inertia)
    ball = _add_shape(body, dart.dynamics.SphereShape(RADIUS))
    lower = dart.math.Isometry3()
    lower.set_translation([-HALF_LENGTH * math.sin(LEAN), 0, -HALF_LENGTH * math.cos(LEAN)])
    ball.setRelativeTransform(lower)
    place = dart.math.Isometry3()
    place.set_translation([0, 0, RADIUS + HALF_LENGTH * math.cos(LEAN) - DEPTH])
    rod.setPositions(joint.convertToPositions(place))
    ground = dart.dynamics.Skeleton("ground")
    _add_shape(ground.createWeldJointAndBodyNodePair(None)[1], dart.dynamics.PlaneShape([0, 0, 1], 0))
    world.addSkeleton(rod)
    world.addSkeleton(ground)

    world.step()
    # What the ground has given is the momentum without the weight's.
    gained = MASS * np.asarray(body.getCOMLinearVelocity()) / STEP + [0, 0, MASS * GRAVITY]
    return gained[[0, 2]]


def solve_right() -> np.ndarray:
    """Return the forces of DART's solver with Coulomb's law."""
    solver = dart.constraint.NsgsFrictionSolver()
    options = solver.getOptions()
    options.tolerance, options.maxSweeps = 1e-10, 10_000
    solver.setOptions(options)
    return step_rod(solver)


def main() -> int:
    """Print the forces and the verdict; return the exit status."""
    sticks, without = find_forces()
    found = step_rod()
    print(f"DART {version('dartpy')}, a rod that leans by {LEAN:g} rad from the vertical, coefficient {FRICTION:g}")
    print(f"{'':38} {'friction [N]':>12} {'normal force [N]':>17} {'ratio':>7}")
    for name, force in (
        ("sticks, closed form", sticks),
        ("DART's default", found),
        ("DART's NsgsFrictionSolver", solve_right()),
    ):
        print(f"{name:38} {force[0]:12.4f} {force[1]:17.4f} {force[0] / force[1]:7.4f}")
    print(f"{'coefficient x force without friction':38} {FRICTION * without:12.4f} {without:17.4f} {FRICTION:7.4f}")
    if np.abs(found - sticks).max() < ACCURACY * MASS * GRAVITY:
        print("cured: the rod sticks")
        return 0
    print("defect: the rod slides although its friction is below the coefficient times its normal force")
    return 1


def _add_shape(body: Any, shape: Any) -> Any:
    """Let a body collide with a shape; return the node of the shape."""
    node = body.createShapeNode(shape)
    node.createCollisionAspect()
    surface = node.createDynamicsAspect()
    surface.setFrictionCoeff(FRICTION)
    surface.setRestitutionCoeff(0)
    return node


if __name__ == "__main__":
    sys.exit(main())
