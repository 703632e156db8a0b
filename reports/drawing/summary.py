"""The run in words, and the cells of its table, from the metrics."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from ...engines.engine import REFERENCE
from ...reference.inputs import Inputs
from ...reference.surface import Surface, SurfaceOfRevolution
from .numbers import format_numbers

# (title, unit, metric, part of a metric that has parts)
COLUMNS: tuple[tuple[str, str, str, str | None], ...] = (
    ("position error", "m", "position_error", "max"),
    ("rotation error", "rad", "orientation_error", "max"),
    ("rate error", "1", "rate_error", None),
    ("force error", "1", "contact_force_error", None),
    ("radius drift", "m/s", "radius_drift_rate", None),
    ("energy drift", "1", "energy_drift", None),
    ("largest slip", "m/s", "max_slip", None),
    ("CPU time", "s", "cpu_time", None),
)


def rank_engines(measured: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """List the engines of a run in the order of its tables.

    The reference comes first, then the others by position error; those that fell or ended early come last, the latest
    first, since their errors are those up to there only. Engines with equal errors stay in their order.

    Parameters
    ----------
    measured : mapping
        Metrics by engine name.

    Returns
    -------
    list of str
    """

    def rank(name: str) -> tuple[int, float]:
        values = measured[name]
        if name == REFERENCE:
            return 0, 0.0
        # Folders of earlier versions do not have every metric.
        if values.get("fell_at") is not None:
            return 2, -values["fell_at"]
        error = (values.get("position_error") or {}).get("max")
        return (1 if values.get("ended") is None else 2), math.inf if error is None else error

    return sorted(measured, key=rank)


def is_whole_ride(metrics: Mapping[str, Any]) -> bool:
    """Return whether an engine rode to the end: it neither fell nor ended early."""
    # Folders of earlier versions do not have every metric.
    return metrics.get("fell_at") is None and metrics.get("ended") is None


def format_table(measured: Mapping[str, Mapping[str, Any]]) -> dict[str, list[str]]:
    """Format the table of a run: the cells of `COLUMNS` by engine, in the order of `rank_engines`.

    Each column has one notation, see `format_numbers`, which the whole rides decide; a dash stands where there is no
    value.
    """
    names = rank_engines(measured)
    whole = [is_whole_ride(measured[name]) for name in names]
    columns = [
        format_numbers([_pick(measured[name].get(metric), part) for name in names], deciding=whole)
        for _, _, metric, part in COLUMNS
    ]
    return {name: [cells[k] for cells in columns] for k, name in enumerate(names)}


def _pick(value: Any, part: str | None) -> Any:
    return value.get(part) if isinstance(value, Mapping) else value


def describe_required_friction(measured: Mapping[str, Mapping[str, Any]]) -> str | None:
    """Describe the friction that rolling needs by the reference's forces; None where it is not known.

    Engines whose wheels are bound to roll have no limit of friction; whether a real wheel would hold is for the reader.
    """
    needed = measured.get(REFERENCE, {}).get("required_friction")
    return None if needed is None else f"Rolling without slip needs a coefficient of friction of up to {needed:.3g}."


def format_verdict(verdict: Mapping[str, Any]) -> str:
    """Format a verdict as one line."""
    value = "not done" if verdict["value"] is None else f"{verdict['value']:.3g}"
    word = "holds" if verdict["holds"] else "falls short"
    return f"{verdict['engine']}: {verdict['quantity']} {value}, limit {verdict['limit']:.3g}: {word}"


def find_unsteadiness(surface: Surface, inputs: Inputs, circular: bool) -> str | None:
    """Return what makes a ride's undisturbed motion unsteady, as `describe_stability` takes it; None if it is steady.

    Parameters
    ----------
    surface : Surface
    inputs : Inputs
    circular : bool
        Whether the motion is a circular one, which its inputs hold, or a straight and upright one.
    """
    if not isinstance(surface, SurfaceOfRevolution):
        return "ground"
    return None if circular or inputs.steer_torque == inputs.rear_wheel_torque == 0 else "torques"


def describe_stability(growth_rate: float, unsteady: str | None = None) -> str:
    """Describe the fate of a motion's disturbances in one sentence.

    Parameters
    ----------
    growth_rate : float
        Growth rate of the motion [1/s]; that of the same start on the level plane if the ground makes the motion
        unsteady, and that of the equations frozen at the start if torques do.
    unsteady : {"ground", "torques"}, optional
        What makes the motion unsteady, if it is: ground without symmetry about the z axis, or torques on a straight
        start.
    """
    if unsteady is not None:
        fate = f"decay at {-growth_rate:.4g} 1/s" if growth_rate < 0 else f"grow like exp({growth_rate:.4g} t / s)"
        if unsteady == "torques":
            return f"With its torques this start is no steady motion; frozen there, disturbances would {fate}."
        return f"On this ground no motion is steady; on the level plane disturbances of this start would {fate}."
    if growth_rate < 0:
        return f"The motion is Lyapunov stable: its slowest disturbance decays at {-growth_rate:.4g} 1/s."
    return f"The motion is unstable: disturbances grow like exp({growth_rate:.4g} t / s)."
