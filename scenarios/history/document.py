"""The JSON documents of a history: rows, verdicts between neighbouring releases, turning points and their rides."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from .pairs import list_suite_versions, make_pair_document
from .plan import HistoryPlan, PlannedRide
from .ride import NOT_INSTALLABLE, RODE
from .verdicts import StepVerdict, judge_step

PAIRS_FOLDER = "rides"  # of the pages of turning points, beside the document


@dataclass(frozen=True)
class HistoryDocuments:
    """The document of a history, and those of the rides of its turning points.

    Attributes
    ----------
    history : dict
    pairs : dict
        By name of the file, without its suffix, which the turning point has as ``page``.
    """

    history: dict[str, Any]
    pairs: dict[str, dict[str, Any]]


def make_history_documents(
    plan: HistoryPlan, rows: Mapping[PlannedRide, Mapping[str, Any]], *, complete: bool, bisected: bool
) -> HistoryDocuments:
    """Return the documents of the rows that there are.

    A row is judged against the release before it that could be installed.

    Parameters
    ----------
    plan : HistoryPlan
    rows : mapping
        By ride.
    complete : bool
        Whether all rows are there that were to be ridden.
    bisected : bool
        Whether only some of the releases were ridden.
    """
    from ...reports.page import AnchorNames  # here, so that the processes that ride do not load the pages

    entries: list[dict[str, Any]] = []
    turning_points: list[dict[str, Any]] = []
    pairs: dict[str, dict[str, Any]] = {}
    names = AnchorNames()
    last: dict[tuple[str, str], PlannedRide] = {}
    for ride in plan.rides:
        row = rows.get(ride)
        if row is None:
            continue
        pair = (ride.engine, ride.scenario)
        earlier = last.get(pair)
        verdict = None if earlier is None else judge_step(rows[earlier], row)
        since = None if earlier is None else earlier.release.label
        date = plan.find_date(ride.release)
        entries.append(_describe_row(ride, row, date, verdict, since))
        if earlier is not None and verdict is not None and verdict.moved:
            found = make_pair_document(plan, (earlier, ride), (rows[earlier], row), verdict)
            name = None
            if found is not None:
                name = names.choose(ride.engine, ride.scenario, earlier.release.label, ride.release.label)
                pairs[name] = found
            turning_points.append(
                {
                    "version": ride.release.version,
                    "release": ride.release.label,
                    "date": date,
                    "since": since,
                    "engine": ride.engine,
                    "scenario": ride.scenario,
                    "verdict": verdict.status,
                    "quantities": [move.as_json() for move in verdict.moves],
                    "page": None if name is None else f"{PAIRS_FOLDER}/{name}.html",
                }
            )
        if row["status"] != NOT_INSTALLABLE:
            last[pair] = ride
    document = {
        "package": plan.package,
        "scenarios": {name: ride.title for name, ride in plan.scenarios.items()},
        "engines": list(plan.engines),
        "complete": complete,
        "bisected": bisected,
        "remarks": list(plan.remarks),
        "releases": entries,
        "turning_points": turning_points,
        "libraries": list_suite_versions(plan.package),
    }
    return HistoryDocuments(document, pairs)


def _describe_row(
    ride: PlannedRide, row: Mapping[str, Any], date: str | None, verdict: StepVerdict | None, since: str | None
) -> dict[str, Any]:
    return {
        "version": ride.release.version,
        "release": ride.release.label,
        "date": date,
        "wheel": None if ride.release.wheel is None else str(ride.release.wheel),
        "engine": ride.engine,
        "scenario": ride.scenario,
        "status": row["status"],
        "reason": row["reason"],
        "bits": row.get("bits"),
        "quantities": row.get("quantities", {}) if row["status"] == RODE else {},
        "limits": row.get("limits", {}) if row["status"] == RODE else {},
        "compared_with": since,
        "since_previous": None if verdict is None else verdict.status,
        "changed": [] if verdict is None else [move.quantity for move in verdict.moves],
    }
