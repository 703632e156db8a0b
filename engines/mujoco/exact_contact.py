"""MuJoCo's contact solver on exact knife-edge contacts: how far its own rows can be pushed.

Distance, point and normal of each contact are exact in every stage of the integrator, and the reference
accelerations get the contact's own acceleration, which MuJoCo leaves out (`knife_edge`). Friction cone,
lift-off and solver are MuJoCo's own; the solver starts where wheels neither slide nor lift off, and what it leaves
is looked at in every evaluation (`convergence`). What is left is the softness of the rows, a slip of R F / b.
"""

from __future__ import annotations

from .engine import MujocoEngine
from .settings import ExactContactSettings

ENGINE = MujocoEngine(
    "mujoco-exact-contact",
    ExactContactSettings,
    "velodrome.engines.mujoco.edges:build_contacts",
    description="MuJoCo's contact solver on exact knife-edge contacts, with nearly rigid rows",
)
