"""Whether a ride converges as its step is halved, and to the reference's ride."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from ...engines.engine import why_failed
from ..measure import SAME_BITS, extrapolate, observed_orders, order_limit
from .explain import EXPLAINED
from .maps import find_scaled_rate, violation
from .report import ConformanceCheck, make_check, skip_check
from .rides import Ride

# Factors on the step; the second for a method that chooses its steps and whose noise hides the order of the first.
LADDERS = ((4.0, 2.0, 1.0), (16.0, 8.0, 4.0))
CLAIM = "its rides converge as the step is halved, to the reference's where its wheels are bound to roll"
_LIMIT = "the order must be 1/2 or more; the extrapolated ride may be off by its noise and four times its uncertainty"
_LEAST_ORDER = 0.5  # a sequence that converges more slowly does not, or not yet
_ROOM = 4.0  # of the change by the last extrapolation, which the next powers of the step may leave


def check_order(name: str, refine: Callable[[float], Any], ride_with: Callable[[Any], Ride]) -> ConformanceCheck:
    """Check the order that rides with halved steps show, and what they converge to.

    Parameters
    ----------
    name : str
        Of the ground.
    refine : callable
        Gives settings with a factor on the step; an error where the engine takes no such step.
    ride_with : callable
        Rides with settings.
    """
    name, told = f"order on {name}", ""
    unseen: list[Ride] | None = None
    for ladder in LADDERS:
        try:
            chosen = [refine(factor) for factor in ladder]
        except Exception as error:  # of a step that there is not, or another package's code that breaks
            told = told or why_failed(error)
            continue
        try:
            rides = [ride_with(settings) for settings in chosen]
        except Exception as error:  # another package's code may break in any way
            return make_check(name, CLAIM, [f"with another step it fails: {why_failed(error)}"])
        if any(np.array_equal(one.q, other.q) for one, other in pairwise(rides)):
            return make_check(name, CLAIM, [SAME_BITS])
        first, second = (float(np.abs(b - a).max()) for a, b in pairwise(_paths(rides)))
        if order_limit(rides[-1].noise, (first, second)) is not None:
            return _judge_order(name, rides)
        unseen = rides if unseen is None else unseen
    return skip_check(name, CLAIM, told) if unseen is None else _judge_noise(name, unseen)


def _judge_noise(name: str, rides: Sequence[Ride]) -> ConformanceCheck:
    """Judge rides whose order cannot be seen: they are as near to each other as to what they converge to."""
    paths, finest = _paths(rides), rides[-1]
    moved = float(np.abs(paths[-1] - paths[0]).max())
    seen = f"its order cannot be seen: four times the step changes {moved:.2g}, its noise is {finest.noise:.2g}"
    return _judge_limit(name, rides, paths[-1], moved, seen)


def _paths(rides: Sequence[Ride]) -> list[np.ndarray]:
    """Coordinates of rides relative to the motion's sizes, as long as the shortest ride."""
    samples = min(len(ride.q) for ride in rides)
    return [ride.q[:samples] / ride.motion.sizes for ride in rides]


def _judge_order(name: str, rides: Sequence[Ride]) -> ConformanceCheck:
    """Judge rides whose steps change more than their noise."""
    paths = _paths(rides)
    order = observed_orders(paths)[-1]
    seen = f"an order of {order:.3g} is seen"
    if not order >= _LEAST_ORDER:
        return make_check(name, CLAIM, [f"{seen}: it does not converge"], tolerance=_LIMIT)
    found = extrapolate(paths)
    return _judge_limit(name, rides, found.value, found.uncertainty, seen)


def _judge_limit(
    name: str, rides: Sequence[Ride], value: np.ndarray, uncertainty: float, seen: str
) -> ConformanceCheck:
    """Judge what rides converge to, known up to an uncertainty; contacts with friction have their own limit."""
    finest = rides[-1]
    if finest.trajectory.friction is not None:
        told = "its contacts have friction: what it converges to is its own model's ride"
        return make_check(name, CLAIM, [], [seen, told])
    exact = finest.exact.q[: len(value)] / finest.motion.sizes
    off, allowed = float(np.abs(value - exact).max()), finest.noise + _ROOM * uncertainty
    if off <= allowed:
        return make_check(name, CLAIM, [], [seen, f"what it converges to is {off:.2g} from the reference"])
    wrong = f"what it converges to is {off:.2g} of the motion's size from the reference, limit {allowed:.2g}"
    return make_check(name, CLAIM, [wrong, *_explain(rides, off)], tolerance=_LIMIT)


def _explain(rides: Sequence[Ride], off: float) -> list[str]:
    """Say what a wrong limit comes from: maps if the wheels slip by as much, else another bicycle."""
    finest = rides[-1]
    motion, trajectory = finest.motion, finest.trajectory
    slip = violation(motion, trajectory.q, trajectory.qd)
    if slip <= EXPLAINED * off:
        return ["its wheels roll: a mass, an inertia, a length or gravity looks different from the problem's"]
    scaled = find_scaled_rate(finest)
    return [f"its wheels are off rolling by {slip:.2g} of their speed: look at the maps", *([scaled] if scaled else [])]
