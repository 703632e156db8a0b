"""MuJoCo with its default options.

The model is that of `native`. It falls on circles that a bicycle can ride, for two reasons:

- A friction coefficient of 1 in a pyramidal cone is a coefficient of 0.7 along the pyramid's edges; the
  paper's Q2 needs 0.96. The front wheel slides at once.
- Contacts have a time constant of 20 ms, ten steps. Even with enough friction the wheels creep. Of (v^2 / R) / b alone
  it would be five times as fast as in `native`; softness makes it seven times, 0.16 m/s on Q2. Speed and balance are
  lost within seconds.
"""

from __future__ import annotations

from .engine import MujocoEngine
from .releases import PLANES
from .settings import DefaultSettings

ENGINE = MujocoEngine(
    "mujoco-default",
    DefaultSettings,
    "velodrome.engines.mujoco.planes:build_planes",
    description="MuJoCo with the options that it has when nobody sets any: soft contacts on tangent planes",
    settings_source="MuJoCo's own defaults, as the reference of its model files states them for option and geom",
    reach=PLANES,
)
