"""Overlap of the two wheels of a bicycle, see `velodrome.reference.kernels.wheel_overlap`.

The wheels are full discs. Frames have no known shape, so nothing is said of a wheel that would strike one.
"""

from __future__ import annotations

import math

import numpy as np

from .bicycle import Bicycle
from .fall import Ending
from .kernels.wheel_overlap import TOUCHING, find_overlap, measure_overlaps
from .kinematics import STEER, constants


def require_separate_wheels(bicycle: Bicycle, q: np.ndarray) -> None:
    """Refuse coordinates (9,) at which the wheels overlap.

    Raises
    ------
    ValueError
        If they do, with the length by which they overlap and the steer.
    """
    steer = float(q[STEER])
    overlap = find_overlap(steer, measure_overlaps(constants(bicycle)))
    if overlap > TOUCHING:
        raise ValueError(f"{describe_overlap(overlap)} at a steer of {steer:.6g} rad")


def describe_overlap(overlap: float) -> str:
    """Describe an overlap [m] of the wheels."""
    return f"the wheels overlap by {1e3 * overlap:.3g} mm"


def find_wheel_collision(bicycle: Bicycle, times: np.ndarray, q: np.ndarray) -> Ending | None:
    """Look for a collision of the wheels along the samples of a ride.

    Parameters
    ----------
    bicycle : Bicycle
    times : ndarray, shape (n,)
        [s]
    q : ndarray, shape (n, 9)
        Coordinates.

    Returns
    -------
    Ending or None
        Wheels that are apart at other steers collide where the steer passes a multiple of pi at which they overlap.
        Its time is linearly interpolated between samples; a steer that passes and returns between two samples is not
        noticed.
    """
    overlaps, steer = measure_overlaps(constants(bicycle)), q[:, STEER]
    if overlaps.turned > TOUCHING:
        return _end_ride(float(times[0]), overlaps.turned)
    if max(overlaps.ahead, overlaps.reversed) <= TOUCHING:
        return None
    for n, value in enumerate(steer):
        overlap = find_overlap(float(value), overlaps)
        if overlap > TOUCHING:
            return _end_ride(float(times[n]), overlap)
        turns = [] if n == 0 else _passed_half_turns(float(steer[n - 1]), float(value))
        for half_turn in turns:
            overlap = find_overlap(half_turn * math.pi, overlaps)
            if overlap > TOUCHING:
                share = (half_turn * math.pi - steer[n - 1]) / (value - steer[n - 1])
                return _end_ride(float(times[n - 1] + share * (times[n] - times[n - 1])), overlap)
    return None


def _passed_half_turns(before: float, now: float) -> list[int]:
    """Return the multiples of pi between two steers, in the order in which they are passed."""
    low, high = sorted((before / math.pi, now / math.pi))
    passed = list(range(math.ceil(low), math.floor(high) + 1))
    return passed if before < now else passed[::-1]


def _end_ride(time: float, overlap: float) -> Ending:
    return Ending(time, f"the wheels collide at t = {time:.6g} s: there they overlap by {1e3 * overlap:.3g} mm")
