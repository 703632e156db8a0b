"""Figures of the atlas: stable circular motions over alpha and rear rate, and the growth rates of the others."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, LogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from ...reference.families import FAMILIES
from ..drawing import END_LABELS, list_end_kinds
from .labels import Badge, Label, name_other_bicycle, place_labels
from .style import FAMILY_COLOURS, INK, WIDTHS, new_figure

Columns = Mapping[str, np.ndarray]

STABLE = "#2b6cb0"
_HIGHEST = 35.0  # largest rear rate drawn [rad/s]: beyond, two families continue without an event
_PIXELS = 480
_SLOW, _FAST = 0.1, 100.0  # growth rates of the colour scale [1/s]
_NORM = LogNorm(_SLOW, _FAST)
# The lightness falls from slow to fast, for readers without colour; hatching would not show on the darkest part.
_COLOURS = ListedColormap(colormaps["YlOrRd"](np.linspace(0.04, 0.82, 256)))
_ABSENT_HATCH, _STABLE_HATCH, _UNRIDDEN_HATCH = "xxxx", "....", "////"
_ABSENT_INK = "#a0a0a0"
# Of what ends stability, `velodrome.reports.drawing.list_end_kinds`. Subcritical branches are dashed.
_KIND_LINES: dict[str, Any] = {
    "supercritical": "-",
    "subcritical": (0, (4, 1.6)),
    "hopf": "-.",
    "energy": ":",
    "end": (0, (6, 1.5, 1, 1.5, 1, 1.5)),
}
_BAUTIN: dict[str, Any] = {"marker": "o", "ls": "", "mfc": "white", "mec": INK, "mew": 0.9, "ms": 5}
_ABSENT = "the family has no such motion"
_NOT_RIDDEN = "cannot be ridden: contact lost, or a rim inside the ground"
_TICKS = (0, 0.01, 0.05, 0.1, 0.2, 0.3, 0.4, 0.6, 0.8, 1.0)
_FEW_TICKS = (0, 0.05, 0.2, 0.5, 1.0)  # of narrow panels


def growth_figure(columns: Columns, document: Mapping[str, Any], width: int = 2) -> Figure:
    """Draw the growth rate over alpha and rear rate, one panel per family; call within `use_style`.

    A family's motions that are absent, stable or cannot be ridden have a hatching each, since colours alone would tell
    an absent motion from a slowly growing one to few readers.

    Parameters
    ----------
    columns, document : mapping
        Columns and document of the atlas, as `velodrome atlas` writes them.
    width : int
        Number of a journal's columns that the figure fills.

    Returns
    -------
    Figure
    """
    figure = new_figure(6.6 if width == 2 else 6.0, WIDTHS[width])
    panels = figure.subplots(2, 2, sharex=True, sharey=True)
    for axes, family in zip(panels.flat, FAMILIES, strict=True):
        _draw_panel(axes, columns, document, family)
    shape = "shape of the bowl $α$ [1/m], root scale" if width == 2 else "$α$ [1/m], root scale"
    for axes in panels[1]:
        axes.set_xlabel(shape)
    if width == 2:
        for axes in panels[:, 0]:
            axes.set_ylabel("rear-wheel rate $ω_r$ [rad/s]")
    else:
        figure.supylabel("rear-wheel rate $ω_r$ [rad/s]", fontsize=8.5)
        _write_fewer_ticks(panels[1])
    _draw_colour_bar(figure, panels, width)
    handles = list(_growth_legend(document))
    _add_legend(figure, handles, width, 2)
    title = "Circular motions and the growth rate of disturbances (of several at one rate the least is shown)"
    _add_title(figure, title, document, width)
    # Labels come last, since all other items move the axes.
    for axes, family in zip(panels.flat, FAMILIES, strict=True):
        _label_alphas(axes, _critical_points(document, family), "rear_rate", 7 if width == 2 else 6)
    return figure


def _add_legend(figure: Figure, handles: Sequence[Any], width: int, count: int) -> None:
    """Add a legend below all axes, with a number of columns, or with one where the figure is narrow."""
    for handle in handles:
        handle.set_label(fill(handle.get_label(), 120 // count if width == 2 else 52))
    figure.legend(handles=handles, loc="outside lower center", ncols=count if width == 2 else 1)


def _add_title(figure: Figure, title: str, document: Mapping[str, Any], width: int) -> None:
    """Add a title with a line for the document's bicycle, unless it is the benchmark."""
    lines = [fill(title, 110 if width == 2 else 52), name_other_bicycle(document)]
    text = "\n".join(filter(None, lines))
    figure.suptitle(text, x=0.01, ha="left", fontsize=9 if width == 2 else 8, parse_math=False)


def _write_fewer_ticks(panels: Sequence[Axes]) -> None:
    """Keep the ticks of alpha that have room in narrow panels."""
    for axes in panels:
        largest = axes.get_xlim()[1]
        axes.xaxis.set_major_locator(FixedLocator([tick for tick in _FEW_TICKS if tick <= largest]))


def _draw_panel(axes: Axes, columns: Columns, document: Mapping[str, Any], family: int) -> None:
    alphas, rates = np.array(document["alphas"]), np.linspace(0.0, _HIGHEST, _PIXELS)
    growth, physical = sheet(columns, family, alphas, rates)
    axes.patch.set(facecolor="white", edgecolor=_ABSENT_INK, hatch=_ABSENT_HATCH)  # seen where nothing is drawn
    axes.pcolormesh(alphas, rates, growth.clip(_SLOW / 2), norm=_NORM, cmap=_COLOURS, rasterized=True)
    stable = np.where(growth < 0, 1.0, np.nan)
    axes.pcolormesh(alphas, rates, stable, cmap=ListedColormap([STABLE]), rasterized=True)
    _draw_hatching(axes, alphas, rates, growth < 0, _STABLE_HATCH, "white", 0.0)
    _draw_hatching(axes, alphas, rates, np.isfinite(growth) & ~physical, _UNRIDDEN_HATCH, INK, 0.5)
    _set_root_scale(axes, float(alphas[-1]))
    axes.set_ylim(0, _HIGHEST)
    axes.set_title(f"family {family}", loc="left", color=FAMILY_COLOURS[family], fontweight="bold")
    _draw_boundaries(axes, document, family)
    _mark_touching(axes, document, family)


def _draw_colour_bar(figure: Figure, panels: np.ndarray, width: int) -> None:
    look: dict[str, Any] = {"shrink": 0.75, "aspect": 30, "pad": 0.02}
    if width == 1:
        look = {"location": "top", "aspect": 30, "pad": 0.01}
    bar = figure.colorbar(ScalarMappable(_NORM, _COLOURS), ax=panels, extend="both", **look)
    bar.set_label("growth rate [1/s]")
    axis = bar.ax.xaxis if width == 1 else bar.ax.yaxis
    axis.set_major_locator(FixedLocator([0.1, 0.3, 1, 3, 10, 30, 100]))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_locator(NullLocator())


def stable_figure(columns: Columns, document: Mapping[str, Any], width: int = 2) -> Figure:
    """Draw the stable regions, over alpha and rear rate and over alpha and lean; arguments as in `growth_figure`."""
    if width == 2:
        figure = new_figure(3.9)
        panels = figure.subplots(1, 2, sharex=True)
    else:
        figure = new_figure(6.4, WIDTHS[1])
        panels = figure.subplots(2, 1, sharex=True)
    drawn = (("rear_rate", "rear-wheel rate $ω_r$ [rad/s]", "a"), ("lean", "lean $θ_0$ [rad]", "b"))
    for axes, (name, label, tag) in zip(panels, drawn, strict=True):
        for boundary in document["stable"]:
            _draw_region(axes, columns, boundary, name)
        axes.set_ylabel(label)
        axes.set_xlim(left=0)
        axes.grid()
        axes.set_title(f"({tag})", loc="left")
    for axes in panels if width == 2 else panels[1:]:
        axes.set_xlabel("shape of the bowl $α$ [1/m]")
    _add_legend(figure, list(_stable_legend(columns, document)), width, 3)
    _add_title(figure, "Stable circular motions of the hands-free bicycle", document, width)
    for axes, (name, _, _) in zip(panels, drawn, strict=True):
        _label_alphas(axes, [b["vanishing"] for b in document["stable"] if b["vanishing"] is not None], name, 7)
        place_labels(axes, (), [_name_region(boundary, name) for boundary in document["stable"]])
    return figure


def _name_region(boundary: Mapping[str, Any], name: str) -> Badge:
    """Make a badge with a region's family, to be placed on its upper side."""
    side = max(("start", "end"), key=lambda side: boundary[side][name][0])
    line = np.column_stack([boundary["alpha"], boundary[side][name]])
    return Badge(str(boundary["family"]), line, FAMILY_COLOURS[boundary["family"]])


def sheet(columns: Columns, family: int, alphas: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Interpolate the growth rate over rear rate and alpha; of several motions of a family, take the smallest.

    Parameters
    ----------
    columns : mapping of str to ndarray
        Columns of the atlas.
    family : int
    alphas : ndarray, shape (k,)
    rates : ndarray, shape (m,)
        Rear rates, in rising order.

    Returns
    -------
    growth : ndarray, shape (m, k)
        nan where the family has no motion.
    physical : ndarray of bool, shape (m, k)
        Whether the motion can be ridden.
    """
    out, ridden = np.full((len(rates), len(alphas)), np.nan), np.zeros((len(rates), len(alphas)), bool)
    chosen = columns["family"] == family
    alpha, rate, growth, physical = (columns[n][chosen] for n in ("alpha", "rear_rate", "growth_rate", "physical"))
    starts, stops = np.searchsorted(alpha, alphas, "left"), np.searchsorted(alpha, alphas, "right")
    for column, (start, stop) in enumerate(zip(starts, stops, strict=True)):
        r, g = rate[start:stop], growth[start:stop]
        # The growth rate is interpolated between neighbours on the curve.
        low, high = np.minimum(r[:-1], r[1:]), np.maximum(r[:-1], r[1:])
        segment, at = np.nonzero((low[:, None] <= rates) & (rates < high[:, None]))
        share = (rates[at] - r[segment]) / (r[segment + 1] - r[segment])
        values = g[segment] + share * (g[segment + 1] - g[segment])
        order = np.argsort(-values)  # of several values in one place the last, the smallest, stays
        out[at[order], column] = values[order]
        ridden[at[order], column] = physical[start:stop][segment[order]]
    return out, ridden


def _draw_hatching(
    axes: Axes, alphas: np.ndarray, rates: np.ndarray, where: np.ndarray, hatch: str, colour: str, width: float
) -> None:
    if where.any():
        drawn = axes.contourf(alphas, rates, where.astype(float), levels=[0.5, 1.5], colors="none", hatches=[hatch])
        drawn.set(edgecolor=colour, linewidth=width)


def _set_root_scale(axes: Axes, largest: float) -> None:
    axes.set_xscale("function", functions=(lambda x: np.sqrt(np.maximum(x, 0)), np.square))
    axes.set_xlim(0, largest)
    axes.xaxis.set_major_locator(FixedLocator([tick for tick in _TICKS if tick <= largest]))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_locator(NullLocator())


def _split_by_kind(boundary: Mapping[str, Any], side: str, name: str) -> Iterator[tuple[str, np.ndarray]]:
    """Yield one side of a region as lines of one kind of end each, up to the point where it vanishes: (kind, (n, 2)).

    Lines of different criticality meet in the degenerate Hopf point between them.
    """
    line = list(zip(boundary["alpha"], boundary[side][name], strict=True))
    kinds = list_end_kinds(boundary[side])
    turns = [(point["alpha"], point[name]) for point in boundary["bautin"] if point["side"] == side]
    if boundary["vanishing"] is not None:
        line.append((boundary["vanishing"]["alpha"], boundary["vanishing"][name]))
        kinds.append(kinds[-1])
    starts = [0, *(i for i in range(1, len(kinds)) if kinds[i] != kinds[i - 1]), len(kinds)]
    for start, stop in pairwise(starts):
        first, last = line[max(start - 1, 0)][0], line[min(stop, len(line) - 1)][0]
        yield kinds[start], np.array(sorted([*line[start:stop], *(turn for turn in turns if first <= turn[0] <= last)]))


def draw_sides(axes: Axes, boundary: Mapping[str, Any], name: str, colour: str, width: float) -> None:
    """Draw both sides of a region; what ends it at a single alpha, as on the plane, is a mark."""
    for side in ("start", "end"):
        for kind, line in _split_by_kind(boundary, side, name):
            if len(line) == 1:
                axes.plot(*line.T, "s", color="white", mec=colour, mew=width, ms=4, clip_on=False, zorder=6)
            else:
                axes.plot(*line.T, color=colour, lw=width, ls=_KIND_LINES[kind], gid=f"{side}: {kind}")
    for point in boundary["bautin"]:
        axes.plot(point["alpha"], point[name], **_BAUTIN, zorder=6, gid="Bautin point")


def _draw_boundaries(axes: Axes, document: Mapping[str, Any], family: int) -> None:
    for boundary in document["stable"]:
        if boundary["family"] != family:
            continue
        draw_sides(axes, boundary, "rear_rate", INK, 0.8)
        end = boundary["vanishing"]
        if end is not None:
            axes.plot(end["alpha"], end["rear_rate"], "*", color=INK, ms=8, mec="white", mew=0.6)


def _label_alphas(axes: Axes, points: Sequence[Mapping[str, Any]], name: str, size: float) -> None:
    """Write the alpha of critical points next to them."""
    labels = [Label(f"$α$ = {point['alpha']:.3g}", (point["alpha"], point[name])) for point in points]
    for text in place_labels(axes, labels, size=size):
        text.set(path_effects=[withStroke(linewidth=2, foreground="white")])


def _critical_points(document: Mapping[str, Any], family: int) -> list[Mapping[str, Any]]:
    ends = [b["vanishing"] for b in document["stable"] if b["family"] == family and b["vanishing"] is not None]
    touching = [point for point in document["touching"] if family in point["families"]]
    return [point for point in ends + touching if point["rear_rate"] < _HIGHEST]


def _mark_touching(axes: Axes, document: Mapping[str, Any], family: int) -> None:
    for point in document["touching"]:
        if family in point["families"] and point["rear_rate"] < _HIGHEST:
            axes.plot(point["alpha"], point["rear_rate"], "D", color="white", mec=INK, mew=0.8, ms=5, clip_on=False)


def _growth_legend(document: Mapping[str, Any]) -> Iterator[Any]:
    yield Patch(facecolor=STABLE, edgecolor="white", lw=0, hatch=_STABLE_HATCH, label="stable")
    yield Patch(facecolor="white", edgecolor=_ABSENT_INK, lw=0, hatch=_ABSENT_HATCH, label=_ABSENT)
    yield Patch(facecolor="white", edgecolor=INK, lw=0.6, hatch=_UNRIDDEN_HATCH, label=_NOT_RIDDEN)
    yield from list_kind_handles(document["stable"])
    yield Line2D([], [], ls="", marker="*", color=INK, ms=8, label="the stable section vanishes")
    yield Line2D([], [], ls="", marker="D", color="white", mec=INK, ms=5, label="two curves touch and exchange parts")


def _draw_region(axes: Axes, columns: Columns, boundary: Mapping[str, Any], name: str) -> None:
    colour = FAMILY_COLOURS[boundary["family"]]
    alphas, low, high = [], [], []
    stable = columns["stable"] & (columns["family"] == boundary["family"])
    _draw_stable_hatching(axes, columns, boundary, name, stable & ~columns["physical"])
    for i, alpha in enumerate(boundary["alpha"]):
        inside = columns[name][stable & (columns["alpha"] == alpha)]
        reached = [*inside, boundary["start"][name][i], boundary["end"][name][i]]
        alphas.append(alpha)
        low.append(min(reached))
        high.append(max(reached))
    end = boundary["vanishing"]
    if end is not None:
        alphas, low, high = [*alphas, end["alpha"]], [*low, end[name]], [*high, end[name]]
        axes.plot(end["alpha"], end[name], "*", color=colour, ms=9, mec="white", mew=0.6, zorder=5)
    axes.fill_between(alphas, low, high, color=colour, alpha=0.25, lw=0)
    draw_sides(axes, boundary, name, colour, 1.4)


def _draw_stable_hatching(
    axes: Axes, columns: Columns, boundary: Mapping[str, Any], name: str, where: np.ndarray
) -> None:
    """Hatch the motions of a stable region that cannot be ridden."""
    lost = {alpha: columns[name][where & (columns["alpha"] == alpha)] for alpha in boundary["alpha"]}
    reached = np.array([(alpha, inside.min(), inside.max()) for alpha, inside in lost.items() if len(inside)])
    if len(reached):
        alphas, low, high = reached.T
        axes.fill_between(alphas, low, high, facecolor="none", edgecolor=INK, hatch=_UNRIDDEN_HATCH, lw=0)


def _stable_legend(columns: Columns, document: Mapping[str, Any]) -> Iterator[Any]:
    for boundary in document["stable"]:
        colour = FAMILY_COLOURS[boundary["family"]]
        yield Patch(facecolor=colour, alpha=0.4, label=f"family {boundary['family']}")
    yield from list_kind_handles(document["stable"])
    if np.any(columns["stable"] & ~columns["physical"]):
        yield Patch(facecolor="white", edgecolor=INK, lw=0.6, hatch=_UNRIDDEN_HATCH, label=_NOT_RIDDEN)
    yield Line2D([], [], ls="", marker="*", color=INK, ms=9, label="the stable section vanishes")


def list_kind_handles(boundaries: Sequence[Mapping[str, Any]]) -> Iterator[Any]:
    """Yield legend entries for what ends the sections of stable regions, along a line or at a single alpha."""
    pieces = [
        (kind, len(line))
        for boundary in boundaries
        for side in ("start", "end")
        for kind, line in _split_by_kind(boundary, side, "lean")
    ]
    for kind in _KIND_LINES:
        if any(one == kind and length > 1 for one, length in pieces):
            yield Line2D([], [], color=INK, ls=_KIND_LINES[kind], label=f"end of stability: {END_LABELS[kind]}")
    if any(boundary["bautin"] for boundary in boundaries):
        yield Line2D([], [], **_BAUTIN, label="its criticality changes (Bautin point)")
    for kind in _KIND_LINES:
        if any(one == kind and length == 1 for one, length in pieces):
            mark: dict[str, Any] = {"marker": "s", "color": "white", "mec": INK, "ms": 4, "ls": ""}
            yield Line2D([], [], **mark, label=f"on the plane alone: {END_LABELS[kind]}")
