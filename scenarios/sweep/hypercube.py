"""Samples of a Latin hypercube, by index."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from .file import Hypercube

LARGEST_TABLE = 1 << 20  # samples; more are not computed at once but each by itself
_ROUNDS = 6  # of the Feistel network; four already make a permutation that looks random to all simple tests
_WORD = (1 << 64) - 1


def draw_sample(cube: Hypercube, index: int) -> dict[str, float]:
    """Return a point of a Latin hypercube.

    Up to `LARGEST_TABLE` points are those of `scipy.stats.qmc.LatinHypercube` with the same seed. Of larger cubes, the
    slice of a point is a permutation of its index, keyed by the seed and the dimension: no point needs another, and
    memory does not grow with their number.

    Parameters
    ----------
    cube : Hypercube
    index : int
        From 0 up to ``cube.count``, exclusive.

    Returns
    -------
    dict
        Values by dotted key.
    """
    if cube.count <= LARGEST_TABLE:
        unit = _draw_table(len(cube.ranges), cube.seed, cube.count)[index].tolist()
    else:
        unit = [_draw_share(cube, dimension, index) for dimension in range(len(cube.ranges))]
    return {
        key: low + (high - low) * share for (key, (low, high)), share in zip(cube.ranges.items(), unit, strict=True)
    }


@lru_cache(maxsize=1)
def _draw_table(dimensions: int, seed: int, count: int) -> np.ndarray:
    # Imported here: scipy.stats takes half a second to load.
    from scipy.stats import qmc

    return np.asarray(qmc.LatinHypercube(dimensions, rng=seed).random(count))


def _draw_share(cube: Hypercube, dimension: int, index: int) -> float:
    """Return a coordinate in [0, 1): a random place in the slice that belongs to the index."""
    key = _mix(_mix(cube.seed & _WORD) ^ dimension)
    within = _mix(_mix(key ^ _WORD) ^ index) / 2.0**64
    return min((permute_index(index, cube.count, key) + within) / cube.count, np.nextafter(1.0, 0.0).item())


def permute_index(index: int, count: int, key: int) -> int:
    """Return the image of an index under a keyed permutation of ``range(count)``.

    A Feistel network permutes the numbers of an even number of bits; an image beyond the range is permuted again until
    it lies within, less than four times on average.
    """
    half = max(1, (max(1, count - 1).bit_length() + 1) // 2)
    mask = (1 << half) - 1
    while True:
        left, right = index >> half, index & mask
        for number in range(_ROUNDS):
            left, right = right, left ^ (_mix(key ^ _mix(number << 32 | right)) & mask)
        index = left << half | right
        if index < count:
            return index


def _mix(word: int) -> int:
    """Return a word of 64 bits each of which depends on all of the given ones (splitmix64's last step)."""
    word = (word + 0x9E3779B97F4A7C15) & _WORD
    word = ((word ^ word >> 30) * 0xBF58476D1CE4E5B9) & _WORD
    word = ((word ^ word >> 27) * 0x94D049BB133111EB) & _WORD
    return word ^ word >> 31
