"""Figure of a work-precision study: error over step and over CPU time."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ...engines.engine import REFERENCE
from ..drawing import assign_colours
from ..measure import compared_time
from .style import GREY, INK, MARKERS, WIDTHS, darken, escape_math, label_log_axes, new_figure


def precision_figure(document: Mapping[str, Any], columns: int = 2) -> Figure:
    """Draw the figure of a study; call within `use_style`.

    Parameters
    ----------
    document : mapping
        As returned by `velodrome precision`.
    columns : int
        Number of a journal's columns that the figure fills.

    Returns
    -------
    Figure
    """
    if columns == 2:
        figure = new_figure(3.4)
        by_step, by_cost = figure.subplots(1, 2, sharey=True)
    else:
        figure = new_figure(5.6, WIDTHS[1])
        by_step, by_cost = figure.subplots(2, 1, sharey=True)
    shades = assign_colours(document["engines"])
    for marker, (name, entry) in zip(cycle(MARKERS), document["engines"].items(), strict=False):
        shade = INK if name == REFERENCE else darken(shades[name])
        _draw_engine(by_step, by_cost, name, entry, shade, marker)
    for ax, label, tag in ((by_step, "step [s]", "a"), (by_cost, "CPU time [s]", "b")):
        ax.set(xscale="log", yscale="log", xlabel=label)
        ax.set_title(f"({tag})", loc="left")
        ax.grid(True)
        if columns == 1 or ax is by_step:
            ax.set_ylabel("largest position error [m]")
    for ax in (by_step, by_cost):
        label_log_axes(ax)
    handles, _ = by_step.get_legend_handles_labels()
    if any(line.get_gid() == "limit" for line in by_step.lines):
        mark: dict[str, Any] = {"ls": "", "marker": "o", "ms": 4, "mfc": "none", "color": GREY}
        handles.append(Line2D([], [], **mark, label="open: limit of small steps"))
    figure.legend(
        handles=handles, loc="outside lower center", ncols=max(1, min(len(handles), 3 if columns == 2 else 1))
    )
    title = f"{document['scenario']}, {compared_time(document):.3g} s"
    by_cost.set_title(title, loc="right", parse_math=False)  # a file's name may contain a $
    return figure


def _draw_engine(by_step: Axes, by_cost: Axes, name: str, entry: Mapping[str, Any], shade: Any, marker: str) -> None:
    points = entry["points"]
    if not points:
        return
    step, error, cost = (np.array([p[key] for p in points]) for key in ("step", "position_error", "cpu_time"))
    order = entry["observed_order"]
    label = escape_math(name) if order is None else f"{escape_math(name)}: order {order:.2f}"
    by_step.plot(step, error, color=shade, marker=marker, ms=4, label=label)
    by_cost.plot(cost, error, color=shade, marker=marker, ms=4)
    limit = entry["richardson_error"]
    if name != REFERENCE and limit is not None and limit > 0:
        # The limit of small steps, drawn at the left of the engine's own points.
        by_step.plot([step.min() / 2], [limit], color=shade, marker=marker, ms=4, mfc="none", ls="none", gid="limit")
