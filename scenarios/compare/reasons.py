"""Why two rides of an engine are not the same, in lines of text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...engines.engine import Trajectory
from .fields import FieldDifference, FieldOfOneRun
from .metric_changes import MetricChange
from .positions import PositionDifference


def list_reasons(
    position: PositionDifference,
    compared: Mapping[str, FieldDifference | FieldOfOneRun],
    metrics: Mapping[str, MetricChange],
    rides: tuple[Trajectory, Trajectory],
) -> list[str]:
    """List why two rides are not the same, one line for each reason; empty if they are.

    Parameters
    ----------
    position : PositionDifference
    compared : mapping
        Differences of the other fields, by field.
    metrics : mapping
        Changes of the metrics, by metric.
    rides : (Trajectory, Trajectory)
        The earlier and the later ride.
    """
    reasons = []
    if position.exceeds_at is not None:
        far = "" if position.max is None else f", by up to {position.max:.3g} m"
        reasons.append(f"positions are apart by more than round-off from {position.exceeds_at:.4g} s on{far}")
    reasons += [line for name, field in compared.items() if (line := _field_reason(name, field)) is not None]
    before, after = rides
    if len(before.time) != len(after.time) or before.ended != after.ended:
        ends = (f"at {ride.time[-1]:.4g} s ({ride.ended or 'its end'})" for ride in rides)
        reasons.append("they end differently: " + " and ".join(ends))
    if before.friction != after.friction:
        reasons.append(f"friction: {format_value(before.friction)} -> {format_value(after.friction)}")
    if before.unconverged_steps != after.unconverged_steps:
        counts = (format_value(ride.unconverged_steps) for ride in rides)
        reasons.append("steps whose iterations did not converge: " + " -> ".join(counts))
    reasons += [_metric_reason(name, metric) for name, metric in metrics.items() if metric.holds is False]
    return reasons


def _field_reason(name: str, field: FieldDifference | FieldOfOneRun) -> str | None:
    """Describe how a field differs; None if it is within its limit."""
    title = name.replace("_", " ")
    if isinstance(field, FieldOfOneRun):
        return f"{title}: only the run {field.only_in} has it"
    if field.exceeds_at is None:
        return None
    more = field.columns_beyond - 1
    column = field.column.replace("_", " ") + (f" and {more} more" if more else "")
    what = column if name in (field.column, "q", "qd") else f"{title} ({column})"
    far = "no number in one" if field.max is None else f"by up to {field.max:.3g} {field.unit}".removesuffix(" 1")
    return (
        f"{what}: apart by more than round-off from {field.exceeds_at:.4g} s on, where {field.allowed_first:.2g} "
        f"is allowed, {far}"
    )


def _metric_reason(name: str, metric: MetricChange) -> str:
    change = "" if metric.change is None else f", by {metric.change:.2g}"
    return f"{name}: {format_value(metric.before)} -> {format_value(metric.after)}{change}, limit {metric.limit:.2g}"


def format_value(value: Any) -> str:
    """Return a value of a document as text."""
    return "none" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)
