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
_MARGIN = 0.08  # around the trails, relative to their longer side
_SHORTEST_SIDE = 0.3  # relative to the longer one: a straight ride has ground beside it
_DIGITS = 5  # significant digits: a millimetre in a hundred metres


def draw_trail(run: Trajectory) -> np.ndarray:
    """Return the rear wheel's contact point from above, shape (n, 2) [m]; D where there is no contact point."""
    return run.q[:, :2] if run.contact_point is None else run.contact_point[:, 0, :2]


def draw_plan(ride: RideData, names: Sequence[str], ruling: Sequence[str]) -> dict[str, Any] | None:
    """Return trails and the ground's lines as JSON for the page's script; None where there is nothing to draw.

    Parameters
    ----------
    ride : RideData
    names : sequence of str
        Engines; the key of a trail is the index of its engine.
    ruling : sequence of str
        Engines whose trails the part to show holds; trails of others may leave it. All where these have none.

    Returns
    -------
    dict or None
        ``edge`` and ``lines`` as lists of [x, y]; ``trails`` as ``{t, x, y}`` by engine; ``box`` as
        [x, y, width, height], the part to show, y up [m], which the ground may exceed.
    """
    paths = {name: draw_trail(run) for name, run in ride.trajectories.items()}
    places = {name: path[np.isfinite(path).all(axis=1)] for name, path in paths.items()}
    shown = [places[name] for name in ruling if len(places[name])] or [path for path in places.values() if len(path)]
    if not shown:
        return None
    ridden = np.concatenate(shown)
    ground = make_ground(ride.surface, ridden)
    corner, size = _frame_places(ridden)
    most = max(4, min(MOST_TRAIL_POINTS, ALL_TRAIL_POINTS // len(paths)))
    return {
        "box": [round_values(v, _DIGITS) for v in (*corner, *size)],
        "edge": _project_points(ground.edge),
        "lines": [_project_points(line) for line in ground.lines],
        "trails": {
            str(names.index(name)): _thin_trail(ride.trajectories[name].time, path, most)
            for name, path in paths.items()
        },
    }


def _frame_places(places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the least corner and the size of a box around places (n, 2), with a margin and no thin side."""
    low, high = places.min(axis=0), places.max(axis=0)
    longest = float((high - low).max()) or 1.0
    size = np.maximum(high - low, _SHORTEST_SIDE * longest) + 2 * _MARGIN * longest
    return (low + high - size) / 2, size


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
