"""What Bullet's contacts make of a depth, on a thin disc that leans.

Needs pybullet and numpy. The exit status is 1 as long as the defect is there, 0 once it is cured.

A contact that is deep in the ground has to come out of it, and to be at rest there. Bullet's multibodies lift it by
contactERP, 0.2 by default, of the depth in one step, and leave it the velocity: contactERP x depth / step, which grows
without bound as the step is halved. (For its plain rigid bodies Bullet has a cure, ``useSplitImpulse``, which does
nothing here.) A contactERP of 0 gives no such velocity.

It matters where nobody thinks of a depth. Bullet rounds the edges of a cylinder by a margin of 1 mm, so that a disc
that leans by L and stands on the ground with the middle of its rim is margin (1 - cos L) deep: 0.25 mm at 0.73 rad,
which are 0.05 m/s at a step of 1 ms. A bicycle that rolls on such wheels in a stable circle falls within two seconds.
"""

# PyBullet's compiled bindings carry no types, and it may be missing where types are checked.
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

import math
import sys
from importlib.metadata import version

import numpy as np
import pybullet

GRAVITY, MASS, RADIUS, HALF_THICKNESS, LEAN = 9.81, 2.0, 0.3, 1e-3, 0.73
MARGIN = 1e-3  # of Bullet's convex shapes [m]
STEPS = (1e-3, 5e-4, 2.5e-4)
DEFAULT_ERP = 0.2
# Velocities without a kick are smaller than gravity times the step, and the kicks are larger.
LARGEST = GRAVITY * STEPS[0]


def step_disc(erp: float, step: float) -> tuple[float, float]:
    """Return the depth of the contact at the start [m] and the velocity off the ground after a step [m/s]."""
    client = pybullet.connect(pybullet.DIRECT)
    where = {"physicsClientId": client}
    pybullet.setGravity(0, 0, -GRAVITY, **where)
    pybullet.setPhysicsEngineParameter(fixedTimeStep=step, numSubSteps=0, contactERP=erp, useSplitImpulse=1, **where)
    plane = pybullet.createMultiBody(0, pybullet.createCollisionShape(pybullet.GEOM_PLANE, **where), **where)
    shape = pybullet.createCollisionShape(pybullet.GEOM_CYLINDER, radius=RADIUS, height=2 * HALF_THICKNESS, **where)
    # The axle, the cylinder's z, leans by L from the horizontal; the middle of the rim is on the ground.
    upright = pybullet.getQuaternionFromEuler([math.pi / 2 - LEAN, 0, 0])
    centre = [0, 0, RADIUS * math.cos(LEAN)]
    disc = pybullet.createMultiBody(MASS, shape, basePosition=centre, baseOrientation=upright, **where)
    for body in (plane, disc):
        pybullet.changeDynamics(body, -1, lateralFriction=1, restitution=0, linearDamping=0, angularDamping=0, **where)
    pybullet.performCollisionDetection(**where)
    depth = -min((contact[8] for contact in pybullet.getContactPoints(disc, plane, **where)), default=0.0)
    pybullet.stepSimulation(**where)
    velocity, spin = (np.array(part) for part in pybullet.getBaseVelocity(disc, **where))
    down = np.array([0, 0, -1.0])
    axle = np.array(pybullet.getMatrixFromQuaternion(upright)).reshape(3, 3)[:, 2]
    rim = down - (down @ axle) * axle
    arm = RADIUS * rim / np.linalg.norm(rim)
    pybullet.disconnect(client)
    return depth, float((velocity + np.cross(spin, arm))[2])


def main() -> int:
    """Print depth, velocities and the verdict; return the exit status."""
    depth, _ = step_disc(0.0, STEPS[0])
    print(f"PyBullet {version('pybullet')}, a thin disc that leans by {LEAN:g} rad and stands on the level plane")
    print(f"depth of its contact {depth:.3e} m, margin (1 - cos L) {MARGIN * (1 - math.cos(LEAN)):.3e} m")
    print("velocity of its edge off the ground after a step from rest [m/s]:")
    print(f"{'step':>8}  {f'contactERP {DEFAULT_ERP:g}':>14}  {'depth x ERP / step':>18}  {'contactERP 0':>12}")
    kicks = []
    for step in STEPS:
        (_, kicked), (_, still) = step_disc(DEFAULT_ERP, step), step_disc(0.0, step)
        kicks.append(abs(kicked))
        print(f"{1e3 * step:5g} ms  {kicked:14.3e}  {DEFAULT_ERP * depth / step:18.3e}  {still:12.3e}")
    if max(kicks) < LARGEST:
        print("cured: a depth leaves no velocity")
        return 0
    print("defect: a depth leaves a velocity that grows as the step is halved; set contactERP to 0")
    return 1


if __name__ == "__main__":
    sys.exit(main())
