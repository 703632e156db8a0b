"""Plots with two logarithmic axes, drawn without a script: lines in an SVG, marks and labels beside it in HTML.

Lines are stretched with the page; marks and labels keep their size at any width.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from .curves import round_values

_MOST_LABELS = 8  # on an axis; further powers of ten have lines of the grid without a label
_DIGITS = 5
_TURN = 9  # length of the dashes of lines that lie on one another [pixels]
_ALIKE = 1.0  # per cent of an axis: points closer than this are covered by one another's marks

Points = Sequence[tuple[float, float]]


@dataclass(frozen=True)
class DecadeAxis:
    """A logarithmic axis over whole decades, from 10^low to 10^high."""

    low: int
    high: int

    def place(self, value: float) -> float:
        """Return the place of a positive value, 0 at the low end and 100 at the high end."""
        return round_values(100 * (math.log10(value) - self.low) / (self.high - self.low), _DIGITS)

    @property
    def ticks(self) -> list[dict[str, Any]]:
        """Powers of ten: ``power``, ``at`` (0 to 100) and whether it is ``labelled``."""
        span = self.high - self.low
        every = -(-span // _MOST_LABELS)
        return [
            {"power": power, "at": round_values(100 * (power - self.low) / span, _DIGITS), "labelled": k % every == 0}
            for k, power in enumerate(range(self.low, self.high + 1))
        ]


def fit_axis(values: Sequence[float]) -> DecadeAxis:
    """Return the shortest axis that holds positive values."""
    low, high = math.floor(math.log10(min(values))), math.ceil(math.log10(max(values)))
    return DecadeAxis(low, high if high > low else low + 1)


def draw_loglog(
    series: Mapping[str, Points], names: Sequence[str], guide: Points = (), guide_text: str = ""
) -> dict[str, Any] | None:
    """Place the points of engines on two logarithmic axes.

    Parameters
    ----------
    series : mapping of str to sequence of (float, float)
        Points by engine; those that are not positive are left out, as a logarithm has no place for them.
    names : sequence of str
        Engines in the order of the page's colours.
    guide : sequence of (float, float)
        A further line, such as a law; its ends are cut to the axes of the points.
    guide_text : str
        Name of that line.

    Returns
    -------
    dict or None
        ``x`` and ``y`` ticks; ``lines`` as `make_line` returns them; ``guide``, an SVG path or None, and its
        ``guide_text``; ``coinciding``, groups of engines whose marks cover each other; ``marked``, True. None without a
        point.
    """
    kept = {
        name: [(x, y) for x, y in points if x > 0 and y > 0 and math.isfinite(x) and math.isfinite(y)]
        for name, points in series.items()
    }
    kept = {name: points for name, points in kept.items() if points}
    if not kept:
        return None
    across = fit_axis([x for points in kept.values() for x, _ in points])
    up = fit_axis([y for points in kept.values() for _, y in points])

    def trace(points: Points) -> list[tuple[float, float]]:
        return [(across.place(x), round_values(100 - up.place(y), _DIGITS)) for x, y in points]

    marks = {name: trace(points) for name, points in kept.items()}
    return make_chart(
        across.ticks,
        up.ticks,
        [make_line(names.index(name), write_path(places), places) for name, places in marks.items()],
        marked=True,
        guide=write_path(trace(guide)) if guide else None,
        guide_text=guide_text,
        coinciding=find_coinciding(marks),
    )


def make_chart(
    x: Sequence[Mapping[str, Any]], y: Sequence[Mapping[str, Any]], lines: Sequence[Mapping[str, Any]], **parts: Any
) -> dict[str, Any]:
    """Return a plot for the macro ``plot`` of charts.html.

    Parameters
    ----------
    x, y : sequence of mapping
        Ticks.
    lines : sequence of mapping
        As `make_line` returns them.
    **parts
        ``marked``: whether the points of lines have marks. ``guide``, an SVG path, and ``guide_text``. ``coinciding``,
        groups of names whose lines lie on one another. ``bands``, pairs of places across. ``strong``, further parts of
        lines that are drawn wide, as pairs of an engine's index and an SVG path. ``spots``, single points as
        (engine's index, place across, place down, text).
    """
    unused: dict[str, Any] = {"marked": False, "guide": None, "guide_text": ""}
    unused |= {"coinciding": [], "bands": [], "strong": [], "spots": []}
    assert parts.keys() <= unused.keys()
    return {"x": x, "y": y, "lines": lines} | unused | parts


def make_line(
    engine: int, path: str, marks: Points, stopped: str | None = None, turn: tuple[int, int] = (0, 1)
) -> dict[str, Any]:
    """Return a line for the macro ``plot`` of charts.html.

    Parameters
    ----------
    engine : int
        Index of the engine.
    path : str
        SVG path, y down.
    marks : sequence of (float, float)
        Places of its points [per cent], y down; the last one is where it stops.
    stopped : str, optional
        How the ride ended before its time, which is marked.
    turn : (int, int)
        Its number and the size of the group of lines that lie on one another: they are drawn in turns.
    """
    number, size = turn
    turns = f"{_TURN} {_TURN * (size - 1)}" if size > 1 else None
    return {
        "engine": engine,
        "path": path,
        "marks": marks,
        "stopped": stopped,
        "turns": turns,
        "offset": -_TURN * number,
    }


def find_coinciding(marks: Mapping[str, Points]) -> list[list[str]]:
    """Return groups of engines whose marks all lie at those of the group's first."""
    groups: list[list[str]] = []
    for name, places in marks.items():
        for group in groups:
            first = marks[group[0]]
            if len(first) == len(places) and all(
                max(abs(x - u), abs(y - v)) < _ALIKE for (x, y), (u, v) in zip(first, places, strict=True)
            ):
                group.append(name)
                break
        else:
            groups.append([name])
    return [group for group in groups if len(group) > 1]


def write_path(places: Points) -> str:
    """Return places [per cent], joined by straight lines, as an SVG path."""
    return "M" + "L".join(f"{x:g} {y:g}" for x, y in places)
