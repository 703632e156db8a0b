"""Check that the bicycle is the published one, by the accelerations of a generic state."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...reference.bicycle import Bicycle
from ...reference.dae import consistent_state, dynamics
from ...reference.surface import Plane
from .ledger import SelfCheck

_SIGNS = {"theta": 1, "psi": -1, "phi": 1, "psif": 1, "betar": 1, "betaf": 1}
# Published with thirteen decimals, as is the state: half a unit of the last one, times slopes of about 100.
_PUBLISHED = 1e-10


def model_check(bicycle: Bicycle, figures: Mapping[str, Any]) -> SelfCheck:
    """Check the largest difference of the accelerations from Basu-Mandal et al. (2007), Table 1.

    A disagreement with the paper is the paper's fault only if the bicycle is the right one.
    """
    table = figures["basu_mandal"]
    q, qd = table["q"], table["qd"]
    rates = (-qd["psi"], qd["psif"], qd["betar"])
    state = consistent_state(bicycle, Plane(), (0.0, 0.0), np.pi / 2 - q["psi"], q["psif"], rates, yaw=q["theta"])
    published = np.array([sign * table["qdd"][name] for name, sign in _SIGNS.items()])
    error = np.abs(dynamics(bicycle, Plane(), *state).acceleration[3:] - published).max()
    return SelfCheck("accelerations of Basu-Mandal et al., Table 1", float(error), _PUBLISHED)
