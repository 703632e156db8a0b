"""A quantity over the releases of a package, drawn without a script: lines in an SVG, marks and labels beside it.

The axis shows values of the data only: the smallest and the largest one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from .curves import round_values

_DIGITS = 5
_PADDING = 0.06  # of the axis, beyond the smallest and the largest value
LABEL_SPACING = 15.0  # least distance of two labels [percent of the figure's height]
_LOG_FROM = 10.0  # ratio of the largest to the smallest value from which the axis is logarithmic
_LABEL_ROOM = 24.0  # least distance of two labels of releases [percent of the figure's width]
_DATE_WIDTH = 30.0  # of a release's date [percent of the figure's width]
_MOST_DIGITS = 17
_MOST_LABEL_DIGITS = 7  # of a label beside the figure, which has no room for more

Row = Mapping[str, Any]


@dataclass(frozen=True)
class _Scale:
    """A linear or logarithmic axis; places are from 0, at the top, to 100.

    Attributes
    ----------
    low, high : float
        Ends: values over the unit, or their decimal logarithms.
    unit : float
        Largest size of any value on a linear axis, so that no difference overflows; 1 on a logarithmic one.
    log : bool
    """

    low: float
    high: float
    unit: float
    log: bool

    def place(self, value: float) -> float:
        """Return the place of a value; one beyond the axis is at its end."""
        at = value / self.unit
        if self.log:
            at = math.log10(at) if at > 0 else self.low
        share = (at - self.low) / (self.high - self.low)
        return round_values(min(100.0, max(0.0, 100 * (1 - share))), _DIGITS)


def format_distinct(values: Sequence[float], least: int = 3, most: int = _MOST_DIGITS) -> list[str]:
    """Return numbers with as few digits as make different ones look different, from the least to the most."""
    for count in range(least, most + 1):
        found = [format(value, f".{count}g") for value in values]
        if len(set(found)) == len(set(values)):
            return found
    return [format(value, f".{most}g") for value in values]


def draw_releases(rows: Sequence[Row], name: str, absolute: bool = False) -> dict[str, Any] | None:
    """Place a quantity of the releases of one engine and scenario.

    Parameters
    ----------
    rows : sequence of mapping
        Rows of the document of `velodrome history`, oldest first.
    name : str
        Quantity.
    absolute : bool
        Whether the limit is one of the value itself, and not of its change.

    Returns
    -------
    dict or None
        ``log``; ``line``, an SVG path; ``marks`` with ``at``, ``up``, ``row`` (index) and ``moved``; ``bands`` with
        ``at``, ``width``, ``top`` and ``height`` of what the limit allows; ``gaps`` with ``at`` and ``width`` of
        releases that did not ride; ``labels`` of values with ``up`` and ``text``; ``releases`` with ``at``, ``row``,
        ``side`` and ``dated``, whether there is room for the date. None where no release has a value.
    """
    values = [row["quantities"].get(name) for row in rows]
    there = [value for value in values if value is not None]
    if not there:
        return None
    bands = _find_bands(rows, values, name, absolute)
    scale = _fit_scale(there, [edge for _, low, high in bands for edge in (low, high)])
    width = 100 / len(rows)

    def centre(number: int) -> float:
        return round_values((number + 0.5) * width, _DIGITS)

    def boundary(number: int) -> float:
        return round_values(number * width, _DIGITS)

    return {
        "log": scale.log,
        "line": _write_lines([None if v is None else (centre(k), scale.place(v)) for k, v in enumerate(values)]),
        "marks": [
            {"at": centre(k), "up": scale.place(value), "row": k, "moved": name in rows[k]["changed"]}
            for k, value in enumerate(values)
            if value is not None
        ],
        "bands": [
            {
                "at": boundary(k),
                "width": round_values(width, _DIGITS),
                "top": scale.place(high),
                "height": round_values(scale.place(low) - scale.place(high), _DIGITS),
            }
            for k, low, high in bands
        ],
        "gaps": [
            {"at": boundary(k), "width": round_values(width, _DIGITS)}
            for k, row in enumerate(rows)
            if row["status"] != "rode"
        ],
        "labels": _label_values(there, scale),
        "releases": _label_releases(rows, values, name, centre),
    }


def _find_bands(
    rows: Sequence[Row], values: Sequence[float | None], name: str, absolute: bool
) -> list[tuple[int, float, float]]:
    """Return (number of the row, low, high): within these a value counts as that of the last release that rode."""
    found = []
    before: float | None = None
    for number, (row, value) in enumerate(zip(rows, values, strict=True)):
        limit = row["limits"].get(name)
        if value is not None and limit is not None and absolute:
            found.append((number, 0.0, limit))
        elif value is not None and limit is not None and before is not None and row["since_previous"] is not None:
            found.append((number, before - limit, before + limit))
        if row["status"] == "rode":  # others are passed over
            before = value
    return found


def _fit_scale(values: Sequence[float], edges: Sequence[float]) -> _Scale:
    low, high = min(values), max(values)
    log = low > 0 and high / _LOG_FROM > low
    if log:
        positive = [edge for edge in edges if edge > 0]
        unit, low, high = 1.0, math.log10(min([low, *positive])), math.log10(max([high, *positive]))
    else:
        unit = max(abs(value) for value in (*values, *edges)) or 1.0
        low, high = min([low, *edges]) / unit, max([high, *edges]) / unit
    spare = _PADDING * (high - low) or 0.5
    return _Scale(low - spare, high + spare, unit, log)


def _write_lines(places: Sequence[tuple[float, float] | None]) -> str:
    """Return an SVG path through the places, broken where one is missing."""
    path, drawing = "", False
    for place in places:
        if place is not None:
            path += f"{'L' if drawing else 'M'}{place[0]:g} {place[1]:g}"
        drawing = place is not None
    return path


def _label_values(values: Sequence[float], scale: _Scale) -> list[dict[str, Any]]:
    ends = sorted({max(values), min(values)}, reverse=True)
    if len(ends) == 2 and abs(scale.place(ends[0]) - scale.place(ends[1])) < LABEL_SPACING:
        ends = ends[:1]  # two labels would lie on each other
    texts = format_distinct(ends, most=_MOST_LABEL_DIGITS)
    if len(set(texts)) < len(ends):
        ends, texts = ends[:1], texts[:1]  # they differ in digits for which there is no room
    return [{"up": scale.place(value), "text": text} for value, text in zip(ends, texts, strict=True)]


def _label_releases(
    rows: Sequence[Row], values: Sequence[float | None], name: str, centre: Any
) -> list[dict[str, Any]]:
    """Return the releases named at the axis: the first, the last, and those between that moved the quantity."""
    last = len(rows) - 1
    found: list[dict[str, Any]] = [{"at": 0.0, "row": 0, "side": "left", "dated": True}]
    if last > 0:
        found.append({"at": 100.0, "row": last, "side": "right", "dated": True})
    for number, value in enumerate(values):
        at = centre(number)
        if value is None or name not in rows[number]["changed"] or number in (0, last):
            continue
        if all(abs(at - other["at"]) >= _LABEL_ROOM for other in found):
            # The dates of the ends are beside the ends, those between are about their places.
            shares = ((other, 0.5 if other["side"] == "middle" else 1.0) for other in found if other["dated"])
            dated = all(abs(at - other["at"]) >= (share + 0.5) * _DATE_WIDTH for other, share in shares)
            found.append({"at": at, "row": number, "side": "middle", "dated": dated})
    return found
