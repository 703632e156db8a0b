"""Figure of what float32 costs: distances from the ride in double precision over time, and what explains them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..drawing import assign_colours
from .style import GREY, new_figure, use_style, write_figure

_MARKERS = "osD^vp*hX<>"
_DARKER = 0.72  # the engines' colours are chosen for a dark background


def float32_figure(path: Path, document: Mapping[str, Any]) -> None:
    """Write the figure of a document of `velodrome float32`.

    Marks are the measured root mean squares, lines of the same colour what the last digits of the state predict.

    Parameters
    ----------
    path : Path
        Path of the file; its ending gives the format.
    document : mapping
    """
    rows = [
        (f"{name}, {title}", entry["counterpart"], found["points"])
        for name, entry in document["engines"].items()
        for title, found in entry["variants"].items()
    ]
    with use_style():
        figure = new_figure(3.1)
        ax = figure.subplots()
        shades = assign_colours([label for label, _, _ in rows])
        for k, (label, _, points) in enumerate(rows):
            shade = tuple(_DARKER * part / 255 for part in shades[label])
            time = np.array([point["time"] for point in points])
            measured = np.array([point["rms_distance"] for point in points])
            predicted = np.array([np.hypot(point["unrelated_digits"], point["repeated_digits"]) for point in points])
            ax.plot(time, measured, color=shade, marker=_MARKERS[k % len(_MARKERS)], ms=4, ls="none", label=label)
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
        figure.legend(*ax.get_legend_handles_labels(), loc="outside right upper")
        figure.suptitle(
            f"{document['scenario']}: marks measured, lines by the last digits",
            x=0.01,
            ha="left",
            fontsize=8.5,
            parse_math=False,
        )
        write_figure(path, figure)
