"""Figure of the wheel tracks of periodic orbits on the ground."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from .labels import name_other_bicycle
from .style import FAMILY_COLOURS, GREY, INK, WIDTHS, new_figure

_MOST_PERIODS = 40  # drawn of a track that precesses slowly or hardly
_SAME = 1e-6  # relative difference of amplitude and energy below which two branches have led to one orbit


def orbit_track_figure(document: Mapping[str, Any], columns: int = 2) -> Figure:
    """Draw the tracks of the largest orbit born at each end of a stable section; call within `use_style`.

    Parameters
    ----------
    document : mapping
        As returned by `velodrome bifurcations`; with an orbit that can be ridden.
    columns : int
        Number of a journal's columns that the figure fills.

    Returns
    -------
    Figure
    """
    drawn = drawn_orbits(document)
    beside = min(len(drawn), 4 if columns == 2 else 2)
    rows = -(-len(drawn) // beside)
    width = WIDTHS[columns]
    figure = new_figure(0.35 + rows * (width / max(beside, 2) + 0.45), width)
    panels = figure.subplots(rows, beside, squeeze=False).ravel()
    if other := name_other_bicycle(document):
        figure.suptitle(other, x=0.01, ha="left", fontsize=9, parse_math=False)
    for axes, (point, orbit) in zip(panels, drawn, strict=False):
        _draw_tracks(axes, point, orbit)
    for axes in panels[len(drawn) :]:
        axes.set_axis_off()
    panels[0].set_ylabel("$y$ [m]")
    handles = [
        Line2D([], [], color=GREY, lw=0.9, label="rear wheel"),
        Line2D([], [], color=INK, lw=0.4, label="front wheel"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=2)
    return figure


def drawn_orbits(document: Mapping[str, Any]) -> list[tuple[Mapping[str, Any], Mapping[str, Any]]]:
    """Return the ends of stable sections, each with its largest listed orbit that can be ridden.

    Of two ends whose branch is the same only the first is returned.
    """
    found: list[tuple[Mapping[str, Any], Mapping[str, Any]]] = []
    for point in document["hopf"]:
        ridden = [orbit for orbit in point["orbits"] if orbit["track"] is not None and orbit["physical"]]
        if point["ends_stable_section"] and ridden:
            largest = max(ridden, key=lambda orbit: orbit["lean_amplitude"])
            if not any(_are_same(largest, other) for _, other in found):
                found.append((point, largest))
    return found


def _are_same(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    return all(abs(one[key] - other[key]) < _SAME * abs(other[key]) for key in ("lean_amplitude", "energy"))


def _draw_tracks(axes: Axes, point: Mapping[str, Any], orbit: Mapping[str, Any]) -> None:
    """Draw the tracks of an orbit, those of a period turned once for every period, until they have gone around."""
    advance = orbit["yaw_advance"]
    precession = abs(np.angle(np.exp(1j * advance)))
    periods = min(_MOST_PERIODS, int(np.ceil(2 * np.pi / max(precession, 1e-9))))
    for wheel, colour, width in (("rear", FAMILY_COLOURS.get(point["family"], GREY), 0.9), ("front", INK, 0.4)):
        track = np.array(orbit["track"][wheel])
        turned = [track @ _rotate(k * advance).T for k in range(periods)]
        axes.plot(*np.concatenate(turned).T, color=colour, lw=width, gid=f"{wheel} track")
    axes.set_aspect("equal")
    stable = max(abs(complex(*value)) for value in orbit["multipliers"][2:]) < 1
    name = "no number" if point["family"] is None else f"family {point['family']}"
    axes.set_title(f"{name}, {'stable' if stable else 'unstable'}\n$A$ = {orbit['lean_amplitude']:.3g} rad", loc="left")
    axes.set_xlabel("$x$ [m]")
    axes.grid()


def _rotate(angle: float) -> np.ndarray:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
