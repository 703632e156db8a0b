"""Overlap of the rear wheel with the front wheel, both taken as full discs.

The planes of both wheels contain the steering axis. Where they differ, they meet in this axis alone, so the discs
share a point only on it: each disc covers an interval of the axis that does not depend on steer, and the discs overlap
by what their intervals have in common. Where the planes coincide, at a steer of 0 or pi, two discs of centres a
distance d apart overlap by r1 + r2 - d.

In the plane of the wheels, with the first coordinate across the steering axis and the second along it, the rear
wheel's centre is (u1, s1) and the front wheel's (u2, s2) at steer 0 and (-u2, s2) at steer pi.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from .compilation import jit
from .pose import aligned

TOUCHING = 1e-9  # [m] lengths up to this are round-off: discs that just touch are clear of each other


class WheelOverlaps(NamedTuple):
    """Overlaps of the two wheels of a bicycle at all steers, negative where they are clear of each other [m]."""

    ahead: Any  # at a steer of 0
    reversed: Any  # at a steer of pi
    turned: Any  # at all other steers, along the steering axis
    reach: Any  # largest distance of the front wheel's points from the steering axis


@jit
def measure_overlaps(c):
    """Return the `WheelOverlaps` of a bicycle with the constants ``c``."""
    a = aligned(c)
    (u1, s1), (u2, s2), r1, r2 = a.rear, a.front, a.rear_radius, a.front_radius
    ahead = r1 + r2 - np.hypot(u1 - u2, s1 - s2)
    reversed_ = r1 + r2 - np.hypot(u1 + u2, s1 - s2)
    missed = max(abs(u1) - r1, abs(u2) - r2)
    turned = -missed
    if missed <= 0:
        half1, half2 = np.sqrt(r1 * r1 - u1 * u1), np.sqrt(r2 * r2 - u2 * u2)
        turned = min(s1 + half1, s2 + half2) - max(s1 - half1, s2 - half2)
    return WheelOverlaps(ahead, reversed_, turned, abs(u2) + r2)


@jit
def find_overlap(steer, overlaps):
    """Return the overlap at a steer; within round-off of 0 or pi the wheels' planes count as one."""
    if abs(np.sin(steer)) * overlaps.reach > TOUCHING:
        return overlaps.turned
    return overlaps.ahead if np.cos(steer) > 0 else overlaps.reversed
