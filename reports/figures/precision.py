"""Figure of a work-precision study: error over step and over CPU time."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ...engines.engine import REFERENCE
from ..drawing import assign_colours
from ..measure import compared_time
from .style import GREY, INK, new_figure, use_style, write_figure

_MARKERS = "os^Dvp*hX<>"
_DARKER = 0.72  # the engines' colours are chosen for a dark background


def precision_figure(path: Path, document: Mapping[str, Any]) -> None:
    """Write the figure of a study.

    Parameters
    ----------
    path : Path
        Path of the file; its ending gives the format.
    document : mapping
        As returned by `velodrome precision`.
    """
    with use_style():
        figure = new_figure(3.1)
        left, right = figure.subplots(1, 2, sharey=True)
        shades = assign_colours(document["engines"])
        for marker, (name, entry) in zip(_MARKERS, document["engines"].items(), strict=False):
            shade = INK if name == REFERENCE else tuple(_DARKER * part / 255 for part in shades[name])
            _draw_engine(left, right, name, entry, shade, marker)
        for ax, label in ((left, "step [s]"), (right, "CPU time [s]")):
            ax.set(xscale="log", yscale="log", xlabel=label)
            ax.grid(True)
        left.set_ylabel("largest position error [m]")
        handles, labels = left.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper left", ncols=max(1, min(len(labels), 3)))
        title = f"{document['scenario']}, {compared_time(document):.3g} s"
        figure.suptitle(title, x=0.99, ha="right", fontsize=8.5, parse_math=False)  # a file's name may contain a $
        write_figure(path, figure)


def _draw_engine(left: Axes, right: Axes, name: str, entry: Mapping[str, Any], shade: Any, marker: str) -> None:
    points = entry["points"]
    if not points:
        return
    step, error, cost = (np.array([p[key] for p in points]) for key in ("step", "position_error", "cpu_time"))
    order = entry["observed_order"]
    label = name if order is None else f"{name}: order {order:.2f}"
    left.plot(step, error, color=shade, marker=marker, ms=4, label=label)
    right.plot(cost, error, color=shade, marker=marker, ms=4)
    limit = entry["richardson_error"]
    if name != REFERENCE and limit is not None and limit > 0:
        # The limit of small steps, drawn at the left of the engine's own points.
        left.plot([step.min() / 2], [limit], color=shade, marker=marker, ms=4, mfc="none", ls="none")
        left.annotate(
            "limit", (step.min() / 2, limit), xytext=(5, -3), textcoords="offset points", color=GREY, fontsize=6.5
        )
