"""The engines' names in their colours, in rows below the ride: one legend for all curves, which covers none."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .camera import VIEW
from .labels import FRAME, HANG, HEIGHT, measure_labels

_ROW = HEIGHT + 4.0  # [points]
_GAP = 6.0


def place_legend(names: Sequence[str]) -> tuple[np.ndarray, tuple[float, float]]:
    """Set names in rows of the view's width.

    Returns
    -------
    middles : ndarray, shape (n, 2)
        Middles of the labels, to the right and downwards [points].
    size : tuple of float
        Width and height of the whole [points].
    """
    middles, x, row = [], 0.0, 0
    for width, _ in measure_labels(names):
        if x > 0 and x + width > VIEW[0] - 2 * FRAME:
            x, row = 0.0, row + 1
        middles.append([x + width / 2, (row + 0.5) * _ROW])
        x += width + _GAP
    return np.array(middles), (VIEW[0] - 2 * FRAME, (row + 1) * _ROW)


def hang_labels(middles: np.ndarray) -> np.ndarray:
    """Return the points that the viewer hangs labels on so that their middles are at places (n, 2) [points]."""
    return middles - [0.0, HEIGHT / 2 + HANG]
