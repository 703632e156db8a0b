"""Whether a ride is the engine's own and the same every time."""

from __future__ import annotations

import numpy as np

from ...engines.engine import REFERENCE, SHAPES, Trajectory
from ...reference.dae import dynamics
from ..measure import state_error
from .report import ConformanceCheck, make_check, skip_check
from .rides import Ride

_FEWEST = 5  # samples in which two rides cannot agree by chance
_MANY = 0.5  # of the numbers: that many are not equal to the last bit by chance


def check_bits(ride: Ride, again: Trajectory) -> ConformanceCheck:
    """Check that a ride is the same to the bit when it is repeated after another one."""
    first, wrong = ride.trajectory, []
    for name in SHAPES:
        one, other = getattr(first, name), getattr(again, name)
        if (one is None) != (other is None):
            wrong.append(f"it gives {name} in one ride and not in the other")
        elif one is not None and (one.shape != other.shape or not np.array_equal(one, other, equal_nan=True)):
            what = f"by {np.abs(one - other).max():.2g}" if one.shape == other.shape else "in the number of samples"
            wrong.append(f"its {name} differs {what}: something is kept from one ride to the next, or not repeatable")
    wrong += [
        f"its {name} is {getattr(first, name)!r} once and {getattr(again, name)!r} another time"
        for name in ("steps", "unconverged_steps", "largest_residual", "ended")
        if getattr(first, name) != getattr(again, name)
    ]
    return make_check("same bits", "a ride is the same to the last bit when it is repeated after another one", wrong)


def check_own_work(ride: Ride, engine: str) -> ConformanceCheck:
    """Check that an engine has not taken coordinates or forces from the reference.

    An engine that integrates by itself rounds its start to its own coordinates and every step after it. So its ride
    differs from the reference's by more than what one unit in the last place of the start alone makes of the
    reference's own ride. Forces that are the reference's at the engine's own states are equal to them to the last bit.
    """
    name, claim = "own work", "its coordinates and forces are computed by itself, not taken from the reference"
    if engine == REFERENCE:
        return skip_check(name, claim, "it is the reference")
    n, wrong = len(ride.trajectory.time), []
    if n < _FEWEST:
        return skip_check(name, claim, f"its ride has fewer than {_FEWEST} samples")
    least = state_error(ride.motion.round_off.first(n), ride.motion.exact, ride.motion.scale)
    apart = state_error(ride.followed, ride.motion.exact, ride.motion.scale)
    if apart <= least:
        wrong.append(
            f"its ride is the reference's: they differ by {apart:.2g}, and by {least:.2g} if the start is rounded once "
            "otherwise"
        )
    forces = ride.trajectory.contact_force
    if forces is not None and any(np.mean(forces == taken) > _MANY for taken in _forces_of_the_reference(ride)):
        wrong.append("its contact forces are the reference's to the last bit; an engine that has none gives None")
    return make_check(name, claim, wrong, [f"apart from the reference by {apart:.2g}, more than {least:.2g}"])


def _forces_of_the_reference(ride: Ride) -> list[np.ndarray]:
    """Forces (n, 2, 3) of the reference's ride, and its forces at the engine's own states."""
    problem, exact = ride.motion.problem, ride.exact.contact_force
    assert exact is not None
    states = zip(ride.trajectory.q, ride.trajectory.qd, strict=True)
    own = [dynamics(problem.bicycle, problem.surface, q, qd).force for q, qd in states]
    return [exact, np.array(own)]
