"""Figures of solution families, as in Xiong et al. (2020), Figures 2 to 5 and 7."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MultipleLocator

from .labels import Badge, Label, name_other_bicycle, place_labels
from .solution_curve import NamedPoint, SolutionCurve, find_limits, find_named_points, make_curves, scaled_speed
from .style import FAMILY_COLOURS, GREY, INK, WIDTHS, new_figure

ANGLES = {"lean": "lean $θ_0$ [rad]", "steer": "steer $δ_0$ [rad]"}
RANGES = {"lean": (-np.pi / 2, np.pi / 2), "steer": (0.0, np.pi)}
# Of points on curves, filled, and of limits, open; beside letters they tell what a point is.
MARKERS = {
    "static": "s",
    "pivot": "o",
    "cusp": "^",
    "straight": "D",
    "motion": "X",
    "large circle": "D",
    "flat": "o",
    "fast front wheel": ">",
    "edge": "s",
}
POINT_MEANINGS = {
    "static": "static equilibrium",
    "pivot": "pivoting motion",
    "cusp": "cusp",
    "straight": "straight motion",
    "motion": "named motion",
    "large circle": "ever larger circles",
    "flat": "lying flat",
    "fast front wheel": "front wheel ever faster",
    "edge": "edge of the ground",
}
_SPEEDS = (0, 5, 10, 15, 20, 30, 50, 100)  # on the upper axis [rad/s]
# Left, bottom, width, height of the magnified part, relative to a panel: where no curve of small alpha lies.
_LENSES = {"lean": (0.045, 0.575, 0.36, 0.33), "steer": (0.615, 0.19, 0.36, 0.31)}
_LONGEST = 40  # largest number of characters for the ground
_STABLE, _PLAIN = 4.6, 1.4  # widths of lines [pt]
_UNRIDDEN: dict[str, dict[str, Any]] = {
    "pulled": {"lw": 1.0, "dashes": (4, 2.2), "alpha": 0.6},
    "touching": {"lw": 1.4, "dashes": (1, 1.6), "alpha": 0.6},
}
_UNRIDDEN_STABLE: dict[str, Any] = {"lw": _STABLE, "alpha": 0.25}
_UNRIDDEN_MEANINGS = {"pulled": "contact lost", "touching": "a rim in the ground"}


def family_figure(
    document: Mapping[str, Any],
    front_radius: float,
    marks: Mapping[str, Mapping[str, float]] | None = None,
    columns: int = 2,
    units: Mapping[str, str] | None = None,
) -> Figure:
    """Draw lean and steer of all families over the scaled front speed; call within `use_style`.

    Parameters
    ----------
    document : mapping
        As returned by `velodrome families`.
    front_radius : float
        Radius of the front wheel [m].
    marks : mapping, optional
        Further motions to mark, by name: ``lean``, ``steer`` and ``front_rate``.
    columns : int
        Number of a journal's columns that the figure fills.
    units : mapping, optional
        Units of the fields of the ground, if it is no paraboloid.

    Returns
    -------
    Figure
    """
    drawn = make_curves(document["families"], front_radius)
    points = find_named_points(document["families"], front_radius)
    points += [
        NamedPoint(name, "motion", scaled_speed(mark["front_rate"], front_radius), mark["lean"], mark["steer"], False)
        for name, mark in (marks or {}).items()
    ]
    points += find_limits(drawn)
    if columns == 2:
        figure = new_figure(3.75)
        panels = figure.subplots(1, 2)
    else:
        figure = new_figure(7.4, WIDTHS[1])
        panels = figure.subplots(2, 1)
    if other := name_other_bicycle(document):
        figure.suptitle(other, x=0.01, ha="left", fontsize=9, parse_math=False)
    for axes, angle, tag in zip(panels, ANGLES, "ab", strict=True):
        _draw_frame(axes, angle, front_radius, mirrored=any(curve.steer.min() < 0 for curve in drawn))
        if columns == 1:
            axes.xaxis.set_major_locator(MultipleLocator(0.5))
        axes.text(
            0.03,
            0.965,
            f"({tag})  {_describe_ground(document, units or {})}",
            transform=axes.transAxes,
            va="top",
            fontsize=8.5,
        )
        for curve in drawn:
            _draw_curve(axes, curve, angle)
        _mark_points(axes, points, angle)
    _draw_legend(figure, drawn, points, columns)
    for axes, angle in zip(panels, ANGLES, strict=True):
        badges = [
            Badge("+".join(str(number) for number in curve.families), curve.line(angle), _curve_colour(curve))
            for curve in drawn
            if curve.families
        ]
        _magnify(axes, drawn, points, angle)
        place_labels(axes, _make_labels(points, angle), badges)
    return figure


def _make_labels(points: Sequence[NamedPoint], angle: str) -> list[Label]:
    return [Label(point.name, (point.speed, getattr(point, angle))) for point in points if point.name]


def _magnify(axes: Axes, drawn: Sequence[SolutionCurve], points: Sequence[NamedPoint], angle: str) -> None:
    """Show cusps and stable sections enlarged: they are small, and the families nearly touch there."""
    stable = [curve.line(angle, *section) for curve in drawn for section in curve.stable]
    cusps = [(point.speed, getattr(point, angle)) for point in points if point.kind == "cusp" and point.name]
    if not stable or not cusps:
        return
    magnified = np.concatenate([*stable, cusps])
    low, high = magnified.min(axis=0), magnified.max(axis=0)
    low, high = low - 0.18 * (high - low), high + 0.12 * (high - low)
    lens = axes.inset_axes(_LENSES[angle], xlim=(low[0], high[0]), ylim=(low[1], high[1]), xticks=[], yticks=[])
    for curve in drawn:
        _draw_curve(lens, curve, angle)
    inside = [
        point
        for point in points
        if low[0] < point.speed < high[0] and low[1] < getattr(point, angle) < high[1] and not point.limit
    ]
    # No markers on cusps: they would cover what is magnified.
    _mark_points(lens, [point for point in inside if point.kind == "motion"], angle)
    place_labels(lens, _make_labels(inside, angle))
    for connector in axes.indicate_inset_zoom(lens, edgecolor=GREY, lw=0.6).connectors or ():
        connector.set_visible(False)


def _describe_ground(document: Mapping[str, Any], units: Mapping[str, str]) -> str:
    """Describe the ground; a simple fraction is written as in the paper."""
    alpha = document["alpha"]
    if alpha is None:
        fields = {name: value for name, value in document["surface"].items() if name != "kind"}
        shown = [f"{name} {value} {units.get(name, '')}".removesuffix(" 1").strip() for name, value in fields.items()]
        return ", ".join([str(document["surface"]["kind"]), *shown])[:_LONGEST]
    fraction = Fraction(alpha).limit_denominator(1000)
    simple = fraction.numerator == 1 and float(fraction) == alpha
    return "$α$ = 0" if alpha == 0 else f"$α$ = {fraction if simple else f'{alpha:.6g}'} m$^{{-1}}$"


def _draw_frame(axes: Axes, angle: str, front_radius: float, mirrored: bool) -> None:
    """Draw the axes; where turns to both sides differ, steers are of either sign."""
    axes.set_xlim(0, np.pi / 2)
    low, high = RANGES[angle]
    axes.set_ylim(-high if mirrored else low, high)
    axes.set_xlabel("arctan($R_f$ |$ω_f$| / 4 m/s) [rad]")
    axes.set_ylabel(ANGLES[angle])
    axes.xaxis.set_major_locator(MultipleLocator(0.25))
    axes.yaxis.set_major_locator(MultipleLocator(0.5))
    axes.grid()
    upper = axes.secondary_xaxis("top")
    upper.set_xticks([scaled_speed(rate, front_radius) for rate in _SPEEDS], [str(rate) for rate in _SPEEDS])
    upper.set_xlabel("|$ω_f$| [rad/s]")


def _curve_colour(curve: SolutionCurve) -> str:
    return FAMILY_COLOURS[curve.families[0]] if curve.families else GREY


def _draw_curve(axes: Axes, curve: SolutionCurve, angle: str) -> None:
    colour = _curve_colour(curve)
    for low, high, kind in curve.pieces():
        line = curve.line(angle, low, high)
        if kind != "ridden":
            axes.plot(*line.T, color=colour, **_UNRIDDEN[kind], gid=kind)
            continue
        axes.plot(*line.T, color=colour, lw=_PLAIN, gid="pushed")
        if len(curve.families) > 1:  # a curve of two families is striped in their colours
            other = FAMILY_COLOURS[curve.families[1]]
            axes.plot(*line.T, color=other, lw=_PLAIN, dashes=(6, 6), gid="shared")
    for low, high in curve.unridden_stable:
        line = curve.line(angle, low, high)
        axes.plot(*line.T, color=colour, **_UNRIDDEN_STABLE, solid_capstyle="butt", gid="unridden stable")
    for low, high in curve.stable:
        axes.plot(*curve.line(angle, low, high).T, color=colour, lw=_STABLE, solid_capstyle="butt", gid="stable")
    for point in curve.limits:
        if point.kind == "flat":
            end = curve.line(angle)[0 if point.first else -1]
            to_limit = np.array([end, (point.speed, getattr(point, angle))])
            axes.plot(*to_limit.T, color=colour, lw=0.9, ls=":", gid="limit")


def _mark_points(axes: Axes, points: Sequence[NamedPoint], angle: str) -> None:
    for point in points:
        axes.plot(
            [point.speed],
            [getattr(point, angle)],
            ls="",
            **_marker_style(point),
            clip_on=False,
            zorder=7,
            gid=point.kind,
        )


def _marker_style(point: NamedPoint) -> dict[str, Any]:
    """Return the marker of a point: open for a limit, smaller for a cusp to which the paper gives no letter."""
    size = 2.8 if point.kind == "cusp" and not point.name else 4.6
    return {
        "marker": MARKERS[point.kind],
        "ms": size,
        "mfc": "white" if point.limit else INK,
        "mec": INK,
        "mew": 0.9 * size / 4.6,
    }


def _draw_legend(figure: Figure, drawn: Sequence[SolutionCurve], points: Sequence[NamedPoint], columns: int) -> None:
    numbers = sorted({number for curve in drawn for number in curve.families})
    handles: list[Line2D] = [Line2D([], [], color=FAMILY_COLOURS[k], lw=2, label=f"family {k}") for k in numbers]
    if any(not curve.families for curve in drawn):
        handles.append(Line2D([], [], color=GREY, lw=2, label="of no family"))
    if any(curve.stable for curve in drawn):
        handles.append(Line2D([], [], color=GREY, lw=_STABLE, solid_capstyle="butt", label="Lyapunov stable"))
    if any(curve.unridden_stable for curve in drawn):
        style = {**_UNRIDDEN_STABLE, "solid_capstyle": "butt"}
        handles.append(Line2D([], [], color=GREY, **style, label="stable, cannot be ridden"))
    kinds = {kind for curve in drawn for *_, kind in curve.pieces()}
    for kind, meaning in _UNRIDDEN_MEANINGS.items():
        if kind in kinds:
            handles.append(Line2D([], [], color=GREY, **_UNRIDDEN[kind], label=meaning))
    for kind, meaning in POINT_MEANINGS.items():
        # Of cusps the larger mark, if there is one.
        marked = sorted((point for point in points if point.kind == kind), key=lambda point: not point.name)
        if marked:
            limit = "limit: " if marked[0].limit else ""
            handles.append(Line2D([], [], ls="", label=f"{limit}{meaning}", **_marker_style(marked[0])))
    rows = max(2, math.ceil(len(handles) / 4))
    ncols = math.ceil(len(handles) / rows) if columns == 2 else 2
    figure.legend(handles=handles, loc="outside lower center", ncols=ncols, columnspacing=1.4)
