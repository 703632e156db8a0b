"""Common style of all printed figures, and writing them to files."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.figure import Figure

from ...engines.files import write_whole

WIDTH = 7.2  # width of a page with two columns [inch]: text stays readable at half of it

INK, GREY, PALE = "#1a1a1a", "#6b6b6b", "#d9d9d9"
# Okabe and Ito's colours, which remain distinct with common colour blindness; one for each solution family.
FAMILY_COLOURS = {1: "#0072B2", 2: "#D55E00", 3: "#009E73", 4: "#CC79A7"}

_STYLE: Any = {
    "font.family": "DejaVu Sans",  # included in matplotlib: the same glyphs on every machine
    "font.size": 8,
    "axes.labelsize": 8.5,
    "axes.titlesize": 8.5,
    "axes.edgecolor": GREY,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.7,
    "axes.axisbelow": True,
    "text.color": INK,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "grid.color": PALE,
    "grid.linewidth": 0.5,
    "legend.fontsize": 7.5,
    "legend.frameon": False,
    "legend.handlelength": 1.8,
    "lines.linewidth": 1.4,
    "figure.dpi": 72,  # a point is a pixel: label placement works in points
    "savefig.dpi": 200,
    "svg.hashsalt": "velodrome",  # the same figure gives the same file
    "svg.fonttype": "path",
}
_NO_DATE: dict[str, dict[str, Any]] = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}


@contextmanager
def use_style() -> Iterator[None]:
    """Use the style for drawing and writing; a context that leaves matplotlib's settings as they were."""
    with rc_context(_STYLE):
        yield


def new_figure(height: float, width: float = WIDTH) -> Figure:
    """Make an empty figure of a size in inches, with axes laid out without overlap.

    pyplot does not know it: there is no window, and it need not be closed.
    """
    return Figure(figsize=(width, height), layout="constrained")


def write_figure(path: Path, figure: Figure) -> None:
    """Write a figure, completely or not at all.

    Parameters
    ----------
    path : Path
        Path of the file; its ending gives the format: ``.svg``, ``.pdf`` or ``.png``.
    figure : Figure
    """
    with write_whole(path) as partial:
        figure.savefig(partial, metadata=_NO_DATE.get(path.suffix))
