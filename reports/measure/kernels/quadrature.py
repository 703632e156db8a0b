"""Integrals between samples of the polynomials through the nearest samples."""

from __future__ import annotations

import numpy as np

from ....reference.kernels.arrays import copy_array
from ....reference.kernels.compilation import jit
from ....reference.kernels.linear import solve

_SAME = 1e-9  # intervals: stencils whose nodes agree so far share their weights


@jit
def integrate_samples(time, values, samples, out):
    """Fill ``out`` (n - 1, k) with the integrals of ``values`` (n, k) between samples at ``time`` (n,).

    The polynomial of an interval passes through the ``samples`` samples nearest to it. Its weights solve
    sum_s w_s x_s^i = 1 / (i + 1), i = 0, 1, ..., with nodes x_s in intervals from the interval's begin.
    """
    n, k = values.shape
    samples = min(samples, n)
    nodes, known, weights = np.empty(samples), np.full(samples, np.inf), np.empty(samples)
    powers = np.empty((samples, samples))
    for m in range(n - 1):
        interval = time[m + 1] - time[m]
        first = min(max(m - (samples // 2 - 1), 0), n - samples)
        same = True
        for s in range(samples):
            nodes[s] = (time[first + s] - time[m]) / interval
            same = same and abs(nodes[s] - known[s]) <= _SAME
        # On an even grid all stencils except those at the ends are the same.
        if not same:
            copy_array(nodes, known)
            for i in range(samples):
                weights[i] = 1 / (i + 1)
                for s in range(samples):
                    powers[i, s] = nodes[s] ** i
            solve(powers, weights, samples)
        for j in range(k):
            total = 0.0
            for s in range(samples):
                total += weights[s] * values[first + s, j]
            out[m, j] = interval * total
