"""The results of a sweep by engine."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
import pyarrow.parquet as pq
from rich.console import Console
from rich.table import Table

from .live import ROW_STYLES
from .plan import SweepPlan
from .rows import BROKEN, REFUSED
from .run import SweepOutcome
from .store import RESULTS, TIMINGS, part_of

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
        a complete sweep, ``position_error`` (median and worst of the largest errors), ``rows_per_second`` of one
        worker, and ``reasons`` of rows that broke or were refused.
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
    errors = table.column("position_error_max").drop_null().to_numpy()
    error = {"median": float(np.median(errors)), "worst": float(errors.max())} if len(errors) else None
    timing = pq.read_table(outcome.folder / TIMINGS, filters=[("engine", "=", engine)], columns=["task_time"])
    seconds = timing.column("task_time").drop_null().to_numpy()
    broken = [row for row in table.select(columns[:2]).to_pylist() if row["status"] in (*BROKEN, REFUSED)]
    return {
        "position_error": error,
        "rows_per_second": float(len(seconds) / seconds.sum()) if seconds.sum() > 0 else None,
        "reasons": list(dict.fromkeys(f"{row['status']}: {row['reason']}" for row in broken))[:_REASONS],
    }


def status_of(outcome: SweepOutcome) -> int:
    """Return the exit status: 0 if every run has its result, 1 if some broke or are missing, 130 after Ctrl-C."""
    if outcome.interrupted:
        return 130
    broke = any(counts.get(status) for counts in outcome.counts.values() for status in BROKEN)
    return int(broke or outcome.stopped is not None)


def resume_command(plan: SweepPlan, outcome: SweepOutcome, retry: Collection[str] = ()) -> str:
    """Return the command that continues a stopped sweep."""
    again = "".join(f" --retry {status}" for status in retry)
    return f"velodrome sweep {plan.path} --out {outcome.folder} --resume{again}"


def show_summary(console: Console, document: Mapping[str, Any], resume: str) -> None:
    """Print a table by engine, why rows broke, and where the data set is or how to continue."""
    entries: Mapping[str, Mapping[str, Any]] = document["engines"]
    statuses = [status for status in ROW_STYLES if any(entry["rows"].get(status) for entry in entries.values())]
    table = Table("engine", box=None, pad_edge=False)
    for status in statuses:
        table.add_column(status, justify="right", style=ROW_STYLES[status], no_wrap=True)
    for title in ("error,\nmedian, m", "error,\nworst, m", "rows/s of\na worker"):
        table.add_column(title, justify="right", no_wrap=True)
    for name, entry in entries.items():
        error = entry.get("position_error") or {}
        numbers = (error.get("median"), error.get("worst"), entry.get("rows_per_second"))
        cells = ("–" if number is None else f"{number:.3g}" for number in numbers)
        table.add_row(name, *(str(entry["rows"].get(status, 0)) for status in statuses), *cells)
    console.print(table)
    for name, entry in entries.items():
        for reason in entry.get("reasons", ()):
            _print_line(console, f"{name} {reason}", ROW_STYLES[reason.partition(":")[0]])
    if document["stopped"] is None:
        _print_line(console, f"data set: {document['folder']}/{RESULTS}")
        return
    missing = f"{document['missing']} of {document['tasks']} runs are missing, finished runs are kept"
    _print_line(console, f"{document['stopped']}: {missing}", "yellow")
    _print_line(console, f"continue with: {resume}")


def _print_line(console: Console, line: str, style: str | None = None) -> None:
    console.print(line, style=style, markup=False, highlight=False, soft_wrap=True)
