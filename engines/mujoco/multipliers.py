"""MuJoCo's tree and integrator under the exact forces of rolling: a cross-check of the tree.

The contact forces are ours, solved in every stage from MuJoCo's mass matrix and bias forces
(`knife_edge.rolling_forces`); MuJoCo's contacts have no part in it. What this agrees on with the reference
is MuJoCo's kinematics, inertia and integrator. It says nothing about MuJoCo's contacts: wheels neither
lift off nor slide, whatever the forces.
"""

from __future__ import annotations

from .engine import MujocoEngine
from .settings import MultiplierSettings

ENGINE = MujocoEngine(
    "mujoco-multipliers",
    MultiplierSettings,
    "velodrome.engines.mujoco.edges:build_multipliers",
    description="MuJoCo's tree and integrator under the exact forces of rolling, without its contacts",
)
