"""One style for every printed figure, and the way it reaches the disk."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.figure import Figure

from ...engines.files import write_whole

WIDTH = 7.2  # of a page with two columns [inch]: text below stays readable at half of it

INK, GREY, PALE = "#1a1a1a", "#6b6b6b", "#d9d9d9"
# Okabe and Ito's hues, which the common colour-blindnesses keep apart; one a solution family.
FAMILY_COLOURS = {1: "#0072B2", 2: "#D55E00", 3: "#009E73", 4: "#CC79A7"}

_STYLE: Any = {
    "font.family": "DejaVu Sans",  # comes with matplotlib: the same letters on every machine
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
    "figure.dpi": 72,  # a point is a pixel: label placement counts in points
    "savefig.dpi": 200,
    "svg.hashsalt": "velodrome",  # the same drawing gives the same file
    "svg.fonttype": "path",
}
_NO_DATE: dict[str, dict[str, Any]] = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}


@contextmanager
def use_style() -> Iterator[None]:
    """Draw and write within this: the style holds inside, and matplotlib is left as it was."""
    with rc_context(_STYLE):
        yield


def new_figure(height: float, width: float = WIDTH) -> Figure:
    """An empty figure of a size in inches, its axes laid out so that nothing overlaps.

    It is not known to pyplot: no window, nothing to close.
    """
    return Figure(figsize=(width, height), layout="constrained")


def write_figure(path: Path, figure: Figure) -> None:
    """Write a figure, whole or not at all.

    Parameters
    ----------
    path : Path
        Its ending gives the format: ``.svg``, ``.pdf`` or ``.png``.
    figure : Figure
    """
    with write_whole(path) as partial:
        figure.savefig(partial, metadata=_NO_DATE.get(path.suffix))
