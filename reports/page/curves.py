"""The curves of the page: which, and which of their samples."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..drawing import PLOTS, RADIUS, Plot, RideData, drawable_values

MOST_CURVE_POINTS = 1000  # points of a curve: as many as pixels side by side
ALL_CURVE_POINTS = 40_000  # points of all curves together: under a megabyte of page
_DIGITS = 7


@dataclass(frozen=True)
class Panel:
    """One figure of curves over time.

    Attributes
    ----------
    key : str
        Of the plot in `velodrome.reports.drawing.plots.PLOTS`.
    title : str
        The quantity in words.
    unit : str
    meaning : str
        A sentence or two: what is drawn, how to read it.
    log : bool
        Whether the plot's values are decimal logarithms, to be read on a logarithmic axis.
    """

    key: str
    title: str
    unit: str
    meaning: str
    log: bool = False

    @property
    def plot(self) -> Plot:
        """The plot that computes the values."""
        return next(plot for plot in PLOTS if plot.key == self.key)


_ROUND_OFF = "Sizes below 1e-16 are not drawn."

GROUPS: tuple[tuple[str, tuple[Panel, ...]], ...] = (
    (
        "Error and energy",
        (
            Panel(
                "log_position_error",
                "Position error",
                "m",
                "Distance of the point D on the steering axis from the reference's, at the same time. On this axis "
                f"exponential growth is a straight line. {_ROUND_OFF}",
                True,
            ),
            Panel(
                "log_energy_change",
                "Energy change",
                "1",
                "Size of the change of kinetic and potential energy since the start, relative to the start's. Nothing "
                f"here dissipates: whatever is seen is the engine's own. {_ROUND_OFF}",
                True,
            ),
        ),
    ),
    (
        "Motion",
        (
            Panel("lean", "Lean", "rad", "Lean of the rear frame, positive to the right."),
            Panel("steer", "Steer", "rad", "Turn of the front frame about the steering axis, positive to the left."),
            Panel("rear_rate", "Rear-wheel rate", "rad/s", "Rate of the rear wheel's turning, positive forward."),
            Panel("radius", "Radius", "m", "Distance of D from the bowl's axis: constant on an undisturbed circle."),
        ),
    ),
    (
        "Contact",
        (
            Panel(
                "rear_normal_force",
                "Normal force, rear",
                "N",
                "Force of the ground on the rear wheel along the normal. Below zero the ground would have to pull.",
            ),
            Panel(
                "front_normal_force",
                "Normal force, front",
                "N",
                "Force of the ground on the front wheel along the normal. Below zero the ground would have to pull.",
            ),
            Panel(
                "rear_log_slip",
                "Slip, rear",
                "m/s",
                f"Speed of the rear wheel's material at its contact point: zero for a wheel that rolls. {_ROUND_OFF}",
                True,
            ),
            Panel(
                "front_log_slip",
                "Slip, front",
                "m/s",
                f"Speed of the front wheel's material at its contact point: zero for a wheel that rolls. {_ROUND_OFF}",
                True,
            ),
            Panel(
                "rear_log_gap",
                "Gap, rear",
                "m",
                f"Size of the distance of the rear wheel's rim from the ground: zero for a contact. {_ROUND_OFF}",
                True,
            ),
            Panel(
                "front_log_gap",
                "Gap, front",
                "m",
                f"Size of the distance of the front wheel's rim from the ground: zero for a contact. {_ROUND_OFF}",
                True,
            ),
        ),
    ),
)


def choose_samples(values: np.ndarray, most: int) -> np.ndarray:
    """Choose samples that draw a curve: the least and the largest of each of equal parts, the first, the last.

    No extreme of the curve is lost, however short.

    Parameters
    ----------
    values : ndarray, shape (n,)
        NaN where there is none.
    most : int
        Samples to choose at most, at least 4.

    Returns
    -------
    ndarray of int
        Indices, rising, of finite values.
    """
    finite = np.flatnonzero(np.isfinite(values))
    if len(finite) <= most:
        return finite
    parts = np.array_split(finite, (most - 2) // 2)
    chosen = [finite[0], finite[-1]]
    for part in parts:
        chosen += [part[values[part].argmin()], part[values[part].argmax()]]
    return np.unique(chosen)


def make_curve(time: np.ndarray, values: np.ndarray, most: int) -> dict[str, list[float | None]]:
    """Points of a curve as JSON: times ``t`` and values ``v``, a None between points that nothing joins."""
    chosen = choose_samples(values, most)
    absent = np.cumsum(~np.isfinite(values))
    t: list[float | None] = []
    v: list[float | None] = []
    before = None
    for index in chosen.tolist():
        if before is not None and absent[index] > absent[before]:
            t.append(round_values(time.item(index)))
            v.append(None)
        t.append(round_values(time.item(index)))
        v.append(round_values(values.item(index)))
        before = index
    return {"t": t, "v": v}


def round_values(value: float, digits: int = _DIGITS) -> float:
    """A number with fewer digits."""
    return float(f"{value:.{digits}g}")


@dataclass(frozen=True)
class DrawnCurve:
    """A panel with its values.

    Attributes
    ----------
    panel : Panel
    curves : dict
        Engine to points, as `make_curve` gives them.
    extremes : dict
        Engine to the least and the largest value and the last, of all samples.
    """

    panel: Panel
    curves: dict[str, dict[str, list[float | None]]]
    extremes: dict[str, tuple[float, float, float]]


def draw_curves(ride: RideData, circular: bool) -> list[tuple[str, list[DrawnCurve]]]:
    """All panels that any engine has values for, in groups.

    Parameters
    ----------
    ride : Ride
    circular : bool
        Whether the motion circles the bowl's axis, so that its radius means something.

    Returns
    -------
    list of (str, list of Drawn)
        Title of the group and its panels; groups without a panel are left out.
    """
    found = [
        (title, panel, drawable_values(ride, panel.plot))
        for title, panels in GROUPS
        for panel in panels
        if circular or panel.key != RADIUS.key
    ]
    count = sum(len(values) for _, _, values in found)
    most = max(4, min(MOST_CURVE_POINTS, ALL_CURVE_POINTS // max(1, count)))
    groups: dict[str, list[DrawnCurve]] = {}
    for title, panel, values in found:
        if not values:
            continue
        curves = {name: make_curve(ride.trajectories[name].time, series, most) for name, series in values.items()}
        extremes = {name: _extremes(series, panel.log) for name, series in values.items()}
        groups.setdefault(title, []).append(DrawnCurve(panel, curves, extremes))
    return list(groups.items())


def _extremes(values: np.ndarray, log: bool) -> tuple[float, float, float]:
    finite = values[np.isfinite(values)]
    three = (float(finite.min()), float(finite.max()), float(finite[-1]))
    return (10 ** three[0], 10 ** three[1], 10 ** three[2]) if log else three


def panel_data(shown: DrawnCurve, names: Sequence[str], measured: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """A panel as JSON for the page's script; engines by their number in ``names``."""
    marks = []
    if shown.panel.key == "log_position_error":
        horizons = {name: measured.get(name, {}).get("horizon") for name in shown.curves}
        marks = [{"engine": names.index(name), "t": t} for name, t in horizons.items() if t is not None]
    return {
        "key": shown.panel.key,
        "log": shown.panel.log,
        "unit": shown.panel.unit,
        "span": shown.panel.plot.span,
        "marks": marks,
        "curves": {str(names.index(name)): points for name, points in shown.curves.items()},
    }
