"""Placement of labels on a plot: near what they name, off the curves and off one another."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.text import Annotation

from ...reference.bicycle import Bicycle

_LONGEST_NAME = 40  # largest number of characters that name a bicycle
_REACHES = (8.0, 11.0, 15.0, 20.0, 26.0)  # distances of a label from its point that are tried [pt]
_DIRECTIONS = np.radians(np.arange(45.0, 405.0, 22.5))  # beginning at the upper right, where readers expect it
_MARK = 5.0  # half the width of what is kept free around the points of other labels [pt]
_MARGIN = 1.5  # kept free around a label [pt]
_SPACING = 2.0  # of the points that represent a curve [pt]
_BADGE_SIZE = 7.0  # of the letters of badges [pt]
_LEADER = 9.0  # distance of a label's edge from which a label is connected to its point by a line [pt]


def name_other_bicycle(document: Mapping[str, Any]) -> str:
    """Return a title that names the bicycle of a document; an empty one for the benchmark bicycle."""
    bicycle = document["bicycle"]
    if bicycle["parameters"] == asdict(Bicycle()):
        return ""
    return f"bicycle {bicycle['name'] or 'without a name'}"[:_LONGEST_NAME]


@dataclass(frozen=True)
class Label:
    """A text that names a point and is placed beside it."""

    text: str
    point: tuple[float, float]


@dataclass(frozen=True)
class Badge:
    """A text that names a curve and is placed on it, at one of the curve's points, shape (n, 2)."""

    text: str
    points: np.ndarray
    colour: str


def place_labels(
    axes: Axes, labels: Sequence[Label], badges: Sequence[Badge] = (), size: float = 9
) -> list[Annotation]:
    """Write labels beside their points, then badges on their curves.

    Parameters
    ----------
    axes : Axes
        Must have all curves and markers drawn and all limits set.
    labels : sequence of Label
    badges : sequence of Badge
    size : float
        Size of the labels' letters [pt].

    Returns
    -------
    list of Annotation
        Labels, then badges.
    """
    figure: Any = axes.figure
    figure.draw_without_rendering()  # the layout engine moves the axes only now
    scale = 72 / figure.dpi
    obstacles = _curve_points(axes) * scale
    frame = np.array(axes.bbox.extents) * scale
    taken: list[np.ndarray] = [np.array(child.bbox.extents) * scale for child in axes.child_axes]
    written = []
    for label in labels:
        text, extent = _write_text(axes, label.text, label.point, scale, size)
        at = axes.transData.transform(label.point) * scale
        # Beside another label's point it would be read as that one's name.
        others = [
            _make_box(axes.transData.transform(other.point) * scale, np.full(2, 2 * _MARK))
            for other in labels
            if other.point != label.point
        ]
        offset = _place_label(at, extent, obstacles, [*taken, *others], frame)
        text.xyann = tuple(offset)
        edge = offset * (1 - np.min(extent / 2 / np.maximum(np.abs(offset), 1e-9)))
        if np.hypot(*edge) > _LEADER:
            leader = {"arrowstyle": "-", "lw": 0.5, "shrinkA": 0, "shrinkB": 3}
            line = axes.annotate("", label.point, tuple(edge), textcoords="offset points", arrowprops=leader)
            line.set_in_layout(False)
        taken.append(_make_box(at + offset, extent))
        written.append(text)
    for badge in badges:
        text, extent = _write_text(axes, badge.text, badge.points[0], scale, _BADGE_SIZE, badge.colour)
        places = axes.transData.transform(badge.points) * scale
        chosen = _place_badge(places, extent + 4, obstacles, taken, frame)
        text.xy = tuple(badge.points[chosen])
        taken.append(_make_box(places[chosen], extent + 4))
        written.append(text)
    return written


def _write_text(
    axes: Axes, words: str, point: Any, scale: float, size: float, colour: str | None = None
) -> tuple[Annotation, np.ndarray]:
    """Write a text at its point; return it and its width and height [pt]."""
    kind: dict[str, Any] = {"fontsize": size, "zorder": 9}
    if colour is not None:
        box = {"boxstyle": "round,pad=0.18", "fc": "white", "ec": colour, "lw": 0.9}
        kind = {"fontsize": size, "fontweight": "bold", "color": colour, "bbox": box, "zorder": 8}
    text = axes.annotate(
        words, tuple(point), (0, 0), textcoords="offset points", ha="center", va="center", annotation_clip=False, **kind
    )
    text.set_in_layout(False)  # or the axes would move under labels already placed
    extent = text.get_window_extent()
    return text, np.array([extent.width, extent.height]) * scale


def _curve_points(axes: Axes) -> np.ndarray:
    """Return points on all lines and markers in display coordinates, shape (n, 2)."""
    points = [np.empty((0, 2))]
    for line in axes.lines:
        vertices = line.get_transform().transform(line.get_xydata())
        vertices = vertices[np.all(np.isfinite(vertices), axis=1)]
        points.append(vertices if line.get_linestyle() == "None" else _fill_gaps(vertices))
    return np.concatenate(points)


def _fill_gaps(points: np.ndarray) -> np.ndarray:
    """Add points to a polyline so that no gap is wider than the spacing."""
    between = [
        a + (b - a) * np.linspace(0, 1, int(np.hypot(*(b - a)) // _SPACING) + 2)[1:-1, None]
        for a, b in pairwise(points)
    ]
    return np.concatenate([points, *between])


def _make_box(centre: np.ndarray, size: np.ndarray) -> np.ndarray:
    return np.concatenate([centre - size / 2 - _MARGIN, centre + size / 2 + _MARGIN])


def _count_covered(box: np.ndarray, points: np.ndarray) -> int:
    return int(np.all((points > box[:2]) & (points < box[2:]), axis=1).sum())


def _count_clashes(box: np.ndarray, taken: Sequence[np.ndarray], frame: np.ndarray) -> int:
    """Count the texts that a box overlaps; leaving the frame counts as one."""
    overlaps = sum(bool(np.all((box[:2] < other[2:]) & (other[:2] < box[2:]))) for other in taken)
    return overlaps + bool(np.any(box[:2] < frame[:2]) or np.any(box[2:] > frame[2:]))


def _place_label(
    at: np.ndarray, size: np.ndarray, obstacles: np.ndarray, taken: Sequence[np.ndarray], frame: np.ndarray
) -> np.ndarray:
    """Find a label's offset from its point: the nearest that covers nothing, or the one that covers least."""

    def cost(offset: np.ndarray) -> tuple[int, int]:
        box = _make_box(at + offset, size)
        return _count_clashes(box, taken, frame), _count_covered(box, obstacles)

    # A long text needs more room sideways than upwards.
    directions = np.column_stack([np.cos(_DIRECTIONS), np.sin(_DIRECTIONS)])
    stretch = directions * np.maximum(size / 2 - 4, 0)
    offsets = [reach * d + s for reach in _REACHES for d, s in zip(directions, stretch, strict=True)]
    return min(offsets, key=cost)


def _place_badge(
    places: np.ndarray, size: np.ndarray, obstacles: np.ndarray, taken: Sequence[np.ndarray], frame: np.ndarray
) -> int:
    """Find the index of a badge's place on a curve: clear of other curves, then near the middle."""
    steps = np.hypot(*np.diff(places, axis=0).T)
    arc = np.concatenate([[0.0], np.cumsum(steps)]) / max(float(steps.sum()), 1e-9)

    boxes = [_make_box(place, size) for place in places]
    covered = [_count_covered(box, obstacles) for box in boxes]
    alone = max(1, min(covered))  # number of points of a single curve below a badge

    def cost(i: int) -> tuple[int, int, float]:
        return _count_clashes(boxes[i], taken, frame), round(covered[i] / alone), abs(arc[i] - 0.5)

    return min(range(len(places)), key=cost)
