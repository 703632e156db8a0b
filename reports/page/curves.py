"""The curves of the page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...engines.disk_arrays import release_pages
from ...engines.engine import REFERENCE
from ..drawing import ERROR, PLOTS, RADIUS, SMALLEST_SIZE, Plot, RideData, choose_samples

MOST_CURVE_POINTS = 1000  # largest number of points of a curve, about the number of pixels across
ALL_CURVE_POINTS = 40_000  # largest number of points of all curves together: less than a megabyte of the page
_DIGITS = 7


@dataclass(frozen=True)
class Panel:
    """One figure of curves over time.

    Attributes
    ----------
    key : str
        Key of the plot in `velodrome.reports.drawing.plots.PLOTS`.
    title : str
        Name of the quantity.
    unit : str
    meaning : str
        A sentence or two on what is drawn and how to read it.
    log : bool
        Whether the plot's values are decimal logarithms, to be read on a logarithmic axis.
    metric : str or None
        Key of the metric that condenses these values, whose definition the page and the documentation have.
    """

    key: str
    title: str
    unit: str
    meaning: str
    log: bool = False
    metric: str | None = None

    @property
    def plot(self) -> Plot:
        """Plot that computes the values."""
        return next(plot for plot in PLOTS if plot.key == self.key)


_ROUND_OFF = f"Sizes up to {SMALLEST_SIZE:g} are too small to be drawn."

ERROR_PANEL = Panel(
    "log_position_error",
    "Position error",
    "m",
    "Distance of the point D on the steering axis from the reference's, at the same time. On this axis exponential "
    f"growth is a straight line. {_ROUND_OFF}",
    True,
    "position_error",
)

GROUPS: tuple[tuple[str, tuple[Panel, ...]], ...] = (
    (
        "Error and energy",
        (
            ERROR_PANEL,
            Panel(
                "log_energy_change",
                "Energy change",
                "1",
                "Size of the change of kinetic and potential energy since the start, less the work of the inputs, "
                f"relative to the start's: whatever is seen is the engine's own. {_ROUND_OFF}",
                True,
                "energy_drift",
            ),
        ),
    ),
    (
        "Motion",
        (
            Panel("lean", "Lean", "rad", "Lean of the rear frame, positive to the right."),
            Panel("steer", "Steer", "rad", "Turn of the front frame about the steering axis, positive to the left."),
            Panel(
                "rear_rate",
                "Rear-wheel rate",
                "rad/s",
                "Rate of the rear wheel's turning, positive forward.",
                metric="rear_rate_error",
            ),
            Panel(
                "radius",
                "Radius",
                "m",
                "Distance of D from the bowl's axis: constant on an undisturbed circle.",
                metric="radius_drift_rate",
            ),
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
                metric="min_normal_force",
            ),
            Panel(
                "front_normal_force",
                "Normal force, front",
                "N",
                "Force of the ground on the front wheel along the normal. Below zero the ground would have to pull.",
                metric="min_normal_force",
            ),
            Panel(
                "rear_log_slip",
                "Slip, rear",
                "m/s",
                f"Speed of the rear wheel's material at its contact point: zero for a wheel that rolls. {_ROUND_OFF}",
                True,
                "max_slip",
            ),
            Panel(
                "front_log_slip",
                "Slip, front",
                "m/s",
                f"Speed of the front wheel's material at its contact point: zero for a wheel that rolls. {_ROUND_OFF}",
                True,
                "max_slip",
            ),
            Panel(
                "rear_log_gap",
                "Gap, rear",
                "m",
                f"Size of the distance of the rear wheel's rim from the ground: zero for a contact. {_ROUND_OFF}",
                True,
                "max_gap",
            ),
            Panel(
                "front_log_gap",
                "Gap, front",
                "m",
                f"Size of the distance of the front wheel's rim from the ground: zero for a contact. {_ROUND_OFF}",
                True,
                "max_gap",
            ),
        ),
    ),
)


def make_curve(time: np.ndarray, values: np.ndarray, most: int) -> dict[str, list[float | None]]:
    """Return the points of a curve as JSON: times ``t`` and values ``v``, with None where the curve is interrupted."""
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
    """Round a number to a number of significant digits."""
    return float(f"{value:.{digits}g}")


# Why an engine has no curve in a figure.
NOT_GIVEN, NOT_FINITE, THE_MEASURE = "not given", "not finite", "the measure itself"
TOO_SMALL = f"at most {SMALLEST_SIZE:g}"


@dataclass(frozen=True)
class DrawnCurve:
    """A panel with its values.

    Attributes
    ----------
    panel : Panel
    curves : dict
        Points by engine, as returned by `make_curve`.
    extremes : dict
        Smallest, largest and last value of all samples, by engine.
    absent : dict
        Why an engine has no curve, by engine: `NOT_GIVEN`, `NOT_FINITE`, `TOO_SMALL` or `THE_MEASURE`.
    """

    panel: Panel
    curves: dict[str, dict[str, list[float | None]]]
    extremes: dict[str, tuple[float, float, float]]
    absent: dict[str, str]


def draw_curves(ride: RideData, circular: bool) -> list[tuple[str, list[DrawnCurve]]]:
    """Make all panels for which any engine has values, in groups.

    Parameters
    ----------
    ride : RideData
    circular : bool
        Whether the motion circles the bowl's axis, so that its radius is meaningful.

    Returns
    -------
    list of (str, list of DrawnCurve)
        Title of the group and its panels; groups without a panel are omitted.
    """
    panels = [
        (title, panel, _explain_absent(ride, panel))
        for title, panels in GROUPS
        for panel in panels
        if circular or panel.key != RADIUS.key
    ]
    count = sum(len(ride.trajectories) - len(absent) for _, _, absent in panels)
    most = max(4, min(MOST_CURVE_POINTS, ALL_CURVE_POINTS // max(1, count)))
    groups: dict[str, list[DrawnCurve]] = {}
    for title, panel, absent in panels:
        if len(absent) < len(ride.trajectories):
            groups.setdefault(title, []).append(_draw_panel(ride, panel, absent, most))
    return list(groups.items())


def _explain_absent(ride: RideData, panel: Panel) -> dict[str, str]:
    """Return why engines have no values of a panel that can be drawn; the engines that have some are not in it."""
    absent: dict[str, str] = {}
    for name, run in ride.trajectories.items():
        series = panel.plot.values(ride, run)
        if series is None:
            absent[name] = THE_MEASURE if name == REFERENCE and panel.plot is ERROR else NOT_GIVEN
        elif not np.isfinite(series).any():
            # A finite quantity has no logarithm only where it is too small.
            absent[name] = TOO_SMALL if panel.log and not run.not_finite() else NOT_FINITE
        release_pages(run)
    return absent


def _draw_panel(ride: RideData, panel: Panel, absent: dict[str, str], most: int) -> DrawnCurve:
    """Draw a panel with curves of ``most`` points, computing the values of one engine at a time."""
    curves: dict[str, dict[str, list[float | None]]] = {}
    extremes: dict[str, tuple[float, float, float]] = {}
    for name, run in ride.trajectories.items():
        series = None if name in absent else panel.plot.values(ride, run)
        if series is not None:
            curves[name] = make_curve(run.time, series, most)
            extremes[name] = _find_extremes(series, panel.log)
        release_pages(run)
    return DrawnCurve(panel, curves, extremes, absent)


def _find_extremes(values: np.ndarray, log: bool) -> tuple[float, float, float]:
    finite = values[np.isfinite(values)]
    three = (float(finite.min()), float(finite.max()), float(finite[-1]))
    return (10 ** three[0], 10 ** three[1], 10 ** three[2]) if log else three


def panel_data(drawn: DrawnCurve, names: Sequence[str], measured: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Return a panel as JSON for the page's script, with engines by their index in ``names``."""
    marks = []
    if drawn.panel is ERROR_PANEL:
        # A horizon beyond the ride says nothing of it.
        horizons = {name: measured.get(name, {}).get("horizon") for name in drawn.curves}
        ends = {name: points["t"][-1] for name, points in drawn.curves.items()}
        marks = [
            {"engine": names.index(name), "t": t} for name, t in horizons.items() if t is not None and t < ends[name]
        ]
    return {
        "key": drawn.panel.key,
        "log": drawn.panel.log,
        "unit": drawn.panel.unit,
        "span": drawn.panel.plot.span,
        "marks": marks,
        "absent": {str(names.index(name)): reason for name, reason in drawn.absent.items()},
        "curves": {str(names.index(name)): points for name, points in drawn.curves.items()},
    }
