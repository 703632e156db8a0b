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
from .mistakes import find_mistake
from .report import ConformanceCheck, make_check, skip_check
from .rides import Ride

# Factors on the step. The second ladder is for adaptive methods whose noise hides the order on the first one.
LADDERS = ((4.0, 2.0, 1.0), (16.0, 8.0, 4.0))
CLAIM = "its rides converge as the step is halved, to the reference's ride if its wheels are constrained to roll"
_LIMIT = "the order must be 1/2 or more; the extrapolated ride may be off by its noise and four times its uncertainty"
_LEAST_ORDER = 0.5  # below it, a sequence does not converge, or not yet
_ROOM = 4.0  # factor on the change by the last extrapolation, for the next powers of the step


def check_order(name: str, refine: Callable[[float], Any], ride_with: Callable[[Any], Ride]) -> ConformanceCheck:
    """Check the order of convergence of rides with halved steps, and their limit.

    Parameters
    ----------
    name : str
        Name of the ground.
    refine : callable
        Returns settings with the step multiplied by a factor; raises if the engine does not accept the step.
    ride_with : callable
        Simulates the motion with settings.
    """
    name, reason = f"order on {name}", ""
    noisy_rides: list[Ride] | None = None
    for ladder in LADDERS:
        try:
            chosen = [refine(factor) for factor in ladder]
        except Exception as error:  # no such step, or another package's code breaks
            reason = reason or why_failed(error)
            continue
        try:
            rides = [ride_with(settings) for settings in chosen]
        except Exception as error:  # another package's code may break in any way
            return make_check(name, CLAIM, [f"with another step it fails: {why_failed(error)}"])
        if any(np.array_equal(coarse.q, fine.q) for coarse, fine in pairwise(rides)):
            return make_check(name, CLAIM, [SAME_BITS])
        first, second = (float(np.abs(b - a).max()) for a, b in pairwise(_scale_paths(rides)))
        if order_limit(rides[-1].noise, (first, second)) is not None:
            return _judge_order(name, rides)
        noisy_rides = rides if noisy_rides is None else noisy_rides
    return skip_check(name, CLAIM, reason) if noisy_rides is None else _judge_noise(name, noisy_rides)


def _judge_noise(name: str, rides: Sequence[Ride]) -> ConformanceCheck:
    """Judge rides whose noise hides the order: the finest one stands for their limit."""
    paths, finest = _scale_paths(rides), rides[-1]
    change = float(np.abs(paths[-1] - paths[0]).max())
    order_text = f"its order cannot be seen: four times the step changes {change:.2g}, its noise is {finest.noise:.2g}"
    return _judge_limit(name, rides, paths[-1], change, order_text)


def _scale_paths(rides: Sequence[Ride]) -> list[np.ndarray]:
    """Return the coordinates of rides relative to the motion's sizes, cut to the length of the shortest ride."""
    samples = min(len(ride.q) for ride in rides)
    return [ride.q[:samples] / ride.motion.sizes for ride in rides]


def _judge_order(name: str, rides: Sequence[Ride]) -> ConformanceCheck:
    """Judge rides that differ by more than their noise."""
    paths = _scale_paths(rides)
    order = observed_orders(paths)[-1]
    order_text = f"an order of {order:.3g} is seen"
    if not order >= _LEAST_ORDER:
        mistake = find_mistake(rides[-1])
        wrong = [f"{order_text}: it does not converge", *([] if mistake is None else [mistake])]
        return make_check(name, CLAIM, wrong, tolerance=_LIMIT)
    found = extrapolate(paths)
    return _judge_limit(name, rides, found.value, found.uncertainty, order_text)


def _judge_limit(
    name: str, rides: Sequence[Ride], value: np.ndarray, uncertainty: float, order_text: str
) -> ConformanceCheck:
    """Compare the limit of rides, known up to an uncertainty, with the reference.

    Contacts with friction are another model, which converges to its own limit. Their rides fail only if a mistake in
    the ground or the bicycle explains the difference.
    """
    finest = rides[-1]
    if finest.trajectory.friction is not None:
        mistake = find_mistake(finest)
        if mistake is not None:
            return make_check(name, CLAIM, [mistake], tolerance=_LIMIT)
        limit_text = "its contacts have friction: what it converges to is its own model's ride"
        return make_check(name, CLAIM, [], [order_text, limit_text])
    exact = finest.exact.q[: len(value)] / finest.motion.sizes
    off, allowed = float(np.abs(value - exact).max()), finest.noise + _ROOM * uncertainty
    if off <= allowed:
        return make_check(name, CLAIM, [], [order_text, f"what it converges to is {off:.2g} from the reference"])
    wrong = f"what it converges to is {off:.2g} of the motion's size from the reference, limit {allowed:.2g}"
    return make_check(name, CLAIM, [wrong, *_explain(rides, off)], tolerance=_LIMIT)


def _explain(rides: Sequence[Ride], off: float) -> list[str]:
    """Explain a wrong limit: by a wrong ground or bicycle, or by maps if the wheels slip as much."""
    finest = rides[-1]
    mistake = find_mistake(finest)
    if mistake is not None:
        return [mistake]
    motion, trajectory = finest.motion, finest.trajectory
    slip = violation(motion, trajectory.q, trajectory.qd)
    if slip <= EXPLAINED * off:
        return ["its wheels roll: a mass, an inertia, a length or gravity looks different from the problem's"]
    scaled = find_scaled_rate(finest)
    return [f"its wheels are off rolling by {slip:.2g} of their speed: look at the maps", *([scaled] if scaled else [])]
