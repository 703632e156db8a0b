"""Figure of the periodic orbits born where stable circles end: lean amplitude over energy."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from .labels import name_other_bicycle
from .style import FAMILY_COLOURS, GREY, INK, WIDTHS, new_figure

_STABLE: dict[str, Any] = {"lw": 2.4, "solid_capstyle": "butt"}
_UNSTABLE: dict[str, Any] = {"lw": 1.0, "dashes": (4, 2.2)}
_MARKERS = {"Hopf point": "o", "fold": "^", "torus": "s", "period doubling": "D"}
_BEYOND = 1.2  # energies shown on either side of a section, as parts of its width
_ROOM = 1.15  # height of a panel over the largest amplitude in it


def bifurcation_figure(document: Mapping[str, Any], columns: int = 2) -> Figure:
    """Draw the branches of orbits about each stable section, in a panel each; call within `use_style`.

    Parameters
    ----------
    document : mapping
        As returned by `velodrome bifurcations`; with a stable section that has circles.
    columns : int
        Number of a journal's columns that the figure fills.

    Returns
    -------
    Figure
    """
    sections = drawn_sections(document)
    beside = columns == 2 and len(sections) > 1
    rows = 1 if beside else len(sections)
    figure = new_figure(0.55 + 2.6 * rows, WIDTHS[columns])
    panels = figure.subplots(rows, len(sections) if beside else 1, squeeze=False).ravel()
    if other := name_other_bicycle(document):
        figure.suptitle(other, x=0.01, ha="left", fontsize=9, parse_math=False)
    kinds: set[str] = set()
    for axes, section in zip(panels, sections, strict=True):
        kinds |= _draw_section(axes, section, document["hopf"])
    handles = [
        Line2D([], [], color=GREY, **_STABLE, label="stable"),
        Line2D([], [], color=GREY, **_UNSTABLE, label="unstable"),
    ]
    handles += [_make_mark(kind) for kind in _MARKERS if kind in kinds]
    figure.legend(handles=handles, loc="outside lower center", ncols=5 if columns == 2 else 3)
    return figure


def drawn_sections(document: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the stable sections of a document of which there is something to draw."""
    return [section for section in document["stable_sections"] if section["energy"]]


def _make_mark(kind: str) -> Line2D:
    return Line2D([], [], ls="", marker=_MARKERS[kind], ms=4.6, mfc="white", mec=INK, label=kind)


def _draw_section(axes: Axes, section: Mapping[str, Any], points: Sequence[Mapping[str, Any]]) -> set[str]:
    """Draw the circles of a stable section and the orbits about them; return the kinds of points that are marked."""
    colour = FAMILY_COLOURS.get(section["family"], GREY)
    low, high = _find_limits(section["energy"])
    width = high - low
    first, last = low - _BEYOND * width, high + _BEYOND * width
    axes.set_xlim(first, last)
    axes.plot([low, high], [0, 0], color=colour, **_STABLE, clip_on=False, gid="stable circles")
    for part in ((first, low), (high, last)):
        axes.plot(part, [0, 0], color=colour, **_UNSTABLE, clip_on=False, gid="unstable circles")
    marks = {("Hopf point", end, 0.0) for end in (low, high)}
    largest = 0.0
    for point in _choose_branches(section, points):
        energies, sizes = (np.array(point["branch"][name]) for name in ("energy", "lean_amplitude"))
        energies, sizes = np.append(point["energy"], energies), np.append(0.0, sizes)
        stable = np.array(point["branch"]["largest_multiplier"]) < 1
        for start, end in _find_runs(stable):
            # A run begins where the one before it ends, so that the curve has no gap.
            style, gid = (_STABLE, "stable orbits") if stable[start] else (_UNSTABLE, "unstable orbits")
            axes.plot(energies[start : end + 1], sizes[start : end + 1], color=colour, **style, gid=gid)
        inside = (energies > first) & (energies < last)
        largest = max(largest, float(sizes[inside].max(initial=0.0)))
        marks |= {
            (event["kind"], event["energy"], event["lean_amplitude"])
            for event in point["orbit_bifurcations"]
            if first < event["energy"] < last
        }
    axes.set_ylim(0, _ROOM * largest if largest > 0 else 1.0)
    for kind, energy, size in sorted(marks):
        mark = _make_mark(kind)
        mark.set_data([energy], [size])
        mark.set(clip_on=False, zorder=7, gid=kind)
        axes.add_line(mark)
    name = "a curve without a number" if section["family"] is None else f"family {section['family']}"
    axes.set_title(name, loc="left")
    axes.set(xlabel="energy $E$ [J]", ylabel="lean amplitude $A$ [rad]")
    axes.grid()
    return {kind for kind, *_ in marks}


def _choose_branches(section: Mapping[str, Any], points: Sequence[Mapping[str, Any]]) -> Iterator[Mapping[str, Any]]:
    """Yield the ends of the family's sections whose branches are to be drawn, a branch between two of them once."""
    ends = [
        point
        for point in points
        if point["family"] == section["family"] and point["ends_stable_section"] and point["branch"] is not None
    ]
    drawn: list[Mapping[str, Any]] = []
    for point in ends:
        if point["branch_end"] == "hopf":
            last = point["branch"]["energy"][-1], point["branch"]["period"][-1]
            other = min(ends, key=lambda end: abs(end["energy"] - last[0]) + abs(_period(end) - last[1]))
            if other in drawn and other["branch_end"] == "hopf":
                continue
        drawn.append(point)
        yield point


def _period(point: Mapping[str, Any]) -> float:
    return 2 * np.pi / point["frequency"]


def _find_limits(energies: Sequence[float]) -> tuple[float, float]:
    """Return the energies at the ends of a section from those of n equidistant circles inside it."""
    step = (energies[-1] - energies[0]) / (len(energies) - 1)
    ends = energies[0] - step, energies[-1] + step
    return min(ends), max(ends)


def _find_runs(values: np.ndarray) -> list[tuple[int, int]]:
    """Return the first index of each run of equal values (n,) and that after its last."""
    borders = [0, *(np.flatnonzero(np.diff(values)) + 1).tolist(), len(values)]
    return list(pairwise(borders))
