"""Figure of many runs of a sweep: a quantity over a field, one mark for each run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ...engines.engine import REFERENCE
from ..drawing import assign_colours
from .style import GREY, INK, MARKERS, WIDTHS, darken, escape_math, label_log_axes, new_figure

_DECADES = 2.0  # span of positive values from which their axis is logarithmic
_MARGIN = 0.06  # of the axes beyond the values, as a share of their span
_EQUAL_RATIOS = 1e-6  # relative spread of the ratios of values that are spaced geometrically
_LARGEST = 1e300  # at the end of an axis
_EXPONENTS = -200.0, 200.0  # of 10 at the ends of a logarithmic axis, whose ticks go on beyond them by a third of it
_MOST_STYLES = 4
_MOST_MARKS = 5000  # of an engine; more are stored as pixels, since files would take many megabytes
_STYLES = ("-", "--", ":", "-.")


@dataclass(frozen=True)
class SweepRuns:
    """The runs of one engine.

    Attributes
    ----------
    x, y : ndarray, shape (n,)
        The field and the quantity; NaN where a run has none.
    whole : ndarray of bool, shape (n,)
        Whether a run lasted for its time: it neither fell nor ended early.
    lines : ndarray of str, shape (n,)
        What runs of equal text differ in is ``x`` alone; they are joined by a line.
    """

    x: np.ndarray
    y: np.ndarray
    whole: np.ndarray
    lines: np.ndarray


@dataclass(frozen=True)
class SweepAxis:
    """What an axis shows.

    Attributes
    ----------
    title : str
        Name and unit.
    given : bool
        Whether the values are given, as those of a scenario's field are, and no results of rides. Given values all
        rule the axis; of results only those of rides that lasted.
    categories : tuple of str
        Names of the values 0, 1, ...; empty for numbers.
    """

    title: str
    given: bool = False
    categories: tuple[str, ...] = ()


def sweep_figure(
    title: str, x_axis: SweepAxis, y_axis: SweepAxis, runs: Mapping[str, SweepRuns], joined: str = "", columns: int = 2
) -> Figure:
    """Draw one quantity of many runs over a field or another quantity; call within `use_style`.

    Results of runs that fell or ended early do not rule an axis: these runs are open marks, on the frame if they lie
    beyond it. Runs without a value are crosses at the lower edge. The legend counts both, and names engines that have
    no value in any run, as the reference has no error.

    Parameters
    ----------
    title : str
    x_axis, y_axis : SweepAxis
    runs : mapping of str to SweepRuns
        By engine.
    joined : str
        What the runs on a line have in common, for the legend.
    columns : int
        Number of a journal's columns that the figure fills.

    Returns
    -------
    Figure
    """
    figure = new_figure(3.6 if columns == 2 else 3.9, WIDTHS[columns])
    axes = figure.subplots()
    shown = {name: own for name, own in runs.items() if _drawable(own).any()}
    _set_axis(axes, "x", x_axis, _select_ruling(shown, "x", x_axis.given))
    _set_axis(axes, "y", y_axis, _select_ruling(shown, "y", y_axis.given))
    styles = _assign_styles(shown)
    shades = assign_colours(runs)
    handles: list[Line2D] = []
    for marker, (name, own) in zip(cycle(MARKERS), runs.items(), strict=False):
        if name not in shown:
            handles.append(Line2D([], [], ls="", label=f"{escape_math(name)}: no value"))
            continue
        shade = INK if name == REFERENCE else darken(shades[name])
        _draw_lines(axes, own, shade, styles)
        _draw_marks(axes, own, shade, marker)
        handles.append(Line2D([], [], color=shade, marker=marker, ms=4, ls="", label=escape_math(name)))
    if any(line.get_gid() == "line" for line in axes.lines):
        if len(styles) > 1:
            handles += [
                Line2D([], [], color=GREY, lw=0.9, ls=style, label=escape_math(text)) for text, style in styles.items()
            ]
        elif joined:
            handles.append(
                Line2D([], [], color=GREY, lw=0.9, label=fill(escape_math(joined), 60 if columns == 2 else 44))
            )
    handles += _explain_marks(axes, shown)
    axes.grid(True)
    label_log_axes(axes)
    figure.legend(handles=handles, loc="outside lower center", ncols=2 if columns == 2 else 1)
    axes.set_title(fill(title, 100 if columns == 2 else 48), loc="left", parse_math=False)
    return figure


def _drawable(runs: SweepRuns) -> np.ndarray:
    return np.isfinite(runs.x) & np.isfinite(runs.y)


def _select_ruling(runs: Mapping[str, SweepRuns], name: str, given: bool) -> np.ndarray:
    """Return the values that rule an axis: all that are given; of results those of runs that lasted, or of all if none.

    Parameters
    ----------
    runs : mapping of str to SweepRuns
    name : str
        ``x`` or ``y``.
    given : bool
        See `SweepAxis`.
    """
    if not runs:
        return np.empty(0)
    values = np.concatenate([getattr(own, name) for own in runs.values()])
    if given:
        return values[np.isfinite(values)]
    drawn = np.concatenate([_drawable(own) for own in runs.values()])
    whole = np.concatenate([own.whole for own in runs.values()])
    return values[drawn & whole] if (drawn & whole).any() else values[drawn]


def _set_axis(axes: Axes, name: str, axis: SweepAxis, values: np.ndarray) -> None:
    """Set title, scale and limits of an axis."""
    axes.set(**{f"{name}label": axis.title})
    drawn = axes.xaxis if name == "x" else axes.yaxis
    drawn.label.set_parse_math(False)
    if axis.categories:
        drawn.set_ticks(range(len(axis.categories)), [escape_math(text) for text in axis.categories])
        axes.set(**{f"{name}lim": (-0.5, len(axis.categories) - 0.5)})
        return
    if not len(values):
        return
    logarithmic = _is_logarithmic(values)
    # The results of rides that nothing holds any more are finite, but their span may be no number.
    low, high = np.clip([values.min(), values.max()], -_LARGEST, _LARGEST)
    if logarithmic:
        low, high = np.log10(low), np.log10(high)
    margin = _MARGIN * (high - low) or 0.1 * abs(high) or 1.0
    limits = low - margin, high + margin
    if logarithmic:
        axes.set(**{f"{name}scale": "log"})
        limits = tuple(10 ** np.clip(limits, *_EXPONENTS))
    axes.set(**{f"{name}lim": limits})


def _is_logarithmic(values: np.ndarray) -> bool:
    """Return whether values belong on a logarithmic axis: positive, and far apart or spaced geometrically."""
    distinct = np.unique(values)
    if distinct[0] <= 0 or len(distinct) < 3:
        return False
    powers = np.log(distinct)
    geometric = np.ptp(np.diff(powers)) < _EQUAL_RATIOS
    return bool(geometric or powers[-1] - powers[0] > _DECADES * np.log(10))


def _assign_styles(runs: Mapping[str, SweepRuns]) -> dict[str, str]:
    """Return a style for each text of the lines; none if they are too many to be told apart."""
    texts = list(dict.fromkeys(str(text) for own in runs.values() for text in own.lines))
    return dict(zip(texts, _STYLES, strict=False)) if len(texts) <= _MOST_STYLES else {}


def _draw_lines(axes: Axes, runs: SweepRuns, shade: Any, styles: Mapping[str, str]) -> None:
    """Join the runs that differ in x alone; a line is interrupted where a run is absent or did not last."""
    placed = np.flatnonzero(np.isfinite(runs.x))
    texts, line = np.unique(runs.lines[placed], return_inverse=True)
    sorted_runs = placed[np.lexsort((runs.x[placed], line))]
    counts = np.bincount(line, minlength=len(texts))
    for text, order in zip(texts, np.split(sorted_runs, np.cumsum(counts)[:-1]), strict=False):
        y = np.where(runs.whole[order], runs.y[order], np.nan)
        if np.isfinite(y).sum() > 1 and np.all(np.diff(runs.x[order]) > 0):
            axes.plot(runs.x[order], y, color=shade, lw=0.9, ls=styles.get(str(text), "-"), gid="line")


def _draw_marks(axes: Axes, runs: SweepRuns, shade: Any, marker: str) -> None:
    """Draw a mark for each run: filled if it lasted, open if not, a cross at the lower edge if it has no value."""
    drawn = _drawable(runs)
    whole, early = drawn & runs.whole, drawn & ~runs.whole
    size, many = (3.5 if len(runs.x) < 300 else 2.0), len(runs.x) > _MOST_MARKS
    look: dict[str, Any] = {"ls": "", "marker": marker, "color": shade, "ms": size, "rasterized": many}
    axes.plot(runs.x[whole], runs.y[whole], **look, gid="whole")
    if early.any():  # the layout engine would place an empty line, which is not clipped, at the figure's corner
        x, y = np.clip(runs.x[early], *axes.get_xlim()), np.clip(runs.y[early], *axes.get_ylim())
        axes.plot(x, y, **look, mfc="white", mew=0.8, clip_on=False, zorder=5, gid="early")
    absent = np.isfinite(runs.x) & ~np.isfinite(runs.y)
    if absent.any():
        x = np.clip(runs.x[absent], *axes.get_xlim())
        mark: dict[str, Any] = {"ls": "", "marker": "x", "color": shade, "ms": 3.5, "mew": 0.8}
        (crosses,) = axes.plot(x, np.full(len(x), 0.02), transform=axes.get_xaxis_transform(), **mark, gid="absent")
        crosses.set_in_layout(False)  # the layout engine would take their height for one of the data


def _explain_marks(axes: Axes, runs: Mapping[str, SweepRuns]) -> Sequence[Line2D]:
    """Return entries of the legend for open marks and crosses, with their numbers."""
    if not runs:
        return []
    early = [(own.x[chosen], own.y[chosen]) for own in runs.values() for chosen in [_drawable(own) & ~own.whole]]
    x, y = (np.concatenate(values) for values in zip(*early, strict=True))
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    outside = int(((x < left) | (x > right) | (y < low) | (y > high)).sum())
    found = []
    if len(x):
        beyond = f", {outside} beyond the frame" if outside else ""
        text = f"open: fell or ended early ({len(x)}{beyond})"
        found.append(Line2D([], [], ls="", marker="o", color=GREY, mfc="white", ms=3.5, label=text))
    absent = sum(int((~_drawable(own)).sum()) for own in runs.values())
    if absent:
        text = f"cross: without a value ({absent})"
        found.append(Line2D([], [], ls="", marker="x", color=GREY, ms=3.5, mew=0.8, label=text))
    return found
