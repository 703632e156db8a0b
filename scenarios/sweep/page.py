"""The page of a complete sweep, beside its data set."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ..files import write_text
from ..run import library_versions
from .plan import SweepPlan
from .rows import DONE, has_status, row_schema
from .run import SweepOutcome
from .store import part_of

PAGE = "sweep.html"
_MOST_MARKS = 40  # of a parameter: more values are taken together, as many in each group


def write_sweep_page(plan: SweepPlan, outcome: SweepOutcome, document: Mapping[str, Any]) -> Path:
    """Write the page of a complete sweep into its folder.

    Parameters
    ----------
    plan : SweepPlan
    outcome : SweepOutcome
        Of a sweep without a missing run.
    document : mapping
        As `velodrome.scenarios.sweep.summary.summarise_sweep` returns it.

    Returns
    -------
    Path
    """
    # Imported here: it loads jinja, which workers do not need.
    from ...reports.page import make_sweep_page

    path = outcome.folder / PAGE
    write_text(path, make_sweep_page(document, _collect_errors(plan, outcome), library_versions()))
    return path


def _collect_errors(plan: SweepPlan, outcome: SweepOutcome) -> dict[str, dict[str, tuple[np.ndarray, np.ndarray]]]:
    """Return values and median errors by parameter and engine, for parameters of numbers."""
    columns = row_schema(plan.parameters, {})
    numbers = [
        key
        for key in plan.parameters
        if pa.types.is_floating(kind := columns.field(key).type) or pa.types.is_integer(kind)
    ]
    found: dict[str, dict[str, tuple[np.ndarray, np.ndarray]]] = {key: {} for key in numbers}
    for engine in plan.file.engines:
        table = pq.ParquetFile(part_of(outcome.folder, engine)).read(columns=["status", "position_error_max", *numbers])
        done = has_status(table, DONE)
        errors = np.array(table.column("position_error_max").to_numpy(), float)
        for key in numbers:
            values = np.array(table.column(key).to_numpy(), float)
            shown = done & np.isfinite(errors) & np.isfinite(values)
            if shown.any():
                found[key][engine] = group_medians(values[shown], errors[shown])
    return {key: series for key, series in found.items() if series}


def group_medians(values: np.ndarray, errors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the median error at each value, or of neighbouring values where there are many.

    Parameters
    ----------
    values, errors : ndarray, shape (n,)

    Returns
    -------
    tuple of ndarray
        Rising values, the medians of the groups, and the median error of each group.
    """
    order = np.argsort(values, kind="stable")
    values, errors = values[order], errors[order]
    unique, starts = np.unique(values, return_index=True)
    if len(unique) <= _MOST_MARKS:
        groups = np.split(np.arange(len(values)), starts[1:])
    else:
        groups = np.array_split(np.arange(len(values)), _MOST_MARKS)
    return (
        np.array([np.median(values[group]) for group in groups]),
        np.array([np.median(errors[group]) for group in groups]),
    )
