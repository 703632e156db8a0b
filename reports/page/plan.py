"""The ride from above: trails on the ground."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...engines.engine import Trajectory
from ..drawing import RideData, make_ground
from .curves import round_values

MOST_TRAIL_POINTS = 1200  # largest number of points of a trail: about a hundred a turn
ALL_TRAIL_POINTS = 12_000  # largest number of points of all trails together: a quarter of a megabyte of the page
_DIGITS = 5  # significant digits: a millimetre in a hundred metres


def draw_trail(run: Trajectory) -> np.ndarray:
    """Return the rear wheel's contact point from above, shape (n, 2) [m]; D where there is no contact point."""
    return run.q[:, :2] if run.contact_point is None else run.contact_point[:, 0, :2]


def draw_plan(ride: RideData, names: Sequence[str]) -> dict[str, Any] | None:
    """Return trails and the ground's lines as JSON for the page's script; None where there is nothing to draw.

    Parameters
    ----------
    ride : RideData
    names : sequence of str
        Engines; the key of a trail is the index of its engine.

    Returns
    -------
    dict or None
        ``edge`` and ``lines`` as lists of [x, y]; ``trails`` as ``{t, x, y}`` by engine; ``box`` as
        [x, y, width, height], the part to show, y up [m].
    """
    paths = {name: draw_trail(run) for name, run in ride.trajectories.items()}
    places = [path[np.isfinite(path).all(axis=1)] for path in paths.values()]
    if not any(len(path) for path in places):
        return None
    ground = make_ground(ride.surface, np.concatenate(places))
    low, high = ground.edge[:, :2].min(axis=0), ground.edge[:, :2].max(axis=0)
    most = max(4, min(MOST_TRAIL_POINTS, ALL_TRAIL_POINTS // len(paths)))
    return {
        "box": [round_values(v, _DIGITS) for v in (*low, *(high - low))],
        "edge": _project_points(ground.edge),
        "lines": [_project_points(line) for line in ground.lines],
        "trails": {
            str(names.index(name)): _thin_trail(ride.trajectories[name].time, path, most)
            for name, path in paths.items()
        },
    }


def _project_points(line: np.ndarray) -> list[list[float]]:
    """Return points (n, 3) from above; only the ends of a straight line."""
    flat = line[:, :2]
    along = flat[-1] - flat[0]
    off = (flat - flat[0]) @ np.array([-along[1], along[0]])
    # Round-off of a cross product is that of the squares of its terms.
    straight = np.linalg.norm(along) > 0 and np.abs(off).max() < 1e-12 * np.square(flat).sum(axis=1).max()
    return [[round_values(x, _DIGITS), round_values(y, _DIGITS)] for x, y in (flat[[0, -1]] if straight else flat)]


def _thin_trail(time: np.ndarray, path: np.ndarray, most: int) -> dict[str, list[float]]:
    """Return every k-th sample, the last one, and the outermost one on each side."""
    finite = np.flatnonzero(np.isfinite(path).all(axis=1))
    # Six samples are reserved for the last one, the four outermost, and a remainder of the division.
    chosen = finite[:: max(1, -(-len(finite) // max(1, most - 6)))]
    if len(finite):
        outermost = [finite[path[finite, k].argmin()] for k in (0, 1)]
        outermost += [finite[path[finite, k].argmax()] for k in (0, 1)]
        chosen = np.unique([*chosen, finite[-1], *outermost])
    return {
        "t": [round_values(v) for v in time[chosen]],
        "x": [round_values(v, _DIGITS) for v in path[chosen, 0]],
        "y": [round_values(v, _DIGITS) for v in path[chosen, 1]],
    }
