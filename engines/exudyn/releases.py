"""From which release of Exudyn on the engines ride, and what older ones lack.

What releases only name differently is in `velodrome.engines.exudyn.library`.
"""

from __future__ import annotations

from ..releases import Adaptation, LibraryReach

_TOTAL_COORDINATES = Adaptation(
    name="coordinates",
    since="1.10.0",
    how="replaced",
    text="the wheels' coordinates are the sum of Exudyn's displacements and reference coordinates",
)
_FIRST_FORCE = Adaptation(
    name="first_force",
    since="1.11.0",
    how="left_out",
    text="Exudyn keeps no Lagrange multipliers of the start: the contact forces of the first sample are unknown, and "
    "count as zero in the force error",
)
JOINT = LibraryReach(
    "exudyn",
    "Exudyn",
    oldest="1.9.0",
    needs="before, Newton's method fails at the start",
    adaptations=(_TOTAL_COORDINATES, _FIRST_FORCE),
)
DISCS = LibraryReach("exudyn", "Exudyn", oldest="1.10.0", needs="CreateRollingDisc", adaptations=(_FIRST_FORCE,))
# First release with CreateTorsionalSpringDamper, by which the problem's inputs act.
INPUTS = "1.10.0"
