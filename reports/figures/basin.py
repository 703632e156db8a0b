"""Figures of a basin: outcomes over two disturbances, and the rides on both sides of its edges."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from .labels import name_other_bicycle
from .style import GREY, INK, WIDTHS, new_figure

# Outcomes with their colours, of different lightness, those survived the darkest.
_COLOURS = {
    "returned": "#0072B2",
    "orbit": "#009E73",
    "elsewhere": "#CC79A7",
    "lost-contact": "#F5E6A3",
    "touched": "#D55E00",
    "fell": "#E69F00",
    "broke-off": "#6b6b6b",
    "undecided": "#1a1a1a",
    "no-start": "#ffffff",
}
_SURVIVED = ("returned", "orbit")
_INSIDE, _OUTSIDE = "#0072B2", "#D55E00"
_UNITS = {"x": "m", "y": "m", "lean": "rad", "steer": "rad"}


def _label_axis(key: str) -> str:
    return f"change of {key.replace('_', ' ')} [{_UNITS.get(key, 'rad/s')}]"


def _title(document: Mapping[str, Any], columns: int) -> str:
    title = ", ".join(part for part in (document["title"], name_other_bicycle(document)) if part)
    return fill(title, 100 if columns == 2 else 44)


def basin_map_figure(document: Mapping[str, Any], columns: int = 2) -> Figure:
    """Draw the outcomes over two disturbances, and the edge of the basin; call within `use_style`.

    Parameters
    ----------
    document : mapping
        As returned by `velodrome basin`, with a map.
    columns : int
        Number of a journal's columns that the figure fills.

    Returns
    -------
    Figure
    """
    found = document["map"]
    kinds = [kind for kind in _COLOURS if kind in found["outcomes"]]
    letters = {letter: kind for letter, kind in found["letters"].items() if kind in kinds}
    codes = np.array([[kinds.index(letters[letter]) for letter in row] for row in found["rows"]])
    x, y = (np.array(found[axis]["values"]) for axis in ("x", "y"))
    figure = new_figure(4.4 if columns == 2 else 3.9, WIDTHS[columns])
    axes = figure.subplots()
    norm = BoundaryNorm(np.arange(len(kinds) + 1) - 0.5, len(kinds))
    colours = ListedColormap([_COLOURS[kind] for kind in kinds])
    axes.pcolormesh(x, y, codes, cmap=colours, norm=norm, shading="nearest", rasterized=True)
    survived = np.isin(codes, [k for k, kind in enumerate(kinds) if kind in _SURVIVED])
    total = sum(found["outcomes"].values())
    handles: list[Any] = [
        Patch(facecolor=_COLOURS[kind], edgecolor=GREY, lw=0.4, label=f"{kind} ({found['outcomes'][kind] / total:.1%})")
        for kind in kinds
    ]
    if survived.any() and not survived.all():
        axes.contour(x, y, survived.astype(float), levels=[0.5], colors=INK, linewidths=0.7)
        handles.append(Line2D([], [], color=INK, lw=0.7, label="edge of the basin"))
    handles += _mark_edges(axes, document)
    axes.set(xlabel=_label_axis(found["x"]["key"]), ylabel=_label_axis(found["y"]["key"]))
    axes.set_title(_title(document, columns), loc="left", parse_math=False)
    figure.legend(handles=handles, loc="outside lower center", ncols=4 if columns == 2 else 2)
    return figure


def _mark_edges(axes: Axes, document: Mapping[str, Any]) -> list[Line2D]:
    """Mark the edges that were searched for along the axes of the map; return the entry of the legend."""
    keys = [document["map"][axis]["key"] for axis in ("x", "y")]
    points = [
        [edge["size"] * edge["along"].get(key, 0.0) for key in keys]
        for edge in document["edges"]
        if edge["size"] is not None and set(edge["along"]) <= set(keys)
    ]
    if not points:
        return []
    style: dict[str, Any] = {"ls": "", "marker": "o", "ms": 4.2, "mfc": "white", "mec": INK, "zorder": 6}
    axes.plot(*np.array(points).T, **style, clip_on=False)
    return [Line2D([], [], **style, label="edge by bisection")]


def drawn_edges(document: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the edges of a document on both sides of which there is a ride to draw."""
    return [
        edge
        for edge in document["edges"]
        if edge["size"] is not None and edge["inside"]["least_lean"] and edge["outside"]["least_lean"]
    ]


def edge_rides_figure(document: Mapping[str, Any], columns: int = 2) -> Figure:
    """Draw the lean of the rides on both sides of each edge, in a panel each; call within `use_style`.

    Parameters
    ----------
    document : mapping
        As returned by `velodrome basin`; with an edge that has rides on both sides.
    columns : int
        Number of a journal's columns that the figure fills.

    Returns
    -------
    Figure
    """
    edges = drawn_edges(document)
    across = 2 if columns == 2 and len(edges) > 1 else 1
    rows = -(-len(edges) // across)
    figure = new_figure(0.7 + 1.75 * rows, WIDTHS[columns])
    panels = figure.subplots(rows, across, squeeze=False, sharey=True).ravel()
    for axes in panels[len(edges) :]:
        axes.set_visible(False)
    handles: dict[str, Any] = {}
    limits = _find_limits(edges, document["circle"]["lean"])
    panels[0].set_ylim(*limits)
    for k, (axes, edge) in enumerate(zip(panels, edges, strict=False)):
        handles |= _draw_edge(axes, edge, document["circle"]["lean"], limits)
        if k % across == 0:
            axes.set_ylabel("lean [rad]")
        if k >= len(edges) - across:
            axes.set_xlabel("time [s]")
    figure.suptitle(_title(document, columns), x=0.01, ha="left", fontsize=8.5, parse_math=False)
    figure.legend(handles=list(handles.values()), loc="outside lower center", ncols=3 if columns == 2 else 2)
    return figure


def _find_limits(edges: Sequence[Mapping[str, Any]], lean: float) -> tuple[float, float]:
    """Return limits of the lean that show the rides that are survived, and the beginning of those that are lost."""
    low = min(min(edge["inside"]["least_lean"]) for edge in edges)
    high = max(max(edge["inside"]["greatest_lean"]) for edge in edges)
    room = 0.25 * max(high - low, 1e-3)
    return min(low, lean) - room, max(high, lean) + room


def _draw_edge(axes: Axes, edge: Mapping[str, Any], lean: float, limits: tuple[float, float]) -> dict[str, Any]:
    """Draw both rides of an edge, up to where they leave the limits; return the entries of the legend by their name."""
    handles: dict[str, Any] = {}
    axes.axhline(lean, color=GREY, lw=0.7, dashes=(4, 2.2))
    handles["circle"] = Line2D([], [], color=GREY, lw=0.7, dashes=(4, 2.2), label="undisturbed circle")
    state = edge["leads_to"]
    for name, colour in (("inside", _INSIDE), ("outside", _OUTSIDE)):
        side = edge[name]
        least, greatest = np.array(side["least_lean"]), np.array(side["greatest_lean"])
        time = side["lean_window"] * (np.arange(len(least)) + 0.5)
        left = np.flatnonzero((least < limits[0]) | (greatest > limits[1]))
        shown = slice(int(left[0]) + 1 if len(left) else None)
        axes.fill_between(time[shown], least[shown], greatest[shown], color=colour, alpha=0.55, lw=0.8, gid=name)
        handles[name] = Patch(color=colour, alpha=0.55, label=f"{name} the edge")
    if state is not None and state["passed_circle"] is not None:
        axes.axhline(state["passed_circle"]["lean"], color=INK, lw=0.8, dashes=(1, 1.6))
        handles["passed"] = Line2D([], [], color=INK, lw=0.8, dashes=(1, 1.6), label="unstable circle of its energy")
    if state is not None and state["orbit"] is not None:
        axes.axhspan(*state["lean_range"], facecolor="none", edgecolor=INK, lw=0.6, hatch="////", alpha=0.35)
        handles["orbit"] = Patch(
            facecolor="none", edgecolor=INK, lw=0.6, hatch="////", alpha=0.35, label="leans of the orbit it leads to"
        )
    along = ", ".join(f"{key} {value:+g}" if len(edge["along"]) > 1 else key for key, value in edge["along"].items())
    sizes = " ".join(f"{edge['size'] * value:+.6g}" for value in edge["along"].values())
    axes.set_title(f"{along} {sizes}: {edge['inside']['outcome']}, {edge['outside']['outcome']}", loc="left")
    axes.grid()
    return handles
