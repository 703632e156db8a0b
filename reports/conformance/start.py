"""Whether a ride starts from the start of its problem."""

from __future__ import annotations

import numpy as np

from ...reference.kinematics import COORDINATES
from .explain import explain_numbers, rate_names
from .report import ConformanceCheck, make_check
from .rides import Ride, without_turns

# A state is converted to rotations and back: several dozen rounded products and sums without cancellation.
_ROUNDINGS = 64
_MANY = 3  # a wrong map affects up to so many coordinates; if more are off, the engine has moved the whole start


def check_start(ride: Ride, map_is_wrong: bool) -> ConformanceCheck:
    """Check that the first sample is the problem's start, up to whole turns of the angles.

    Parameters
    ----------
    ride : Ride
    map_is_wrong : bool
        Whether a map of its coordinates is wrong. An engine that projects its start onto the constraints then changes
        the whole start, and only mirrored or swapped coordinates are reported.
    """
    problem, given = ride.motion.problem, ride.trajectory
    wrong, worst = [], 0.0
    for own, unturned, asked, names in (
        (given.q[0], without_turns(given.q[0], problem.q), problem.q, list(COORDINATES)),
        (given.qd[0], given.qd[0], problem.qd, rate_names()),
    ):
        apart = np.abs(unturned - asked)
        size = 1 + float(np.abs(asked).max())
        limit, worst = _ROUNDINGS * ride.round_off * size, max(worst, float(apart.max()))
        off = [int(i) for i in np.flatnonzero(~(apart <= limit))]
        if len(off) > _MANY:
            what = ", ".join(names[i] for i in off) if len(off) < len(names) else f"all, from {names[0]} on"
            wrong.append(f"its first sample is off in {what}, by {apart.max():.2g} at the most: it moves its start")
            off = [] if map_is_wrong else [int(np.argmax(apart))]
        wrong += explain_numbers(own[None], asked[None], off, names, factors=not map_is_wrong)
    return make_check(
        f"start on {ride.motion.name}",
        "its first sample is the state that the problem starts from, up to whole turns",
        wrong,
        [f"off by {worst:.2g} at the most"],
        f"{_ROUNDINGS} roundings of {ride.round_off:.2g} of the largest coordinate and rate, on the way in and back",
    )
