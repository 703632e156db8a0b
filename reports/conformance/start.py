"""Whether a ride starts where its problem does."""

from __future__ import annotations

import numpy as np

from ...reference.kinematics import COORDINATES
from .explain import explain_columns, rate_names
from .report import Check, judge
from .rides import Ride, without_turns

# A state goes through rotations and back: some dozens of products and sums, each rounded, none of them cancelling.
_ROUNDINGS = 64


def check_start(ride: Ride) -> Check:
    """Check that the first sample is the problem's start, but for whole turns of the angles."""
    problem, given = ride.motion.problem, ride.trajectory
    wrong, worst = [], 0.0
    for own, asked, names in (
        (without_turns(given.q[0], problem.q), problem.q, list(COORDINATES)),
        (given.qd[0], problem.qd, rate_names()),
    ):
        apart = np.abs(own - asked)
        limit = _ROUNDINGS * ride.round_off * (1 + float(np.abs(asked).max()))
        off = [int(i) for i in np.flatnonzero(~(apart <= limit))]
        worst = max(worst, float(apart.max()))
        wrong += explain_columns(own[None], asked[None], off, names)
    return judge(
        f"start on {ride.motion.name}",
        "its first sample is the state that the problem starts from, but for whole turns",
        wrong,
        [f"off by {worst:.2g} at the most"],
        f"{_ROUNDINGS} roundings of {ride.round_off:.2g} of the largest coordinate and rate, on the way in and back",
    )
