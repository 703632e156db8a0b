"""The page of the two rides of a turning point: its document as one self-contained HTML document without a script."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from .curves import round_values
from .document import list_engine_styles, render_page
from .history import describe_unit, find_moved_kind, format_figures, format_limit, rank_moves
from .judged_quantities import format_title
from .loglog import fit_axis
from .releases_figure import LABEL_SPACING

_SIDES = ("before", "after")
_DIGITS = 6


def make_ride_pair_page(document: Mapping[str, Any], history: str) -> str:
    """Write the page of two rides side by side.

    Parameters
    ----------
    document : mapping
        As `velodrome.scenarios.history.pairs.make_pair_documents` returns them.
    history : str
        Address of the page of the history.

    Returns
    -------
    str
        A self-contained HTML document. All text from the history is escaped, and all its numbers are those of the
        document, rounded.
    """
    return render_page(
        "ride_pair.html",
        "history.css",
        document=document,
        history=history,
        facts=_list_facts(document),
        engines=list_engine_styles([document["engine"]]),
        path=draw_paths({side: document[side]["position"] for side in _SIDES}),
        distance=draw_distance(document["distance"]),
        rows=_make_rows(document),
        settings=_make_settings(document),
    )


def draw_paths(positions: Mapping[str, Sequence[Sequence[float]]]) -> dict[str, Any]:
    """Place paths seen from above, in equal scales.

    Parameters
    ----------
    positions : mapping of str to sequence of (x, y, z)

    Returns
    -------
    dict
        ``box``, the SVG's view box with x to the right and y up; ``lines``, SVG paths by name.
    """
    across = [x for path in positions.values() for x, _, _ in path]
    up = [-y for path in positions.values() for _, y, _ in path]
    size = max(max(across) - min(across), max(up) - min(up)) or 1.0
    margin = 0.04 * size
    box = (min(across) - margin, min(up) - margin, _extent(across) + 2 * margin, _extent(up) + 2 * margin)
    return {
        "box": " ".join(f"{value:.{_DIGITS}g}" for value in box),
        "lines": {
            name: "M" + "L".join(f"{round_values(x, _DIGITS)} {round_values(-y, _DIGITS)}" for x, y, _ in path)
            for name, path in positions.items()
        },
    }


def draw_distance(distance: Mapping[str, Sequence[float]]) -> dict[str, Any] | None:
    """Place distances over time, on a logarithmic axis; those that are zero have no place there.

    Returns
    -------
    dict or None
        ``line``, an SVG path; ``marks``; ``values`` and ``times``, texts at the ends of the axes with their places;
        ``grid``, the places of powers of ten. None without a distance that is not zero.
    """
    points = [(t, d) for t, d in zip(distance["time"], distance["distance"], strict=True) if d > 0]
    if not points:
        return None
    axis = fit_axis([d for _, d in points])
    first, last = distance["time"][0], distance["time"][-1]
    length = last - first or 1.0
    places = [
        (round_values(100 * (t - first) / length, _DIGITS), round_values(100 - axis.place(d), _DIGITS))
        for t, d in points
    ]
    sizes = sorted({max(d for _, d in points), min(d for _, d in points)}, reverse=True)
    if axis.place(sizes[0]) - axis.place(sizes[-1]) < LABEL_SPACING:
        sizes = sizes[:1]  # two labels would lie on each other
    return {
        "line": "M" + "L".join(f"{x:g} {y:g}" for x, y in places),
        "marks": places,
        "values": [(round_values(100 - axis.place(size), _DIGITS), f"{size:.3g}") for size in sizes],
        "grid": [100 - tick["at"] for tick in axis.ticks],
        "times": [("left", 0, f"{first:g}"), ("right", 100, f"{last:g}")],
    }


def _extent(values: Sequence[float]) -> float:
    return math.fsum((max(values), -min(values)))


def _list_facts(document: Mapping[str, Any]) -> list[tuple[str, str]]:
    def name(side: str) -> str:
        found = document[side]
        return found["release"] if found["date"] is None else f"{found['release']}, {found['date']}"

    return [
        ("Package", document["package"]),
        ("Engine", document["engine"]),
        ("Scenario", document["scenario"]),
        ("Before", name("before")),
        ("After", name("after")),
        ("Verdict", document["verdict"]),
    ]


def _make_rows(document: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the quantities, those that moved first, with their values on both sides, limit and sign."""
    moved = {move["quantity"]: move for move in rank_moves(document["moved"])}
    before, after = (document[side]["quantities"] for side in _SIDES)
    names = [*moved, *(name for name in dict.fromkeys([*after, *before]) if name not in moved)]
    return [
        {
            "title": format_title(name),
            "unit": describe_unit(name),
            "cells": [*format_figures(before.get(name), after.get(name)), format_limit(document["limits"].get(name))],
            "kind": find_moved_kind(moved[name]["status"]) if name in moved else None,
            "judged": name in document["limits"],
        }
        for name in names
        if before.get(name) is not None or after.get(name) is not None
    ]


def _make_settings(document: Mapping[str, Any]) -> list[tuple[str, Any, Any]]:
    """Return the settings of both sides; None where a release does not have one."""
    before, after = (document[side]["settings"] for side in _SIDES)
    return [(name, before.get(name), after.get(name)) for name in dict.fromkeys([*before, *after])]
