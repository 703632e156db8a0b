"""Eigenvalues of upright straight motion over speed, the field's standard picture of a bicycle."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from .labels import Badge, place_labels
from .style import FAMILY_COLOURS, GREY, INK, PALE, WIDTHS, new_figure

_COLOURS = {"weave": FAMILY_COLOURS[1], "capsize": FAMILY_COLOURS[2], "castering": FAMILY_COLOURS[3]}
_LARGEST = 10.0  # of the eigenvalues drawn [1/s]


def eigenvalue_figure(
    name: str,
    speeds: np.ndarray,
    eigenvalues: np.ndarray,
    modes: Sequence[str],
    stable: Sequence[tuple[float, float]],
    columns: int = 2,
) -> Figure:
    """Draw real parts (solid) and imaginary parts (dashed) over speed, with the stable ranges shaded.

    Call within `use_style`.

    Parameters
    ----------
    name : str
        Of the bicycle.
    speeds : ndarray, shape (n,)
        [m/s].
    eigenvalues : ndarray, shape (n, 4), complex
        A column for each mode [1/s].
    modes : sequence of str, length 4
        Names of the columns.
    stable : sequence of (float, float)
        Ranges of speed [m/s].
    columns : int
        Number of a journal's columns that the figure fills.

    Returns
    -------
    Figure
    """
    figure = new_figure(3.6 if columns == 2 else 3.1, WIDTHS[columns])
    ax = figure.subplots()
    shaded = [(start, min(end, float(speeds[-1]))) for start, end in stable if start < speeds[-1]]
    for start, end in shaded:
        ax.axvspan(start, end, color=PALE, alpha=0.6, lw=0)
    ax.axhline(0.0, color=GREY, lw=0.7)
    for column, mode in enumerate(modes):
        values, colour = eigenvalues[:, column], _COLOURS.get(mode, INK)
        ax.plot(speeds, np.real(values), color=colour)
        # Zero imaginary parts would hide the axis.
        oscillating = np.where(np.imag(values) > 1e-9 * np.abs(values), np.imag(values), np.nan)
        ax.plot(speeds, oscillating, color=colour, ls="--", lw=1.0)
    ax.set(xlabel="forward speed $v$ [m/s]", ylabel="eigenvalues $λ$ [1/s]")
    ax.set(xlim=(speeds[0], speeds[-1]), ylim=(-_LARGEST, _LARGEST))
    handles: list[Line2D | Patch] = [
        Line2D([], [], color=GREY, label="real part"),
        Line2D([], [], color=GREY, ls="--", lw=1.0, label="imaginary part"),
    ]
    if shaded:
        handles.append(Patch(facecolor=PALE, alpha=0.6, label="stable by itself"))
    figure.legend(handles=handles, loc="outside lower center", ncols=3 if columns == 2 else 2)
    ax.set_title(name, loc="right", parse_math=False)
    place_labels(ax, (), _name_modes(speeds, eigenvalues, modes))
    return figure


def _name_modes(speeds: np.ndarray, eigenvalues: np.ndarray, modes: Sequence[str]) -> list[Badge]:
    """Make a badge for each mode, to be placed on its real parts inside the axes."""
    badges = []
    for mode in dict.fromkeys(modes):
        line = np.column_stack([speeds, np.real(eigenvalues[:, list(modes).index(mode)])])
        inside = line[np.abs(line[:, 1]) < 0.9 * _LARGEST]
        if len(inside):
            badges.append(Badge(mode, inside, _COLOURS.get(mode, INK)))
    return badges
