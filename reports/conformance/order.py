"""Whether a ride converges as its step is halved, and to the reference's ride."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from ..measure import SAME_BITS, extrapolate, observed_orders, order_limit
from .explain import EXPLAINED
from .maps import scaled_rate, violation
from .report import Check, judge, skip
from .rides import Ride

FACTORS = (4.0, 2.0, 1.0)
CLAIM = "its rides converge as the step is halved, to the reference's where its wheels are bound to roll"
_LIMIT = "the order must be 1/2 or more; the extrapolated ride may be off by its noise and four times its uncertainty"
_LEAST_ORDER = 0.5  # a sequence that converges more slowly does not, or not yet
_ROOM = 4.0  # of the change by the last extrapolation, which the next powers of the step may leave


def check_order(name: str, ride_at: Callable[[float], Ride]) -> Check:
    """Check the order that rides with halved steps show, and what they converge to.

    Parameters
    ----------
    name : str
        Of the ground.
    ride_at : callable
        Rides with a factor on the step; ValueError where the settings allow no such step.
    """
    name = f"order on {name}"
    try:
        rides = [ride_at(factor) for factor in FACTORS]
    except ValueError as error:
        return skip(name, CLAIM, " ".join(str(error).split()))
    if any(np.array_equal(one.q, other.q) for one, other in pairwise(rides)):
        return judge(name, CLAIM, [SAME_BITS])
    finest = rides[-1]
    sizes = np.array([*3 * [finest.motion.size], *6 * [1.0]])
    samples = min(len(ride.q) for ride in rides)
    paths, exact = [ride.q[:samples] / sizes for ride in rides], finest.exact.q[:samples] / sizes
    first, second = (float(np.abs(b - a).max()) for a, b in pairwise(paths))
    if order_limit(finest.noise, (first, second)) is None:
        seen = f"its order cannot be seen: halving its steps changes {second:.2g}, and its noise is {finest.noise:.2g}"
        # What the coarser steps change is still an error of the method.
        value, uncertain = paths[-1], first
    else:
        order = observed_orders(paths)[-1]
        seen = f"an order of {order:.3g} is seen"
        if not order >= _LEAST_ORDER:
            return judge(name, CLAIM, [f"{seen}; it does not converge"], tolerance=_LIMIT)
        found = extrapolate(paths)
        value, uncertain = found.value, found.uncertainty
    if finest.trajectory.friction is not None:
        return judge(
            name, CLAIM, [], [seen, "its contacts have friction: what it converges to is its own model's ride"]
        )
    off, allowed = float(np.abs(value - exact).max()), finest.noise + _ROOM * uncertain
    if off <= allowed:
        return judge(name, CLAIM, [], [seen, f"what it converges to is {off:.2g} from the reference"])
    wrong = f"what it converges to is {off:.2g} of the motion's size from the reference, limit {allowed:.2g}"
    return judge(name, CLAIM, [wrong, *_explain(rides, off)], tolerance=_LIMIT)


def _explain(rides: Sequence[Ride], off: float) -> list[str]:
    """Say what a wrong limit speaks of: maps if the wheels slip by as much, else another bicycle."""
    finest = rides[-1]
    motion, trajectory = finest.motion, finest.trajectory
    slip = violation(motion, trajectory.q, trajectory.qd)
    if slip <= EXPLAINED * off:
        return ["its wheels roll: a mass, an inertia, a length or gravity looks different from the problem's"]
    scaled = scaled_rate(motion, trajectory)
    return [f"its wheels are off rolling by {slip:.2g} of their speed: look at the maps", *([scaled] if scaled else [])]
