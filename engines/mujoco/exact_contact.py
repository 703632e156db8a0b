"""MuJoCo's contact solver on exact knife-edge contacts, with nearly rigid contact rows.

Distance, point and normal of each contact are exact in every stage of the integrator, and the reference
accelerations include the contact's own acceleration, which MuJoCo omits (`knife_edge`). Friction cone,
lift-off and solver are MuJoCo's own. The solver starts from the solution in which wheels neither slide nor lift off,
and its residual is assessed in every evaluation (`convergence`). The remaining error is the softness of the rows,
a slip of R F / b.
"""

from __future__ import annotations

from .engine import MujocoEngine
from .releases import EDGES
from .settings import ExactContactSettings

ENGINE = MujocoEngine(
    "mujoco-exact-contact",
    ExactContactSettings,
    "velodrome.engines.mujoco.edges:build_contacts",
    description="MuJoCo's contact solver on exact knife-edge contacts, with nearly rigid rows",
    settings_source="the suite's own choice: RK4 at MuJoCo's default step, contact rows as hard as round-off allows",
    reach=EDGES,
)
