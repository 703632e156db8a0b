"""What an engine asks of a problem in its ``check``, before anything is computed.

- `is_level` tells an engine that knows the level plane alone whether the ground is level. The plane may be given as
  `velodrome.Plane` or as another surface without height, so ask this function and not for the class.
- `steps_per_output` returns the number of fixed steps between two outputs, and refuses a step that does not divide the
  output interval with the nearest one that does.
"""

from __future__ import annotations

from ..reference.simulate import steps_per_output
from ..reference.surface import is_level

__all__ = ["is_level", "steps_per_output"]
