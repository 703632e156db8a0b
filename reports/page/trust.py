"""Meanings of the figures, and how far they can be trusted in a run."""

from __future__ import annotations

from collections.abc import Mapping
from decimal import ROUND_CEILING, Decimal
from typing import Any

from ...engines.engine import REFERENCE
from ..drawing import COLUMNS
from ..measure import QUANTITIES

# Metrics that the figures condense to, beside the table's columns.
_OF_FIGURES = ("rear_rate_error", "max_gap", "min_normal_force")


def list_meanings(horizon: bool) -> list[tuple[str, str, str, str]]:
    """Return key, title, unit and meaning of the metrics that a page names: the table's columns, then the figures'.

    Parameters
    ----------
    horizon : bool
        Whether the page shows the horizon.
    """
    titles = {metric: title for title, _, metric, _ in COLUMNS}
    others = (*(("horizon",) if horizon else ()), *_OF_FIGURES)
    titles |= {metric: metric.replace("_", " ") for metric in others}
    return [(key, title, QUANTITIES[key].unit, QUANTITIES[key].meaning) for key, title in titles.items()]


def explain_columns(
    name: str, values: Mapping[str, Any], growth_rate: float, duration: float, end: float | None = None
) -> str:
    """Explain how far an engine's row can be trusted.

    Parameters
    ----------
    name : str
    values : mapping
        The engine's metrics.
    growth_rate : float
        Growth rate of the motion's own disturbances [1/s].
    duration : float
        Duration of the run [s].
    end : float, optional
        Time of the engine's last sample [s]; unknown for a ride that ended early and is not available.

    Returns
    -------
    str
        Sentences.
    """
    if name == REFERENCE:
        return _reference(values)
    if values["position_error"] is None:
        return "There is no reference in this run: nothing is known of its error, only what it keeps and loses itself."
    until, stop = _stop(values, duration, end)
    if growth_rate <= 0:
        return f"The motion amplifies no error: what is seen is the engine's own, {stop or 'over the whole run'}."
    horizon = values["horizon"]
    if horizon is None:
        whole = f" {stop}" if stop else ""
        return f"It agrees with the reference to the last digit{whole}: there is no error that could grow."
    if horizon < until:
        return (
            f"Up to {horizon:.2f} s the error is the engine's, grown at the motion's rate of {growth_rate:.3g} 1/s. "
            "Beyond that it says nothing of the engine: any difference would have grown as large."
        )
    return (
        f"The error is the engine's, grown at the motion's rate of {growth_rate:.3g} 1/s; it would mean something up "
        f"to {horizon:.2f} s, longer than {'it rode: it is seen ' + stop if stop else 'the run'}."
    )


def _stop(values: Mapping[str, Any], duration: float, end: float | None) -> tuple[float, str]:
    """Return the time up to which an engine's ride lasts [s], and this as text; empty for a ride of the whole run."""
    if values.get("fell_at") is not None:
        return values["fell_at"], f"up to its fall at {values['fell_at']:.2f} s"
    if values.get("ended") is None:
        return duration, ""
    return (duration, "up to its early end") if end is None else (end, f"up to its early end at {end:.2f} s")


def _reference(values: Mapping[str, Any]) -> str:
    bounds = [
        f"{text} {_rounded_up(values[metric])}{unit}"
        for text, metric, unit in (
            ("its energy changes by at most", "energy_drift", " of itself"),
            ("its gaps stay within", "max_gap", " m"),
            ("its slip stays within", "max_slip", " m/s"),
        )
        if values.get(metric) is not None
    ]
    return (
        "The measure of the others, integrated to round-off. Its own bounds: " + ", ".join(bounds) + ". "
        "Errors of others near these sizes are its own as much as theirs."
    )


def _rounded_up(value: float, digits: int = 2) -> str:
    """Round a bound up to a few digits, so that it still holds."""
    exact = Decimal(repr(float(value)))
    if not exact:
        return "0"
    return f"{float(exact.quantize(Decimal(1).scaleb(exact.adjusted() + 1 - digits), ROUND_CEILING)):.{digits}g}"
