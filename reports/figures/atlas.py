"""Figures of the atlas: stable circular motions over alpha and rear rate, and the growth rates of the others."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, LogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from ...reference.families import FAMILIES
from .labels import Label, name_other_bicycle, place_labels
from .style import FAMILY_COLOURS, GREY, INK, new_figure, use_style, write_figure

Columns = Mapping[str, np.ndarray]

STABLE = "#2b6cb0"
_HIGHEST = 35.0  # largest rear rate drawn [rad/s]: beyond, two families continue without an event
_PIXELS = 480
_SLOW, _FAST = 0.1, 100.0  # growth rates of the colour scale [1/s]
_NORM, _COLOURS = LogNorm(_SLOW, _FAST), "YlOrRd"
_CAUSE_LINES = {"hopf": "-", "energy": ":", "end": "--"}
_CAUSE_LABELS = {"hopf": "a complex pair crosses (Hopf)", "energy": "the energy is extreme", "end": "the family ends"}
_NOT_RIDDEN = "cannot be ridden: contact lost, or a rim inside the ground"
_TICKS = (0, 0.01, 0.05, 0.1, 0.2, 0.3, 0.4, 0.6, 0.8, 1.0)


def growth_figure(path: Path, columns: Columns, document: Mapping[str, Any]) -> None:
    """Write the growth rate over alpha and rear rate, one panel per family.

    Parameters
    ----------
    path : Path
        File to write, completely or not at all; its ending gives the format.
    columns, document : mapping
        Columns and document of the atlas, as `velodrome atlas` writes them.
    """
    with use_style(), rc_context({"hatch.linewidth": 0.4}):
        figure = new_figure(6.2)
        panels = figure.subplots(2, 2, sharex=True, sharey=True)
        for axes, family in zip(panels.flat, FAMILIES, strict=True):
            _draw_panel(axes, columns, document, family)
        for axes in panels[1]:
            axes.set_xlabel("shape of the bowl α [1/m], root scale")
        for axes in panels[:, 0]:
            axes.set_ylabel("rear-wheel rate ωr [rad/s]")
        _draw_colour_bar(figure, panels)
        figure.legend(handles=list(_growth_legend(document)), loc="outside lower center", ncols=2)
        title = "Circular motions and the growth rate of disturbances (of several at one rate the least is shown)"
        figure.suptitle(_add_bicycle(title, document), x=0.01, ha="left", fontsize=9)
        # Labels come last, since all other items move the axes.
        for axes, family in zip(panels.flat, FAMILIES, strict=True):
            _label_alphas(axes, _critical_points(document, family), "rear_rate")
        write_figure(path, figure)


def _draw_panel(axes: Axes, columns: Columns, document: Mapping[str, Any], family: int) -> None:
    alphas, rates = np.array(document["alphas"]), np.linspace(0.0, _HIGHEST, _PIXELS)
    growth, physical = sheet(columns, family, alphas, rates)
    axes.pcolormesh(alphas, rates, growth.clip(_SLOW / 2), norm=_NORM, cmap=_COLOURS, rasterized=True)
    stable = np.where(growth < 0, 1.0, np.nan)
    axes.pcolormesh(alphas, rates, stable, cmap=ListedColormap([STABLE]), rasterized=True)
    _draw_hatching(axes, alphas, rates, np.isfinite(growth) & ~physical)
    _set_root_scale(axes, float(alphas[-1]))
    axes.set_ylim(0, _HIGHEST)
    axes.set_title(f"family {family}", loc="left", color=FAMILY_COLOURS[family], fontweight="bold")
    _draw_boundaries(axes, document, family)
    _mark_touching(axes, document, family)


def _draw_colour_bar(figure: Figure, panels: np.ndarray) -> None:
    bar = figure.colorbar(ScalarMappable(_NORM, _COLOURS), ax=panels, extend="both", shrink=0.75, aspect=30, pad=0.02)
    bar.set_label("growth rate [1/s]")
    bar.ax.yaxis.set_major_locator(FixedLocator([0.1, 0.3, 1, 3, 10, 30, 100]))
    bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    bar.ax.yaxis.set_minor_locator(NullLocator())


def stable_figure(path: Path, columns: Columns, document: Mapping[str, Any]) -> None:
    """Write the stable regions, over alpha and rear rate and over alpha and lean; arguments as in `growth_figure`."""
    with use_style():
        figure = new_figure(3.9)
        panels = figure.subplots(1, 2, sharex=True)
        for axes, name, label, tag in zip(
            panels, ("rear_rate", "lean"), ("rear-wheel rate ωr [rad/s]", "lean θ₀ [rad]"), "ab", strict=True
        ):
            for boundary in document["stable"]:
                _draw_region(axes, columns, boundary, name)
            axes.set_xlabel("shape of the bowl α [1/m]")
            axes.set_ylabel(label)
            axes.set_xlim(left=0)
            axes.grid()
            axes.set_title(f"({tag})", loc="left")
        for axes, name in zip(panels, ("rear_rate", "lean"), strict=True):
            _label_alphas(axes, [b["vanishing"] for b in document["stable"] if b["vanishing"] is not None], name)
        figure.legend(handles=list(_stable_legend(columns, document)), loc="outside lower center", ncols=3)
        title = _add_bicycle("Stable circular motions of the hands-free bicycle", document)
        figure.suptitle(title, x=0.01, ha="left", fontsize=10)
        write_figure(path, figure)


def _add_bicycle(title: str, document: Mapping[str, Any]) -> str:
    """Return a title with a line for the document's bicycle, unless it is the benchmark."""
    return "\n".join(filter(None, (title, name_other_bicycle(document))))


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


def _draw_hatching(axes: Axes, alphas: np.ndarray, rates: np.ndarray, where: np.ndarray) -> None:
    if where.any():
        axes.contourf(alphas, rates, where.astype(float), levels=[0.5, 1.5], colors="none", hatches=["////"])


def _set_root_scale(axes: Axes, largest: float) -> None:
    axes.set_xscale("function", functions=(lambda x: np.sqrt(np.maximum(x, 0)), np.square))
    axes.set_xlim(0, largest)
    axes.xaxis.set_major_locator(FixedLocator([tick for tick in _TICKS if tick <= largest]))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_locator(NullLocator())


def _split_by_cause(boundary: Mapping[str, Any], side: str, name: str) -> Iterator[tuple[str, np.ndarray]]:
    """Yield one side of a region as lines of one cause each, up to the point where it vanishes: (cause, (n, 2))."""
    line = list(zip(boundary["alpha"], boundary[side][name], strict=True))
    causes = list(boundary[side]["cause"])
    if boundary["vanishing"] is not None:
        line.append((boundary["vanishing"]["alpha"], boundary["vanishing"][name]))
        causes.append(causes[-1])
    starts = [0, *(i for i in range(1, len(causes)) if causes[i] != causes[i - 1]), len(causes)]
    for start, stop in pairwise(starts):
        yield causes[start], np.array(line[start:stop])


def _draw_sides(axes: Axes, boundary: Mapping[str, Any], name: str, colour: str, width: float) -> None:
    """Draw both sides of a region; a cause that applies at a single alpha, as on the plane, is a mark."""
    for side in ("start", "end"):
        for cause, line in _split_by_cause(boundary, side, name):
            if len(line) == 1:
                axes.plot(*line.T, "s", color="white", mec=colour, mew=width, ms=4, clip_on=False, zorder=6)
            else:
                axes.plot(*line.T, color=colour, lw=width, ls=_CAUSE_LINES[cause])


def _draw_boundaries(axes: Axes, document: Mapping[str, Any], family: int) -> None:
    for boundary in document["stable"]:
        if boundary["family"] != family:
            continue
        _draw_sides(axes, boundary, "rear_rate", INK, 0.8)
        end = boundary["vanishing"]
        if end is not None:
            axes.plot(end["alpha"], end["rear_rate"], "*", color=INK, ms=8, mec="white", mew=0.6)


def _label_alphas(axes: Axes, points: Sequence[Mapping[str, Any]], name: str) -> None:
    """Write the alpha of critical points next to them."""
    labels = [Label(f"α = {point['alpha']:.3g}", (point["alpha"], point[name])) for point in points]
    for text in place_labels(axes, labels):
        text.set(fontsize=7, path_effects=[withStroke(linewidth=2, foreground="white")])


def _critical_points(document: Mapping[str, Any], family: int) -> list[Mapping[str, Any]]:
    ends = [b["vanishing"] for b in document["stable"] if b["family"] == family and b["vanishing"] is not None]
    touching = [point for point in document["touching"] if family in point["families"]]
    return [point for point in ends + touching if point["rear_rate"] < _HIGHEST]


def _mark_touching(axes: Axes, document: Mapping[str, Any], family: int) -> None:
    for point in document["touching"]:
        if family in point["families"] and point["rear_rate"] < _HIGHEST:
            axes.plot(point["alpha"], point["rear_rate"], "D", color="white", mec=INK, mew=0.8, ms=5, clip_on=False)


def _growth_legend(document: Mapping[str, Any]) -> Iterator[Any]:
    yield Patch(facecolor=STABLE, label="stable")
    yield Patch(facecolor="white", edgecolor=GREY, lw=0.6, label="the family has no such motion")
    yield Patch(facecolor="white", edgecolor=INK, lw=0.6, hatch="////", label=_NOT_RIDDEN)
    yield from _cause_legend(document)
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
    _draw_sides(axes, boundary, name, colour, 1.4)


def _draw_stable_hatching(
    axes: Axes, columns: Columns, boundary: Mapping[str, Any], name: str, where: np.ndarray
) -> None:
    """Hatch the motions of a stable region that cannot be ridden."""
    lost = {alpha: columns[name][where & (columns["alpha"] == alpha)] for alpha in boundary["alpha"]}
    reached = np.array([(alpha, inside.min(), inside.max()) for alpha, inside in lost.items() if len(inside)])
    if len(reached):
        alphas, low, high = reached.T
        axes.fill_between(alphas, low, high, facecolor="none", edgecolor=INK, hatch="////", lw=0)


def _stable_legend(columns: Columns, document: Mapping[str, Any]) -> Iterator[Any]:
    for boundary in document["stable"]:
        colour = FAMILY_COLOURS[boundary["family"]]
        yield Patch(facecolor=colour, alpha=0.4, label=f"family {boundary['family']}")
    yield from _cause_legend(document)
    if np.any(columns["stable"] & ~columns["physical"]):
        yield Patch(facecolor="white", edgecolor=INK, lw=0.6, hatch="////", label=_NOT_RIDDEN)
    yield Line2D([], [], ls="", marker="*", color=INK, ms=9, label="the stable section vanishes")


def _cause_legend(document: Mapping[str, Any]) -> Iterator[Any]:
    """Yield legend entries for what ends a section, along a line or at a single alpha."""
    pieces = [
        (cause, len(line))
        for boundary in document["stable"]
        for side in ("start", "end")
        for cause, line in _split_by_cause(boundary, side, "lean")
    ]
    for cause in sorted({cause for cause, length in pieces if length > 1}):
        yield Line2D([], [], color=INK, ls=_CAUSE_LINES[cause], label=f"end of stability: {_CAUSE_LABELS[cause]}")
    for cause in sorted({cause for cause, length in pieces if length == 1}):
        mark: dict[str, Any] = {"marker": "s", "color": "white", "mec": INK, "ms": 4, "ls": ""}
        yield Line2D([], [], **mark, label=f"on the plane alone: {_CAUSE_LABELS[cause]}")
