"""Figure of many runs of a sweep: a quantity in the cells of a plane of two fields."""

from __future__ import annotations

from dataclasses import dataclass
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from .style import INK, WIDTHS, new_figure
from .sweep import SweepAxis

_CELL_ROWS = 100  # runs aimed at in a cell: a share of them has a standard error of 5 % at most
_CELLS = (4, 120)  # fewest and most cells along an axis
_DECADES = 2.0  # span of positive values from which their colours are logarithmic
# The lightness falls monotonically, for readers without colour.
_COLOURS = ListedColormap(colormaps["YlOrRd"](np.linspace(0.0, 0.95, 256)))
_EMPTY_HATCH, _EMPTY_INK = "xxxx", "#a0a0a0"


@dataclass(frozen=True)
class CellGrid:
    """Cells of a plane of two fields.

    Attributes
    ----------
    x_edges, y_edges : ndarray, shapes (k + 1,), (m + 1,)
        Edges of the cells, rising.
    """

    x_edges: np.ndarray
    y_edges: np.ndarray

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of cells along y and x."""
        return len(self.y_edges) - 1, len(self.x_edges) - 1

    def locate(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the index of each run's cell in the flattened grid, shape (n,); values on the last edge are inside."""
        column, row = (
            np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
            for edges, values in ((self.x_edges, x), (self.y_edges, y))
        )
        return row * (len(self.x_edges) - 1) + column


@dataclass(frozen=True)
class MapRuns:
    """The runs of one engine that a map is made of.

    Attributes
    ----------
    x, y : ndarray, shape (n,)
        The two fields, finite.
    value : ndarray, shape (n,)
        The quantity, NaN where a run has none. Of a share it is 1 for runs that count and 0 for the others.
    stable : ndarray, shape (n,)
        1 where the run's motion is stable, 0 where it is not, NaN where this is not known.
    """

    x: np.ndarray
    y: np.ndarray
    value: np.ndarray
    stable: np.ndarray


@dataclass(frozen=True)
class SweepMap:
    """What a map shows.

    Attributes
    ----------
    x_axis, y_axis : SweepAxis
    value_title : str
        Name and unit of the quantity.
    share : bool
        Whether the cells show a share of their runs; if not, they show a median.
    """

    x_axis: SweepAxis
    y_axis: SweepAxis
    value_title: str
    share: bool


def make_cells(x: np.ndarray, y: np.ndarray) -> CellGrid:
    """Divide the plane of two fields into cells.

    A field with few values has a cell for each of them, with edges half-way between. Otherwise the span is divided
    evenly, so that a cell has about 100 runs where they are spread evenly.

    Parameters
    ----------
    x, y : ndarray, shape (n,)
        Finite values of both fields, n > 0.

    Returns
    -------
    CellGrid
    """
    few, most = _CELLS
    distinct = [np.unique(values) for values in (x, y)]
    fixed = [len(values) if len(values) <= most and len(values) ** 2 <= len(x) else None for values in distinct]
    wanted, own = len(x) / _CELL_ROWS, fixed[0] or fixed[1]
    count = int(np.clip(wanted**0.5 if own is None else wanted / own, few, most))
    return CellGrid(
        *(_make_edges(values, size is not None, count) for values, size in zip(distinct, fixed, strict=True))
    )


def _make_edges(values: np.ndarray, each: bool, count: int) -> np.ndarray:
    if each and len(values) == 1:
        half = 0.5 * (abs(values[0]) or 1.0)
        return np.array([values[0] - half, values[0] + half])
    if each:
        middle = 0.5 * (values[1:] + values[:-1])
        return np.array([2 * values[0] - middle[0], *middle, 2 * values[-1] - middle[-1]])
    return np.linspace(values[0], values[-1], count + 1)


def average_cells(cells: CellGrid, runs: MapRuns, share: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return each cell's share or median of the runs that have a value, and what else a map needs.

    Parameters
    ----------
    cells : CellGrid
    runs : MapRuns
    share : bool
        Whether the mean of the values is taken, which are 0 or 1; if not, their median.

    Returns
    -------
    value : ndarray, shape (m, k)
        NaN where no run of a cell has a value.
    count : ndarray of int, shape (m, k)
        Runs with a value.
    stable : ndarray, shape (m, k)
        Share of runs whose motion is stable among those of which it is known; NaN where there is none.
    """
    place, total = cells.locate(runs.x, runs.y), cells.shape[0] * cells.shape[1]
    known = np.isfinite(runs.value)
    count = np.bincount(place[known], minlength=total)
    value = np.full(total, np.nan)
    if share:
        value = _mean_by_cell(place[known], runs.value[known], count)
    else:
        order = np.lexsort((runs.value[known], place[known]))
        ordered, first = runs.value[known][order], np.cumsum(count) - count
        filled = np.flatnonzero(count)
        low, high = first[filled] + (count[filled] - 1) // 2, first[filled] + count[filled] // 2
        value[filled] = 0.5 * ordered[low] + 0.5 * ordered[high]
    judged = np.isfinite(runs.stable)
    stable = _mean_by_cell(place[judged], runs.stable[judged], np.bincount(place[judged], minlength=total))
    return value.reshape(cells.shape), count.reshape(cells.shape), stable.reshape(cells.shape)


def _mean_by_cell(place: np.ndarray, values: np.ndarray, count: np.ndarray) -> np.ndarray:
    total = np.bincount(place, weights=values, minlength=len(count))
    return np.divide(total, count, out=np.full(len(count), np.nan), where=count > 0)


def sweep_map_figure(title: str, shown: SweepMap, engine: str, runs: MapRuns, columns: int = 2) -> Figure:
    """Draw a quantity of many runs of one engine in the cells of two fields; call within `use_style`.

    A line separates cells where most motions are stable from those where most are not, if both occur.

    Parameters
    ----------
    title : str
    shown : SweepMap
    engine : str
    runs : MapRuns
    columns : int
        Number of a journal's columns that the figure fills.

    Returns
    -------
    Figure
    """
    cells = make_cells(runs.x, runs.y)
    value, count, stable = average_cells(cells, runs, shown.share)
    figure = new_figure(4.2 if columns == 2 else 4.0, WIDTHS[columns])
    axes = figure.subplots()
    axes.patch.set(facecolor="white", edgecolor=_EMPTY_INK, hatch=_EMPTY_HATCH)  # seen where no run has a value
    mesh = axes.pcolormesh(
        cells.x_edges, cells.y_edges, value, norm=_choose_norm(value, shown.share), cmap=_COLOURS, rasterized=True
    )
    bar = figure.colorbar(mesh, ax=axes, pad=0.02, aspect=30)
    bar.set_label(shown.value_title, parse_math=False)
    handles: list[Any] = _draw_stability(axes, cells, stable)
    if (count == 0).any():
        handles.append(Patch(facecolor="white", edgecolor=_EMPTY_INK, hatch=_EMPTY_HATCH, label="no run with a value"))
    axes.set(xlabel=shown.x_axis.title, ylabel=shown.y_axis.title)
    for axis in (axes.xaxis, axes.yaxis):
        axis.label.set_parse_math(False)
    handles.append(Line2D([], [], ls="", label=_describe_cells(engine, value, count, shown.share)))
    figure.legend(handles=handles, loc="outside lower center", ncols=1)
    axes.set_title(fill(title, 100 if columns == 2 else 48), loc="left", parse_math=False)
    return figure


def _choose_norm(value: np.ndarray, share: bool) -> Normalize:
    """Return the scale of the colours: from 0 to 1 for shares, logarithmic for positive values that lie far apart."""
    if share:
        return Normalize(0.0, 1.0)
    known = value[np.isfinite(value)]
    if len(known) == 0:
        return Normalize(0.0, 1.0)
    low, high = float(known.min()), float(known.max())
    return LogNorm(low, high) if low > 0 and high > low * 10**_DECADES else Normalize(low, high)


def _draw_stability(axes: Axes, cells: CellGrid, stable: np.ndarray) -> list[Any]:
    """Draw the line on which half of the motions are stable; return its entry of the legend."""
    known = stable[np.isfinite(stable)]
    if min(stable.shape) < 2 or len(known) == 0 or not known.min() < 0.5 < known.max():
        return []
    x, y = (0.5 * (edges[1:] + edges[:-1]) for edges in (cells.x_edges, cells.y_edges))
    axes.contour(x, y, stable, levels=[0.5], colors=INK, linewidths=1.1)
    return [Line2D([], [], color=INK, lw=1.1, label="line: on one side most motions are stable, on the other most not")]


def _describe_cells(engine: str, value: np.ndarray, count: np.ndarray, share: bool) -> str:
    """Describe what a cell shows, of how many runs, and how uncertain a share is."""
    filled = count > 0
    what = "share" if share else "median"
    text = f"{engine}: {what} in each of {filled.sum()} cells, {int(np.median(count[filled]))} runs in a typical one"
    if share:
        error = float(np.sqrt(value[filled] * (1 - value[filled]) / count[filled]).max())
        text += f", standard error at most {error:.2g}"
    return text
