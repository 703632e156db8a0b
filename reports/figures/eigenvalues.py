"""Eigenvalues of upright straight motion over speed, the field's standard picture of a bicycle."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from .style import FAMILY_COLOURS, GREY, INK, PALE, new_figure, use_style, write_figure

_COLOURS = {"weave": FAMILY_COLOURS[1], "capsize": FAMILY_COLOURS[2], "castering": FAMILY_COLOURS[3]}


def eigenvalue_figure(
    path: Path,
    name: str,
    speeds: np.ndarray,
    eigenvalues: np.ndarray,
    modes: Sequence[str],
    stable: Sequence[tuple[float, float]],
) -> None:
    """Draw real parts (solid) and imaginary parts (dashed) over speed, with the stable ranges shaded.

    Parameters
    ----------
    path : Path
        Its ending gives the format.
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
    """
    with use_style():
        figure = new_figure(3.6)
        ax = figure.subplots()
        for start, end in stable:
            if start < speeds[-1]:
                ax.axvspan(start, min(end, float(speeds[-1])), color=PALE, alpha=0.6, lw=0)
        ax.axhline(0.0, color=GREY, lw=0.7)
        for mode in dict.fromkeys(modes):
            colour = _COLOURS.get(mode, INK)
            for column in [k for k, other in enumerate(modes) if other == mode]:
                values = eigenvalues[:, column]
                label = mode if column == list(modes).index(mode) else None
                ax.plot(speeds, np.real(values), color=colour, label=label)
                # Zero imaginary parts would hide the axis.
                oscillating = np.where(np.imag(values) > 1e-9 * np.abs(values), np.imag(values), np.nan)
                ax.plot(speeds, oscillating, color=colour, ls="--", lw=1.0)
        ax.plot([], [], color=GREY, label="real part")
        ax.plot([], [], color=GREY, ls="--", lw=1.0, label="imaginary part")
        ax.set(xlabel="forward speed [m/s]", ylabel="eigenvalues [1/s]", xlim=(speeds[0], speeds[-1]), ylim=(-10, 10))
        figure.legend(loc="outside upper left", ncols=5)
        figure.suptitle(name, x=0.99, ha="right", fontsize=8.5, parse_math=False)
        write_figure(path, figure)
