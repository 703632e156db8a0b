"""What a run shows, in words: which engine drifts most, from when, what goes with it, and how far to trust it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...engines.engine import REFERENCE
from ..drawing import ERROR, RideData, rank_engines
from .tables import format_after_upright

# A bicycle is a metre long: a millimetre is far above round-off and far below anything that changes the ride.
NOTED = 1e-3  # [m]
# Slip explains an error if its path, summed over the ride, is at least this share of it.
EXPLAINING = 0.5
# Growth of the motion's own is told from this factor on.
GROWN = 10.0
_LARGEST_PLAIN = 1e5
# Engines whose errors differ by less are said to drift alike.
_ALIKE = 0.01
NEVER = "never"


@dataclass(frozen=True)
class Finding:
    """A row of the first table of a page: an engine, its error, and what a reader wants to know of it.

    Attributes
    ----------
    name : str
    error : str
        Largest position error [m], or a dash.
    since : str
        Time from which the error exceeds a millimetre [s], `NEVER`, or a dash.
    cause : str
        What goes with the error.
    until : str
        How far the error means something.
    stays_up : bool
        False for a ride that fell or ended early.
    """

    name: str
    error: str
    since: str
    cause: str
    until: str
    stays_up: bool


def stays_up(values: Mapping[str, Any]) -> bool:
    """Return whether an engine's metrics are those of a ride that neither fell nor ended early."""
    return values.get("fell_at") is None and values.get("ended") is None


def describe_stop(values: Mapping[str, Any], end: float | None) -> str | None:
    """Return how and when a ride ended before its time, such as ``fell at 0.48 s``; None if it did not.

    Parameters
    ----------
    values : mapping
        The engine's metrics.
    end : float or None
        Time of its last sample [s].
    """
    if values.get("fell_at") is not None:
        return f"fell at {values['fell_at']:.2f} s"
    if values.get("ended") is None:
        return None
    return "ended early" if end is None else f"ended at {end:.2f} s"


def list_findings(measured: Mapping[str, Mapping[str, Any]], ride: RideData, duration: float) -> list[Finding]:
    """Return a row for each engine, in the order of the tables.

    Parameters
    ----------
    measured : mapping
        Metrics by engine name.
    ride : RideData
        The trajectories; an engine without one has no time from which its error is noted.
    duration : float
        Duration of the run [s].
    """
    names = rank_engines(measured)
    upright = [stays_up(measured[name]) for name in names]
    errors = dict(
        zip(names, format_after_upright([_pick_error(measured[name]) for name in names], upright), strict=True)
    )
    return [_describe_engine(name, measured[name], errors[name], ride, duration) for name in names]


def write_headline(
    measured: Mapping[str, Mapping[str, Any]], ride: RideData, growth_rate: float, duration: float
) -> str:
    """Return which engine drifts most, how far, from when and why, which stays closest, and what fell."""
    others = [name for name in rank_engines(measured) if name != REFERENCE]
    known = {name: error for name in others if (error := _pick_error(measured[name])) is not None}
    up = {name: error for name, error in known.items() if stays_up(measured[name])}
    sentences = []
    if others and not known:
        sentences.append("There is no reference in this run, so that no engine's error is known.")
    if up:
        most, least = max(up.values()), min(up.values())
        first = [name for name, error in up.items() if error >= (1 - _ALIKE) * most]
        if most == 0:
            sentences.append(f"{_join(first)}: no difference from the reference.")
        else:
            since = min((t for name in first if (t := find_noted(ride, name)) is not None), default=None)
            when = "never a millimetre" if since is None else f"by more than a millimetre from {since:.2f} s on"
            each = " each" if len(first) > 1 else ""
            among = "" if all(stays_up(measured[name]) for name in others) else "Of the engines that ride to the end, "
            sentences.append(
                f"{among}{_join(first)} {'drift' if each else 'drifts'} most:{each} {most:.2g} m from the reference, "
                f"{when}. "
                f"What goes with it: {explain_error(measured[first[0]], duration)}."
            )
        closest = [name for name, error in up.items() if error <= (1 + _ALIKE) * least]
        if len(closest) + len(first) <= len(up):
            sentences.append(f"{_join(closest)} {'stay' if len(closest) > 1 else 'stays'} closest: {least:.2g} m.")
    growth = describe_growth(growth_rate, duration)
    sentences += [] if growth is None else [growth]
    for name in others:
        stop = describe_stop(measured[name], _find_end(ride, name))
        if stop is not None:
            sentences.append(f"{name} {stop}.")
    return " ".join(sentences)


def find_noted(ride: RideData, name: str) -> float | None:
    """Return the first time at which an engine's position error exceeds `NOTED` [s]; None if there is none."""
    run = ride.trajectories.get(name)
    sizes = None if run is None else ERROR.values(ride, run)
    if run is None or sizes is None:
        return None
    over = np.flatnonzero(sizes > math.log10(NOTED))  # a comparison with NaN is false
    return float(run.time[over[0]]) if len(over) else None


def explain_error(values: Mapping[str, Any], rode: float) -> str:
    """Return what goes with an engine's position error: slip, friction, iterations, or none of them.

    Parameters
    ----------
    values : mapping
        The engine's metrics.
    rode : float
        Time for which it rode [s].
    """
    error = _pick_error(values)
    if error is None:
        return "–"
    if error == 0:
        return "no error to the last digit"
    slipped = values["mean_slip"] * rode if values.get("mean_slip") is not None else None
    if values.get("friction_left_at") is not None and values.get("required_friction") is not None:
        return f"slides: rolling needs a friction of {values['required_friction']:.3g}, it has {values['friction']:.3g}"
    if slipped is not None and slipped >= EXPLAINING * error:
        return f"its wheels slip, {slipped:.2g} m in all"
    if values.get("unconverged_steps"):
        return f"iterations not converged in {values['unconverged_steps']} of {values['steps']} steps"
    return "its slip is not known" if slipped is None else f"its steps or its model; slip is {slipped:.2g} m in all"


def describe_growth(growth_rate: float, duration: float) -> str | None:
    """Return how much a motion multiplies errors over a run, in a sentence; None where that is little.

    Parameters
    ----------
    growth_rate : float
        Growth rate of the motion's own disturbances [1/s].
    duration : float
        Duration of the run [s].
    """
    factor = math.exp(min(growth_rate * duration, 700.0))
    if factor < GROWN:
        return None
    told = f"{factor:.1e}" if factor >= _LARGEST_PLAIN else f"{float(f'{factor:.2g}'):g}"
    return f"The motion itself multiplies any error by {told} in {duration:g} s."


def _describe_engine(name: str, values: Mapping[str, Any], error: str, ride: RideData, duration: float) -> Finding:
    end = _find_end(ride, name)
    stop = describe_stop(values, end)
    if name == REFERENCE:
        kept = values.get("energy_drift")
        cause = "the measure of the others" + ("" if kept is None else f"; energy kept to {kept:.1e}")
        return Finding(name, error, "–", cause, stop or "to the end", stop is None)
    since = find_noted(ride, name)
    known = _pick_error(values) is not None and name in ride.trajectories
    rode = values["fell_at"] if values.get("fell_at") is not None else duration if stop is None else end or duration
    horizon = values.get("horizon")
    until = stop or "to the end"
    if horizon is not None and horizon < rode:
        until = f"up to {horizon:.2f} s" + (f"; {stop}" if stop else "")
    return Finding(
        name,
        error,
        ("–" if not known else NEVER) if since is None else f"{since:.2f}",
        explain_error(values, rode),
        until,
        stop is None,
    )


def _find_end(ride: RideData, name: str) -> float | None:
    return float(ride.trajectories[name].time[-1]) if name in ride.trajectories else None


def _pick_error(values: Mapping[str, Any]) -> float | None:
    return (values.get("position_error") or {}).get("max")


def _join(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
