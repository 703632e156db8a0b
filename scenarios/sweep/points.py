"""The points of a sweep: rows of its list, times a Latin hypercube, times a grid."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np

from .file import Hypercube, SweepFile


def count_points(sweep: SweepFile) -> int:
    """Return the number of points, before equal ones are merged."""
    sizes = [len(values) for values in sweep.grid.values()]
    cube = 1 if sweep.latin_hypercube is None else sweep.latin_hypercube.count
    found = max(1, len(sweep.list)) * cube
    for size in sizes:
        found *= size
    return found


def make_points(sweep: SweepFile) -> Iterator[dict[str, Any]]:
    """Yield the changes at every point by dotted key; the grid's last key changes fastest."""
    rows = sweep.list or ({},)
    cube = [{}] if sweep.latin_hypercube is None else list(_sample_hypercube(sweep.latin_hypercube))
    for row, sample, values in product(rows, cube, product(*sweep.grid.values())):
        yield {**row, **sample, **dict(zip(sweep.grid, values, strict=True))}


def _sample_hypercube(cube: Hypercube) -> Iterator[dict[str, float]]:
    # Imported here: scipy.stats takes half a second to load.
    from scipy.stats import qmc

    unit = qmc.LatinHypercube(len(cube.ranges), rng=cube.seed).random(cube.count)
    low, high = np.array(list(cube.ranges.values())).T
    for row in low + (high - low) * unit:
        yield dict(zip(cube.ranges, row.tolist(), strict=True))
