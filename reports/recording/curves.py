"""The curves of a recording and the ranges of their axes."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping

import numpy as np
import rerun as rr

from ...engines.engine import REFERENCE
from ..drawing import Colour, Plot, PlotCurve, RideData, choose_samples, drawable_values
from .clock import Clock
from .thinning import MOST_SAMPLES

# The viewer draws curves in the order of their paths: the reference first and wide, the others on top of it.
REFERENCE_CURVE, CURVE = 3.4, 2.0
EXPECTED, EXPECTED_CURVE, EXPECTED_COLOUR = "linear law", 1.0, (150, 155, 165)
_MARGIN = 0.06  # free above and below the curves that rule an axis, of their height

# Samples of each plot by its key, then by engine.
Curves = Mapping[str, Mapping[str, PlotCurve]]


def find_curves(ride: RideData, plots: Iterable[Plot], stride: int) -> dict[str, dict[str, PlotCurve]]:
    """Return the finite samples of every plot: (times, values) by key and engine, without empty ones.

    Parameters
    ----------
    ride : RideData
    plots : iterable of Plot
    stride : int
        How many samples the recording takes one of. Of as many samples in a row as two of these stand for, a curve
        keeps the smallest and the largest, so that no peak is lost.
    """
    curves: dict[str, dict[str, PlotCurve]] = {}
    for plot in plots:
        found: dict[str, PlotCurve] = {}
        for name, values in drawable_values(ride, plot).items():
            kept = choose_samples(values, max(4, len(values) // stride) if stride > 1 else len(values))
            found[name] = ride.trajectories[name].time[kept], values[kept]
        law = plot.expected(ride)
        if law is not None and found:
            # Values below all measured ones would only extend the axis.
            visible = law[1] >= min(values.min() for _, values in found.values())
            visible &= np.arange(len(visible)) % max(1, -(-len(visible) // MOST_SAMPLES)) == 0
            found |= {EXPECTED: (law[0][visible], law[1][visible])} if visible.any() else {}
        if found:
            curves[plot.key] = found
    return curves


def find_range(
    plot: Plot, curves: Mapping[str, PlotCurve], staying: Collection[str]
) -> tuple[tuple[float, float] | None, list[str]]:
    """Find the range of a plot's axis, and the engines whose curves leave it.

    Parameters
    ----------
    plot : Plot
    curves : mapping
        By engine.
    staying : collection of str
        Engines that ride to the end: their curves rule the axis, unless none of them has one.

    Returns
    -------
    range : tuple of float or None
        None where the viewer's own range, of all curves, is right: it would magnify round-off to the full height, and
        follow the curves of those that fell.
    beyond : list of str
    """
    ruling = [values for name, (_, values) in curves.items() if name in staying or name == EXPECTED]
    ruling = ruling or [values for _, values in curves.values()]
    low, high = min(float(values.min()) for values in ruling), max(float(values.max()) for values in ruling)
    height = max(high - low, plot.span) or 1.0
    middle, half = 0.5 * (low + high), (0.5 + _MARGIN) * height
    beyond = [
        name for name, (_, values) in curves.items() if values.min() < middle - half or values.max() > middle + half
    ]
    return (None if high - low >= plot.span and not beyond else (middle - half, middle + half)), beyond


def send_curve(
    stream: rr.RecordingStream, key: str, name: str, curve: PlotCurve, paint: Mapping[str, Colour], clock: Clock
) -> None:
    """Send one engine's curve of a plot, or the curve that theory predicts."""
    if name == EXPECTED:
        entity, colour, width = [key, "expected"], EXPECTED_COLOUR, EXPECTED_CURVE
    elif name == REFERENCE:
        entity, colour, width = [key, name], paint[name], REFERENCE_CURVE
    else:
        entity, colour, width = [key, "tested", name], paint[name], CURVE
    path = rr.new_entity_path(["plots", *entity])
    stream.log(path, rr.SeriesLines(names=name, colors=colour, widths=width), static=True)
    stream.send_columns(path, clock.columns(curve[0]), rr.Scalars.columns(scalars=curve[1]))
