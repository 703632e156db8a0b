"""Whether a ride can be repeated to the bit, and is computed by the engine itself."""

from __future__ import annotations

import numpy as np

from ...engines.engine import REFERENCE, SHAPES, Trajectory
from ...reference.dae import dynamics
from ..measure import state_error
from .report import ConformanceCheck, make_check, skip_check
from .rides import Ride

_FEWEST = 5  # samples in which two rides do not agree by chance
_MANY = 0.5  # share of numbers that are not equal to the last bit by chance


def check_bits(ride: Ride, again: Trajectory) -> ConformanceCheck:
    """Check that a ride is the same to the bit when it is repeated after another one."""
    first, wrong = ride.trajectory, []
    for name in SHAPES:
        one, other = getattr(first, name), getattr(again, name)
        if (one is None) != (other is None):
            wrong.append(f"it gives {name} in one ride and not in the other")
        elif one is not None and (one.shape != other.shape or not np.array_equal(one, other, equal_nan=True)):
            what = f"by {np.abs(one - other).max():.2g}" if one.shape == other.shape else "in the number of samples"
            wrong.append(
                f"its {name} differs {what}: state remains from the ride before, or the result is not repeatable"
            )
    wrong += [
        f"its {name} is {getattr(first, name)!r} in one ride and {getattr(again, name)!r} in the other"
        for name in ("steps", "unconverged_steps", "largest_residual", "ended")
        if getattr(first, name) != getattr(again, name)
    ]
    return make_check("same bits", "a ride is the same to the last bit when it is repeated after another one", wrong)


def check_own_work(ride: Ride, engine: str) -> ConformanceCheck:
    """Check that an engine has not taken coordinates or forces from the reference.

    An engine with its own integration rounds the start in its own coordinates, and then every step. Its ride therefore
    differs from the reference's by more than the reference's ride changes if every number of the start is changed by
    one unit in the last place. Forces taken from the reference at the engine's states equal it to the last bit.
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
            f"its ride is the reference's: they differ by {apart:.2g}, and by {least:.2g} if the start is changed by "
            "one unit in the last place"
        )
    forces = ride.trajectory.contact_force
    if forces is not None and any(np.mean(forces == taken) > _MANY for taken in _reference_forces(ride)):
        wrong.append("its contact forces are the reference's to the last bit; an engine without forces gives None")
    return make_check(name, claim, wrong, [f"apart from the reference by {apart:.2g}, more than {least:.2g}"])


def _reference_forces(ride: Ride) -> list[np.ndarray]:
    """Return forces (n, 2, 3) of the reference: along its own ride, and at the engine's states."""
    problem, exact = ride.motion.problem, ride.exact.contact_force
    assert exact is not None
    states = zip(ride.trajectory.q, ride.trajectory.qd, strict=True)
    own = [dynamics(problem.bicycle, problem.surface, q, qd).force for q, qd in states]
    return [exact, np.array(own)]
