"""The results of a sweep by engine."""

from __future__ import annotations

import shlex
from collections.abc import Collection
from typing import Any

import numpy as np
import pyarrow.compute as pc
import pyarrow.parquet as pq

from .plan import SweepPlan
from .rows import BROKEN, DONE, REFUSED
from .run import SweepOutcome
from .store import TIMINGS, part_of

_REASONS = 5


def summarise_sweep(plan: SweepPlan, outcome: SweepOutcome) -> dict[str, Any]:
    """Return the JSON document of `velodrome sweep`.

    Parameters
    ----------
    plan : SweepPlan
    outcome : SweepOutcome

    Returns
    -------
    dict
        ``sweep, folder, tasks, missing, complete, stopped`` and ``engines``: by engine ``rows`` by status and, for
        a complete sweep, ``position_error`` (median and worst of whole rides' largest errors), ``rows_per_second``
        of one worker, and ``reasons`` of rows that broke or were refused.
    """
    complete = outcome.stopped is None
    engines: dict[str, Any] = {}
    for engine in plan.file.engines:
        entry: dict[str, Any] = {"rows": outcome.counts[engine]}
        engines[engine] = entry | (_summarise_results(outcome, engine) if complete else {})
    return {
        "sweep": plan.name,
        "title": plan.file.title,
        "folder": str(outcome.folder),
        "tasks": len(plan.tasks),
        "missing": outcome.missing,
        "complete": complete,
        "stopped": outcome.stopped,
        "engines": engines,
    }


def _summarise_results(outcome: SweepOutcome, engine: str) -> dict[str, Any]:
    columns = ["status", "reason", "position_error_max"]
    table = pq.ParquetFile(part_of(outcome.folder, engine)).read(columns=columns)
    # A ride that fell or ended early has an error up to there only.
    whole = table.filter(pc.field("status") == DONE)
    errors = whole.column("position_error_max").drop_null().to_numpy()
    error = {"median": float(np.median(errors)), "worst": float(errors.max())} if len(errors) else None
    timing = pq.read_table(outcome.folder / TIMINGS, filters=[("engine", "=", engine)], columns=["task_time"])
    seconds = timing.column("task_time").drop_null().to_numpy()
    broken = table.select(columns[:2]).filter(pc.field("status").isin([*BROKEN, REFUSED]))
    reasons = broken.group_by(columns[:2], use_threads=False).aggregate([])
    return {
        "position_error": error,
        "rows_per_second": float(len(seconds) / seconds.sum()) if seconds.sum() > 0 else None,
        "reasons": [f"{row['status']}: {row['reason']}" for row in reasons.slice(0, _REASONS).to_pylist()],
    }


def status_of(outcome: SweepOutcome) -> int:
    """Return the exit status: 0 if every run has its result, 1 if some broke or are missing, 130 after Ctrl-C."""
    if outcome.interrupted:
        return 130
    broke = any(counts.get(status) for counts in outcome.counts.values() for status in BROKEN)
    return int(broke or outcome.stopped is not None)


def resume_command(plan: SweepPlan, outcome: SweepOutcome, retry: Collection[str] = ()) -> str:
    """Return the command that continues a stopped sweep."""
    again = [part for status in retry for part in ("--retry", status)]
    return shlex.join(["velodrome", "sweep", str(plan.path), "--out", str(outcome.folder), "--resume", *again])
