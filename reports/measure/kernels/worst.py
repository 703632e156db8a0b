"""The largest of many differences relative to their limits."""

from __future__ import annotations

import math

import numpy as np

from ....reference.kernels.compilation import jit

_LARGEST = 1.7976931348623157e308  # the largest double


@jit
def find_worst(difference, limit):
    """Return (sample, part, difference, limit) where differences (n, k) are largest relative to limits (n, k).

    A difference that is not a number counts as none, and an infinite one as the largest number. Of equal shares the
    first is taken, and the first sample's first part if there are no differences.
    """
    worst, sample, part, found = 0.0, 0, 0, 0.0
    for n in range(difference.shape[0]):
        for k in range(difference.shape[1]):
            value = min(difference[n, k], _LARGEST)
            if value > 0:
                share = value / limit[n, k]
                if share > worst or math.isnan(share):
                    worst, sample, part, found = share, n, k, value
                    if math.isnan(share):
                        return sample, part, found, limit[n, k]
    if worst == 0.0:
        value = difference[0, 0]
        found = min(value, _LARGEST) if value == value else 0.0
    return sample, part, found, limit[sample, part]


@jit
def find_worst_vector(given, expected, either_sign, room, scale, round_off):
    """Return (sample, part, difference, limit) where vectors (n, k, m) differ most relative to their limits.

    The limit of sample n is ``scale room[n] + round_off``. With ``either_sign`` a vector and its opposite are the same,
    as quaternions are. Everything else is as in `find_worst`.
    """
    samples, parts, size = given.shape
    difference, limit = np.empty((samples, parts)), np.empty((samples, parts))
    for n in range(samples):
        for k in range(parts):
            apart, opposite = 0.0, 0.0
            for m in range(size):
                apart += (given[n, k, m] - expected[n, k, m]) ** 2
                opposite += (given[n, k, m] + expected[n, k, m]) ** 2
            if either_sign:
                apart = min(apart, opposite)
            difference[n, k], limit[n, k] = math.sqrt(apart), scale * room[n] + round_off
    return find_worst(difference, limit)
