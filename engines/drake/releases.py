"""From which release of Drake on the engines ride."""

from __future__ import annotations

from ..releases import LibraryReach

# 1.34, 1.40, 1.45, 1.50 and 1.51.1 have been tried; nothing is known that older releases lack.
DRAKE = LibraryReach("drake", "Drake", oldest="1.34.0", needs="the oldest release that has been tried")
