"""The page of a sweep, as one self-contained HTML document without a script."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from . import words
from .document import list_engine_styles, render_page
from .tables import PageTable, TableColumn, number_column
from .timelines import draw_over_values


def make_sweep_page(
    document: Mapping[str, Any],
    errors: Mapping[str, Mapping[str, tuple[np.ndarray, np.ndarray]]],
    libraries: Mapping[str, str],
) -> str:
    """Write the page of a complete sweep.

    Parameters
    ----------
    document : mapping
        As `velodrome sweep --json` prints it.
    errors : mapping
        By parameter and engine: values of the parameter, and the median of the position errors of the rides that
        reached their end there [m].
    libraries : mapping of str to str
        Versions by name.

    Returns
    -------
    str
        A self-contained HTML document. All text is escaped.
    """
    names = list(document["engines"])
    drawn = {parameter: draw_over_values(series, names) for parameter, series in errors.items()}
    return render_page(
        "sweep.html",
        document=document,
        made={"libraries": libraries, "platform": {}},
        facts=[
            ("Sweep", document["sweep"]),
            ("Runs", str(document["tasks"])),
            ("Parameters", ", ".join(errors) or "none of numbers"),
        ],
        engines=list_engine_styles(names),
        headline=words.keep_whole(_write_headline(document), names),
        table=_make_table(document),
        figures={parameter: figure for parameter, figure in drawn.items() if figure is not None},
        reasons=[f"{name}: {line}" for name, entry in document["engines"].items() for line in entry["reasons"]],
    )


def _write_headline(document: Mapping[str, Any]) -> str:
    """Return which engine has the largest and the least median error, and what did not reach the end."""
    engines = document["engines"]
    medians = {name: entry["position_error"]["median"] for name, entry in engines.items() if entry["position_error"]}
    sentences = []
    if medians:
        worst, best = max(medians, key=lambda name: medians[name]), min(medians, key=lambda name: medians[name])
        sentences.append(f"{worst} drifts most: {medians[worst]:.2g} m from the reference in half of its rides.")
        if medians[best] < medians[worst]:
            sentences.append(f"{best} stays closest: {medians[best]:.2g} m.")
    for name, entry in engines.items():
        others = {status: count for status, count in entry["rows"].items() if status != "done" and count}
        if others:
            told = ", ".join(f"{count} {status}" for status, count in others.items())
            sentences.append(f"{name}: {told} of {sum(entry['rows'].values())}.")
    return " ".join(sentences)


def _make_table(document: Mapping[str, Any]) -> PageTable:
    entries = document["engines"]
    statuses = list(dict.fromkeys(status for entry in entries.values() for status in entry["rows"]))
    none = {"median": None, "worst": None}
    errors = {name: entry["position_error"] or none for name, entry in entries.items()}
    return PageTable(
        caption="Rides of each engine by how they ended, and the position errors of all that were measured, each over "
        "its ride or up to its fall.",
        head="engine",
        names=list(entries),
        columns=[
            *(
                TableColumn(status, "", [str(entry["rows"].get(status, 0)) for entry in entries.values()])
                for status in statuses
            ),
            number_column("median error", "m", errors, "median"),
            number_column("worst error", "m", errors, "worst"),
            number_column("rides of a worker", "1/s", entries, "rows_per_second"),
        ],
    )
