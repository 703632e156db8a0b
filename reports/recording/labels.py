"""Places of the engines' names in the view of a ride, so that none covers another one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .camera import VIEW

# Sizes of a label in the viewer's font [points]: of a letter on average over capital letters and digits as well, of the
# frame around the text, and of the height with the frame.
LETTER, FRAME, HEIGHT = 7.4, 14.0, 24.0
# The viewer hangs a label below its point by this much [points].
HANG = 3.0
_LEAD = 24.0  # from a bicycle to the middle of the nearest label [points]
_GAP = 3.0
_ROWS = 5
_BELOW = 60.0  # a place below counts as farther by this much [points], since it hides the path


def measure_labels(names: Sequence[str]) -> np.ndarray:
    """Return width and height of the labels of names, shape (n, 2) [points]."""
    return np.array([[LETTER * len(name) + FRAME, HEIGHT] for name in names])


def place_names(anchors: np.ndarray, reach: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Choose a place for every label near its bicycle at every time, so that no two labels overlap.

    The labels take their places in turn: each takes the first of a list of places around its bicycle that no earlier
    one covers and that is within the view. The list is always the same, so that labels of bicycles that ride together
    keep their places.

    Parameters
    ----------
    anchors : ndarray, shape (times, labels, 2)
        Where the bicycles are in the picture, from its middle [points]; NaN for one that is not seen.
    reach : ndarray, shape (times, labels)
        How far a bicycle may be above or below its place [points]; no label is so near.
    sizes : ndarray, shape (labels, 2)
        Widths and heights of the labels [points].

    Returns
    -------
    ndarray, shape (times, labels, 2)
        Middles of the labels [points]. Of a label whose bicycle is not seen, its bicycle's place.
    """
    half = 0.5 * sizes
    offsets = _list_offsets(float(sizes[:, 0].max()), len(sizes))
    edge = np.array(VIEW) / 2
    placed = anchors.copy()
    for t, here in enumerate(anchors):
        done: list[int] = []
        for k in np.flatnonzero(np.isfinite(here).all(axis=1)).tolist():
            places = here[k] + offsets + np.sign(offsets) * [0.0, reach[t, k]]
            free = np.ones(len(places), bool)
            for other in done:
                apart = np.abs(places - placed[t, other]) - half[k] - half[other]
                free &= (apart >= _GAP - 1e-9).any(axis=1)
            inside = (np.abs(places) + half[k] <= edge).all(axis=1)
            # The list has a free place for every label, and outside of the view is better than on another one.
            best = free & inside if (free & inside).any() else free
            placed[t, k] = places[int(np.argmax(best))]
            done.append(k)
    return placed


def _list_offsets(width: float, labels: int) -> np.ndarray:
    """List places of a label relative to its bicycle [points], the nearest first, and rather above it than below.

    Of n labels each covers at most four places of another one, for the places are a label's size apart: 4 n and one
    more always have a free one.
    """
    rows = _LEAD + (HEIGHT + _GAP) * np.arange(_ROWS)
    columns = [0.0]
    while len(columns) < 3 or len(columns) * 2 * _ROWS < 4 * labels + 1:
        step = (len(columns) + 1) // 2 * (width + _GAP)
        columns += [step, -step]
    offsets = np.array([[x, y] for x in columns for y in (*rows, *-rows)])
    cost = np.hypot(*offsets.T) + np.where(offsets[:, 1] < 0, _BELOW, 0.0)
    return offsets[np.argsort(cost, kind="stable")]
