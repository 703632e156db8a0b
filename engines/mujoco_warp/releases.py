"""From which releases of MuJoCo Warp and Warp on the engine rides.

MuJoCo Warp rides with the MuJoCo of the suite, which other releases of it do not replace. Before 3.12 it could not ride
anyway: it reads a field of MuJoCo's model that 4.0 does not have any more, ``nflexevpair``.
"""

from __future__ import annotations

from ..releases import LibraryReach

MUJOCO_WARP = LibraryReach(
    "mujoco-warp", "MuJoCo Warp", oldest="3.17.0", needs="DeterminismType, by which rides repeat on a GPU"
)
WARP = LibraryReach("warp-lang", "Warp", oldest="1.19.0", needs="the oldest release that the tests hold")
