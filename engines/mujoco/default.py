"""MuJoCo with the options that it has when nobody sets any.

The model is that of `native`, and it falls on circles that a bicycle rides, for two reasons:

- A friction coefficient of 1 in a pyramidal cone is a coefficient of 0.7 along the pyramid's edges; the
  paper's Q2 needs 0.96. The front wheel slides at once.
- Contacts have a time constant of 20 ms, ten steps. Given friction enough the wheels still creep by
  (v^2 / R) / b, five times the careful user's: 0.1 m/s on Q2, and speed and balance are lost in seconds.
"""

from __future__ import annotations

from .engine import MujocoEngine
from .settings import DefaultSettings

ENGINE = MujocoEngine(
    "mujoco-default",
    DefaultSettings,
    "velodrome.engines.mujoco.planes:build_planes",
    description="MuJoCo with the options that it has when nobody sets any: soft contacts on tangent planes",
)
