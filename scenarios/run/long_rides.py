"""Evaluation of rides that are too long to be kept in memory with all others of their run."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...engines.disk_arrays import is_long, slice_blocks, write_disk_arrays
from ...engines.engine import Trajectory
from ...reference.bicycle import Bicycle
from ...reference.surface import Surface
from ...reports.measure import evaluate_ride

# What `evaluate_ride` replaces.
_EVALUATED = (
    "body_position",
    "body_quaternion",
    "contact_point",
    "gap",
    "slip",
    "kinetic_energy",
    "potential_energy",
)


def evaluate_stored_ride(trajectory: Trajectory, bicycle: Bicycle, surface: Surface, folder: Path | None) -> Trajectory:
    """Return what `velodrome.reports.measure.evaluate_ride` returns, of a long ride in a temporary file in ``folder``.

    Without a folder everything is computed in memory.
    """
    if folder is None or not is_long(trajectory):
        return evaluate_ride(trajectory, bicycle, surface)

    def evaluate_blocks() -> Iterator[dict[str, np.ndarray]]:
        for rows in slice_blocks(len(trajectory.time)):
            part = evaluate_ride(trajectory.part(rows), bicycle, surface)
            yield {name: getattr(part, name) for name in _EVALUATED}

    return replace(trajectory, **write_disk_arrays(evaluate_blocks(), len(trajectory.time), folder))
