"""Common style of all printed figures, their widths, and writing them to files."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogFormatterSciNotation, LogLocator, NullFormatter

from ...engines.files import write_whole

# Widths of figures in one and in two columns, 89 mm and 183 mm (Nature) [inch]. IEEE has 88.9 mm and 181.9 mm, Elsevier
# 90 mm and 190 mm: letters change by 4 % at most if a figure is scaled to these.
WIDTHS = {1: 89 / 25.4, 2: 183 / 25.4}
WIDTH = WIDTHS[2]

INK, GREY, PALE = "#1a1a1a", "#6b6b6b", "#d9d9d9"
# Okabe and Ito's colours, which remain distinct with common colour blindness; one for each solution family.
FAMILY_COLOURS = {1: "#0072B2", 2: "#D55E00", 3: "#009E73", 4: "#CC79A7"}

MARKERS = "os^Dvp*hX<>"  # of engines, distinct without colour
_DARKER = 0.72  # engines' colours are chosen for a dark background

_STYLE: Any = {
    "font.family": "sans-serif",
    # DejaVu Sans is included in matplotlib: the same glyphs on every machine. The others have nearly its widths, for
    # viewers of SVG files that lack it.
    "font.sans-serif": ["DejaVu Sans", "Verdana", "Arial", "Helvetica"],
    "mathtext.fontset": "dejavusans",
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
    "xtick.major.pad": 5.5,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "grid.color": PALE,
    "grid.linewidth": 0.5,
    "legend.fontsize": 7.5,
    "legend.frameon": False,
    "legend.handlelength": 1.8,
    "lines.linewidth": 1.4,
    "figure.dpi": 72,  # a point is a pixel: label placement works in points
    "hatch.linewidth": 0.4,
    "savefig.dpi": 300,
    "svg.hashsalt": "velodrome",  # the same figure gives the same file
    "svg.fonttype": "none",  # text remains text, which can be searched and edited
    "pdf.fonttype": 42,  # TrueType: publishers refuse Type 3 fonts
}
_NO_DATE: dict[str, dict[str, Any]] = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}


def darken(colour: tuple[int, int, int]) -> tuple[float, float, float]:
    """Return an engine's colour, as `velodrome.reports.drawing.assign_colours` gives it, for white paper, 0 to 1."""
    red, green, blue = (_DARKER * part / 255 for part in colour)
    return red, green, blue


def label_log_axes(axes: Axes) -> None:
    """Label powers of ten on logarithmic axes, and 2 and 5 times them where fewer than two are in view.

    matplotlib would label further multiples, which overlap in narrow panels. All data must be drawn.
    """
    for axis, limits in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
        if axis.get_scale() != "log":
            continue
        axis.set_minor_formatter(NullFormatter())
        low, high = (math.log10(limit) for limit in limits)
        if math.floor(high) - math.ceil(low) < 1:
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            powers = LogFormatterSciNotation(minor_thresholds=(math.inf, math.inf))
            plain = FuncFormatter(lambda value, _: f"{value:g}")
            axis.set_major_formatter(plain if low > -3 and high < 4 else powers)


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


def escape_math(text: str) -> str:
    """Return a text, such as a name that a user gave, in which no $ begins a formula."""
    return text.replace("$", r"\$")


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


def write_formats(
    stem: Path, draw: Callable[[int], Figure], formats: Iterable[str] = ("png",), columns: int = 2
) -> list[Path]:
    """Draw a figure in the common style and write it in all formats, each file completely or not at all.

    Parameters
    ----------
    stem : Path
        Path of the files without their endings.
    draw : callable
        Returns the figure for a number of columns.
    formats : iterable of str
        Endings of files without their dots: ``png``, ``svg``, ``pdf``.
    columns : int
        Number of a journal's columns that the figure fills, 1 or 2; see `WIDTHS`.

    Returns
    -------
    list of Path
        Files written.
    """
    paths = [stem.with_name(f"{stem.name}.{name}") for name in formats]
    with use_style():
        figure = draw(columns)
        for path in paths:
            write_figure(path, figure)
    return paths
