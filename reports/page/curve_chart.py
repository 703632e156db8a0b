"""Plots of curves in a plane of two numbers, for pages without a script."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .curves import round_values
from .loglog import make_chart, make_line, write_path
from .timelines import LinearAxis

_DIGITS = 5
_MARGIN = 0.03  # around the curves, relative to their extent

Curve = tuple[np.ndarray, np.ndarray]


def draw_plane(
    curves: Mapping[str, Curve],
    names: Sequence[str],
    *,
    box: tuple[float, float, float, float] | None = None,
    strong: Mapping[str, Sequence[Curve]] | None = None,
    spots: Sequence[tuple[str, float, float, str]] = (),
    bands: Sequence[tuple[float, float]] = (),
) -> dict[str, Any]:
    """Place curves on two linear axes.

    Parameters
    ----------
    curves : mapping of str to (ndarray, ndarray)
        Coordinates of each curve's points; a curve is interrupted where they are not finite.
    names : sequence of str
        Names in the order of the page's colours.
    box : (float, float, float, float), optional
        Least and largest value across, then up; what lies beyond is cut. All curves, with a margin, if not given.
    strong : mapping of str to sequence of (ndarray, ndarray), optional
        Parts of curves that are drawn wide.
    spots : sequence of (str, float, float, str)
        Points: the curve they belong to, their coordinates and a text.
    bands : sequence of (float, float)
        Ranges across that are shaded.

    Returns
    -------
    dict
        As `velodrome.reports.page.loglog.make_chart` returns it.
    """
    left, right, low, high = _fit_box(curves) if box is None else box
    across, up = LinearAxis(left, right), LinearAxis(low, high)

    def place(x: float, y: float) -> tuple[float, float]:
        return across.place(x), round_values(100 - up.place(y), _DIGITS)

    def trace(curve: Curve) -> str:
        x, y = curve
        absent = np.flatnonzero(~(np.isfinite(x) & np.isfinite(y)))
        parts = (np.setdiff1d(part, absent) for part in np.split(np.arange(len(x)), absent))
        return "".join(write_path([place(float(x[k]), float(y[k])) for k in part]) for part in parts if len(part))

    inside = [spot for spot in spots if left <= spot[1] <= right and low <= spot[2] <= high]
    return make_chart(
        across.ticks,
        up.ticks,
        [make_line(names.index(name), trace(curve), []) for name, curve in curves.items()],
        strong=[(names.index(name), trace(part)) for name, parts in (strong or {}).items() for part in parts],
        spots=[(names.index(name), *place(x, y), text) for name, x, y, text in inside],
        bands=[
            (across.place(max(start, left)), across.place(min(end, right)))
            for start, end in bands
            if start < right and end > left
        ],
    )


def _fit_box(curves: Mapping[str, Curve]) -> tuple[float, float, float, float]:
    sides: list[float] = []
    for axis in (0, 1):
        values = np.concatenate([curve[axis] for curve in curves.values()])
        values = values[np.isfinite(values)]
        low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
        margin = _MARGIN * (high - low) or 0.5
        sides += [low - margin, high + margin]
    return sides[0], sides[1], sides[2], sides[3]
