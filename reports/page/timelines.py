"""Plots of sizes over time for pages without a script: time along a linear axis, sizes along a logarithmic one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .curves import choose_samples, round_values
from .loglog import find_coinciding, fit_axis, make_line

_MOST_POINTS = 400  # of a line: more than pixels beside another figure
_MOST_TICKS = 6
_DIGITS = 5


@dataclass(frozen=True)
class TimeAxis:
    """A linear axis from 0 to a time [s]."""

    end: float

    def place(self, time: float) -> float:
        """Return the place of a time, 0 to 100."""
        return round_values(100 * time / self.end, _DIGITS)

    @property
    def ticks(self) -> list[dict[str, Any]]:
        """Round times: ``text``, ``at`` (0 to 100), all of them ``labelled``."""
        rough = self.end / _MOST_TICKS
        power = 10.0 ** np.floor(np.log10(rough))
        step = next(float(k * power) for k in (1, 2, 5, 10) if k * power >= rough * (1 - 1e-9))
        count = int(self.end / step * (1 + 1e-9))
        return [{"text": f"{k * step:g}", "at": self.place(k * step), "labelled": True} for k in range(count + 1)]


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
    kept = {}
    for name, (time, sizes) in series.items():
        shown = np.isfinite(sizes) & (sizes > 0)
        if shown.any():
            kept[name] = (time[shown], np.log10(sizes[shown]))
    if not kept:
        return None
    ruling = [name for name in kept if name not in stops] or list(kept)
    up = fit_axis([10.0**value for name in ruling for value in (kept[name][1].min(), kept[name][1].max())])
    across = TimeAxis(max(float(time[-1]) for time, _ in series.values()) or 1.0)
    places = {}
    for name, (time, powers) in kept.items():
        chosen = choose_samples(powers, _MOST_POINTS)
        places[name] = [
            (across.place(t), round_values(100 - up.place(10.0**power), _DIGITS))
            for t, power in zip(time[chosen].tolist(), powers[chosen].tolist(), strict=True)
        ]
    groups = find_coinciding({name: found for name, found in places.items() if name not in stops})
    turns = {name: (k, len(group)) for group in groups for k, name in enumerate(group)}
    return {
        "x": across.ticks,
        "y": up.ticks,
        "lines": [
            make_line(
                names.index(name),
                "M" + "L".join(f"{x:g} {y:g}" for x, y in found),
                found,
                stops.get(name),
                turns.get(name, (0, 1)),
            )
            for name, found in places.items()
        ],
        "guide": None,
        "guide_text": "",
        "coinciding": groups,
        "marked": False,
    }
