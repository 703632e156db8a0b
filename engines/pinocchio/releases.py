"""From which release of Pinocchio on the engine rides."""

from __future__ import annotations

from ..releases import LibraryReach

# 4.0.0 and 4.1.0 have been tried. 3.4.0 and 2.7.0 need an older numpy than the suite; of 3.9.0 the newest companions
# that it allows do not go together.
PINOCCHIO = LibraryReach("pin", "Pinocchio", oldest="4.0.0", needs="the oldest release that has been tried")
