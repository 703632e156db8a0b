"""MuJoCo's tree and integrator under the exact forces of rolling: a cross-check of the tree.

The contact forces are computed by this package, in every stage, from MuJoCo's mass matrix and bias forces
(`knife_edge.rolling_forces`); MuJoCo's contacts are not used. Agreement with the reference therefore checks
MuJoCo's kinematics, inertia and integrator, and says nothing about MuJoCo's contacts: wheels neither
lift off nor slide, whatever the forces.
"""

from __future__ import annotations

from .engine import MujocoEngine
from .releases import ROLLING
from .settings import MultiplierSettings

ENGINE = MujocoEngine(
    "mujoco-multipliers",
    MultiplierSettings,
    "velodrome.engines.mujoco.edges:build_multipliers",
    description="MuJoCo's tree and integrator under the exact forces of rolling, without its contacts",
    settings_source="the suite's own choice: RK4 at MuJoCo's default step, gaps and slip brought back to zero at 20 /s",
    reach=ROLLING,
)
