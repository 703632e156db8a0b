"""Plots of sizes over time, or over another number, for pages without a script: sizes along a logarithmic axis."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .curves import choose_samples, round_values
from .loglog import DecadeAxis, find_coinciding, fit_axis, make_chart, make_line, write_path

_MOST_POINTS = 400  # of a line: more than pixels beside another figure
_MOST_TICKS = 6
_DIGITS = 5
_WIDE = 100.0  # values of a larger ratio have a logarithmic axis


@dataclass(frozen=True)
class LinearAxis:
    """A linear axis from one number to a larger one."""

    start: float
    end: float

    def place(self, value: float) -> float:
        """Return the place of a value, 0 at the start and 100 at the end."""
        return round_values(100 * (value - self.start) / (self.end - self.start), _DIGITS)

    @property
    def ticks(self) -> list[dict[str, Any]]:
        """Round values: ``text``, ``at`` (0 to 100), all of them ``labelled``."""
        rough = (self.end - self.start) / _MOST_TICKS
        power = 10.0 ** np.floor(np.log10(rough))
        step = next(float(k * power) for k in (1, 2, 5, 10) if k * power >= rough * (1 - 1e-9))
        first, last = math.ceil(self.start / step - 1e-9), math.floor(self.end / step + 1e-9)
        return [
            {"text": f"{k * step:.6g}", "at": self.place(k * step), "labelled": True} for k in range(first, last + 1)
        ]


def draw_over_time(
    series: Mapping[str, tuple[np.ndarray, np.ndarray]], names: Sequence[str], stops: Mapping[str, str]
) -> dict[str, Any] | None:
    """Place sizes of engines over time.

    Parameters
    ----------
    series : mapping of str to (ndarray, ndarray)
        Times [s] and sizes by engine; sizes that are not positive are left out, as a logarithm has no place for them.
    names : sequence of str
        Engines in the order of the page's colours.
    stops : mapping of str to str
        How the rides of engines ended before their time. These do not rule the axes unless they are alone.

    Returns
    -------
    dict or None
        As `velodrome.reports.page.loglog.draw_loglog` returns it. None without a positive size.
    """
    end = max((float(time[-1]) for time, _ in series.values()), default=0.0)
    return _draw_sizes(series, LinearAxis(0.0, end or 1.0), names, stops, marked=False)


def draw_over_values(
    series: Mapping[str, tuple[np.ndarray, np.ndarray]], names: Sequence[str]
) -> dict[str, Any] | None:
    """Place sizes of engines over a number, with a mark for each.

    Parameters
    ----------
    series : mapping of str to (ndarray, ndarray)
        Rising values and sizes by engine; sizes that are not positive are left out.
    names : sequence of str
        Engines in the order of the page's colours.

    Returns
    -------
    dict or None
        As `draw_over_time`. The axis of the values is logarithmic if they are positive and span two decades. None
        without a positive size, or where all values are the same.
    """
    values = [float(value) for found, _ in series.values() for value in found[[0, -1]]]
    if not values or min(values) == max(values):
        return None
    wide = min(values) > 0 and max(values) >= _WIDE * min(values)
    across = fit_axis(values) if wide else LinearAxis(min(values), max(values))
    return _draw_sizes(series, across, names, {}, marked=True)


def _draw_sizes(
    series: Mapping[str, tuple[np.ndarray, np.ndarray]],
    across: LinearAxis | DecadeAxis,
    names: Sequence[str],
    stops: Mapping[str, str],
    marked: bool,
) -> dict[str, Any] | None:
    kept = {}
    for name, (values, sizes) in series.items():
        shown = np.isfinite(sizes) & (sizes > 0)
        if shown.any():
            kept[name] = (values[shown], np.log10(sizes[shown]))
    if not kept:
        return None
    ruling = [name for name in kept if name not in stops] or list(kept)
    up = fit_axis([10.0**power for name in ruling for power in (kept[name][1].min(), kept[name][1].max())])
    places = {}
    for name, (values, powers) in kept.items():
        chosen = choose_samples(powers, _MOST_POINTS)
        places[name] = [
            (across.place(value), round_values(100 - up.place(10.0**power), _DIGITS))
            for value, power in zip(values[chosen].tolist(), powers[chosen].tolist(), strict=True)
        ]
    groups = find_coinciding({name: found for name, found in places.items() if name not in stops})
    turns = {name: (k, len(group)) for group in groups for k, name in enumerate(group)}
    return make_chart(
        across.ticks,
        up.ticks,
        [
            make_line(names.index(name), write_path(found), found, stops.get(name), turns.get(name, (0, 1)))
            for name, found in places.items()
        ],
        marked=marked,
        coinciding=groups,
    )
