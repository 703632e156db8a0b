"""The page of two runs of one scenario against each other, as one self-contained HTML document without a script."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..drawing import format_numbers
from . import words
from .document import list_engine_styles, render_page
from .tables import PageTable, TableColumn, number_column
from .timelines import draw_over_time

_FIELD_COLUMNS = (
    ("largest difference", "", "max"),
    ("at", "s", "max_at"),
    ("allowed there", "", "allowed"),
    ("beyond from", "s", "exceeds_at"),
)
_METRIC_COLUMNS = ("before", "after", "change", "limit")


def make_diff_page(
    document: Mapping[str, Any],
    distances: Mapping[str, tuple[np.ndarray, np.ndarray]],
    remarks: Mapping[str, Sequence[str]],
    stops: Mapping[str, str],
    machine: Mapping[str, Any],
) -> str:
    """Write the page of two runs against each other.

    Parameters
    ----------
    document : mapping
        As `velodrome diff --json` prints it.
    distances : mapping of str to (ndarray, ndarray)
        Times [s] and distances of the point D in the two rides [m], by engine.
    remarks : mapping of str to sequence of str
        What is to be told of an engine before its differences.
    stops : mapping of str to str
        How rides ended before their time, by engine.
    machine : mapping
        ``libraries`` and ``platform`` of the later run.

    Returns
    -------
    str
        A self-contained HTML document. All text is escaped.
    """
    names = list(document["engines"])
    before, after = (run["name"] for run in document["runs"])
    return render_page(
        "run_diff.html",
        document=document,
        made=machine,
        before=before,
        after=after,
        facts=_list_facts(document),
        engines=list_engine_styles(names),
        headline=words.keep_whole(_write_headline(document), names),
        table=_make_overview(document, stops),
        drawn=draw_over_time(distances, names, stops),
        parts=[
            {
                "name": name,
                "verdict": entry["verdict"],
                "lines": [*remarks.get(name, ()), *entry["reasons"]],
                "fields": _make_field_table(entry["fields"]),
                "metrics": _make_metric_table(entry["metrics"]),
            }
            for name, entry in document["engines"].items()
        ],
    )


def _list_facts(document: Mapping[str, Any]) -> list[tuple[str, str]]:
    runs = [
        f"{run['name']}, {words.describe_date(run['created'])}" + ("" if run["complete"] else ", interrupted")
        for run in document["runs"]
    ]
    return [
        ("Before", runs[0]),
        ("After", runs[1]),
        ("Scenario", document["scenario"]),
        ("Duration", f"{document['duration']:g} s"),
        ("Growth rate", f"{document['growth_rate']:.4g} 1/s"),
    ]


def _write_headline(document: Mapping[str, Any]) -> str:
    """Return which engines are the same and which moved, the furthest first."""
    if not document["engines"]:
        return "The runs have no engine in common."
    moved = {
        name: (entry["position_difference"] or {}).get("max")
        for name, entry in document["engines"].items()
        if entry["reasons"]
    }
    same = [name for name in document["engines"] if name not in moved]
    sentences = []
    if moved:
        ranked = sorted(moved, key=lambda name: -(moved[name] or 0.0))
        told = (name if moved[name] is None else f"{name} (by up to {moved[name]:.2g} m)" for name in ranked)
        sentences.append(f"Differs by more than round-off: {', '.join(told)}.")
    if same:
        sentences.append(f"The same within round-off: {', '.join(same)}.")
    return " ".join(sentences)


def _make_overview(document: Mapping[str, Any], stops: Mapping[str, str]) -> PageTable:
    entries = document["engines"]
    rows = {name: _pick_numbers(entry) for name, entry in entries.items()}
    numbers = (
        ("largest distance", "m", "max"),
        ("allowed at the end", "m", "end_limit"),
        ("differs from", "s", "begins_at"),
        ("beyond round-off from", "s", "exceeds_at"),
        ("error before", "m", "before"),
        ("error after", "m", "after"),
        ("CPU time, ratio", "", "ratio"),
    )
    return PageTable(
        caption="Distance of the point D in the two rides, what round-off and iterations allow at the end, and each "
        "run's error against its reference. A dash stands where there is no such value.",
        head="engine",
        names=list(entries),
        columns=[
            TableColumn("verdict", "", [entry["verdict"] for entry in entries.values()], words=True),
            *(number_column(title, unit, rows, key, 2, stops) for title, unit, key in numbers),
            TableColumn("ended", "", [f"✕ {stops[name]}" if name in stops else "–" for name in entries], words=True),
        ],
        down=frozenset(stops),
    )


def _pick_numbers(entry: Mapping[str, Any]) -> dict[str, Any]:
    """Return an engine's numbers for the overview; None where a run has none."""
    position, cpu_time = entry["position_difference"] or {}, entry["cpu_time"] or {}
    # The reference has no error, since errors are relative to it.
    error = entry["metrics"].get("position_error.max", {})
    return {
        **{key: position.get(key) for key in ("max", "end_limit", "begins_at", "exceeds_at")},
        **{key: error.get(key) for key in ("before", "after")},
        "ratio": cpu_time.get("ratio"),
    }


def _make_field_table(compared: Mapping[str, Mapping[str, Any]]) -> PageTable | None:
    both = {name: field for name, field in compared.items() if "only_in" not in field}
    if not both:
        return None
    return PageTable(
        caption="Of each stored field the column that is nearest to its limit, or furthest beyond.",
        head="field",
        names=list(both),
        columns=[
            TableColumn("column", "", [field["column"] for field in both.values()], words=True),
            TableColumn("unit", "", [field["unit"] for field in both.values()], words=True),
            *(
                # Fields have units of their own: no two numbers of a column need be of a size.
                TableColumn(title, unit, [text for field in both.values() for text in format_numbers([field[key]], 3)])
                for title, unit, key in _FIELD_COLUMNS
            ),
        ],
    )


def _make_metric_table(metrics: Mapping[str, Mapping[str, Any]]) -> PageTable | None:
    if not metrics:
        return None
    holds = {True: "holds", False: "moved", None: "not judged"}
    return PageTable(
        caption="Metrics of both runs; those with a limit are judged.",
        head="metric",
        names=list(metrics),
        columns=[
            *(
                TableColumn(key, "", [_format_value(metric[key]) for metric in metrics.values()])
                for key in _METRIC_COLUMNS
            ),
            TableColumn("verdict", "", [holds[metric["holds"]] for metric in metrics.values()], words=True),
        ],
    )


def _format_value(value: Any) -> str:
    if value is None or (isinstance(value, list) and not value):
        return "–"
    return f"{value:.4g}" if isinstance(value, float) else words.describe_setting(value)
