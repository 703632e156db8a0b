"""The columns of a sweep's data set."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import pyarrow as pa

from ...engines.storage import versioned_metadata
from .plan import Task

DONE = "done"  # a ride to its end
COMPUTED = (DONE, "fell", "ended", "no-motion")
REFUSED = "refused"  # an impossible point: its values contradict each other, or a drawn value is out of range
BROKEN = ("failed", "timeout", "killed", "memory")
STATUSES = (*COMPUTED, REFUSED, *BROKEN)

_LONGEST_REASON = 500  # characters

_ERRORS = ("position_error_max", "position_error_end", "orientation_error_max", "orientation_error_end")
ROW_FACTS = {
    "key": pa.string(),
    "index": pa.int64(),
    "version": pa.string(),
    "status": pa.string(),
    "reason": pa.string(),
}
METRICS: dict[str, pa.DataType] = {
    "family": pa.int64(),
    "growth_rate": pa.float64(),
    "size": pa.float64(),
    "warnings": pa.string(),
    **dict.fromkeys(_ERRORS, pa.float64()),
    **dict.fromkeys(
        ("rate_error", "rear_rate_error", "contact_force_error", "contact_force_error_at", "settled_force_error"),
        pa.float64(),
    ),
    **dict.fromkeys(("radius_drift_rate", "phase_drift_rate", "rear_rate_drift_rate"), pa.float64()),
    **dict.fromkeys(("energy_drift", "energy_drift_rate", "energy_variation"), pa.float64()),
    **dict.fromkeys(("max_gap", "max_slip", "mean_slip"), pa.float64()),
    **dict.fromkeys(("required_friction", "friction", "friction_left_at", "min_normal_force"), pa.float64()),
    "adaptations": pa.string(),
    "not_finite": pa.string(),
    "inconsistent_reports": pa.string(),
    "steps": pa.int64(),
    "unconverged_steps": pa.int64(),
    "largest_residual": pa.float64(),
    "fell_at": pa.float64(),
    "ended": pa.string(),
    "horizon": pa.float64(),
}
# Values that differ between runs of the same task; they are kept apart, so that the rest is equal to the bit.
TIMING: dict[str, pa.DataType] = {
    "key": pa.string(),
    "index": pa.int64(),
    "engine": pa.string(),
    "cpu_time": pa.float64(),
    "real_time_factor": pa.float64(),
    "engine_time": pa.float64(),
    "task_time": pa.float64(),
    "finished": pa.float64(),
    "host": pa.string(),
    "process": pa.int64(),
}


def row_schema(parameters: Mapping[str, set[type]], facts: Mapping[str, Any]) -> pa.Schema:
    """Return the columns of the data set except the engine, which is the partition: facts, parameters, metrics.

    Parameters
    ----------
    parameters : mapping
        Types of the values of each parameter; see `SweepPlan.parameters`.
    facts : mapping
        For the metadata.
    """
    kinds = {key: _column_type(found) for key, found in parameters.items()}
    fields = [*ROW_FACTS.items(), *kinds.items(), *METRICS.items()]
    return pa.schema([pa.field(name, kind) for name, kind in fields], metadata=versioned_metadata(facts))


def timing_schema(facts: Mapping[str, Any]) -> pa.Schema:
    """Return the columns of the timings; ``facts`` are for the metadata."""
    return pa.schema(list(TIMING.items()), metadata=versioned_metadata(facts))


def _column_type(kinds: set[type]) -> pa.DataType:
    if kinds == {bool}:
        return pa.bool_()
    if kinds == {int}:
        return pa.int64()
    if kinds <= {int, float}:
        return pa.float64()
    return pa.string()


def make_record(task: Task, row: Mapping[str, Any], columns: pa.Schema) -> dict[str, Any]:
    """Return a row as the data set has it: the task's parameters and the worker's results."""
    values: dict[str, Any] = {"key": task.key, "index": task.index, **row}
    for key, value in task.changes.items():
        text = columns.field(key).type == pa.string() and not isinstance(value, str)
        values[key] = json.dumps(value) if text else value
    return values


def has_status(table: pa.Table, *statuses: str) -> np.ndarray:
    """Return which rows have one of some statuses, shape (n,) of bool."""
    # Imported here: it takes as long as some rides, and workers do not need it.
    import pyarrow.compute as pc

    found = pc.is_in(table.column("status"), value_set=pa.array(statuses))  # pyright: ignore[reportAttributeAccessIssue]
    return np.asarray(found.to_numpy(), bool)


def reason_line(text: str) -> str:
    """Make a text fit for a row: a single line of limited length and valid characters."""
    return " ".join(text.encode(errors="replace").decode().split())[:_LONGEST_REASON]
