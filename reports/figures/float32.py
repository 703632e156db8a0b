"""Figure of what float32 costs: distances from the ride in double precision over time, and what explains them."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import cycle
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ..drawing import assign_colours
from .style import GREY, MARKERS, WIDTHS, darken, escape_math, label_log_axes, new_figure


def float32_figure(document: Mapping[str, Any], columns: int = 2) -> Figure:
    """Draw the figure of a document of `velodrome float32`; call within `use_style`.

    Marks are the measured root mean squares, lines of the same colour what the last digits of the state predict.

    Parameters
    ----------
    document : mapping
    columns : int
        Number of a journal's columns that the figure fills.

    Returns
    -------
    Figure
    """
    rows = [
        (f"{name}, {title}", found["points"])
        for name, entry in document["engines"].items()
        for title, found in entry["variants"].items()
    ]
    figure = new_figure(3.1 if columns == 2 else 4.0, WIDTHS[columns])
    ax = figure.subplots()
    shades = assign_colours([label for label, _ in rows])
    for marker, (label, points) in zip(cycle(MARKERS), rows, strict=False):
        shade = darken(shades[label])
        time = np.array([point["time"] for point in points])
        measured = np.array([point["rms_distance"] for point in points])
        predicted = np.array([np.hypot(point["unrelated_digits"], point["repeated_digits"]) for point in points])
        ax.plot(time, measured, color=shade, marker=marker, ms=4, ls="none", label=escape_math(label))
        ax.plot(time, predicted, color=shade, lw=1)
    rest = document["reference_distance"]
    if rest:
        ax.plot(
            [row["time"] for row in rest],
            [row["distance"] for row in rest],
            color=GREY,
            ls=":",
            label="float64, from the reference",
        )
    ax.set(xscale="log", yscale="log", xlabel="time [s]", ylabel="distance of D from float64 [m]")
    ax.grid(True)
    handles, labels = ax.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right upper" if columns == 2 else "outside lower center")
    label_log_axes(ax)
    title = f"{document['scenario']}: marks measured, lines by the last digits"
    ax.set_title(fill(title, 100 if columns == 2 else 44), loc="left", parse_math=False)
    return figure
