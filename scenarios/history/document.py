"""The JSON document of a history: rows, the verdicts between neighbouring releases, and the turning points."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .companions import list_registry_companions
from .pairs import PAIR_FOLDER, list_suite_versions
from .plan import HistoryPlan, PlannedRide
from .ride import NOT_INSTALLABLE, RODE
from .verdicts import StepVerdict, judge_step


def make_history_document(
    plan: HistoryPlan, rows: Mapping[PlannedRide, Mapping[str, Any]], *, complete: bool, bisected: bool
) -> dict[str, Any]:
    """Return the document of the rows that there are.

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
            both = rows[earlier]["status"] == row["status"] == RODE
            name = names.choose(ride.engine, ride.scenario, earlier.release.label, ride.release.label) if both else None
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
                    "page": None if name is None else f"{PAIR_FOLDER}/{name}.html",
                }
            )
        if row["status"] != NOT_INSTALLABLE:
            last[pair] = ride
    return {
        "package": plan.package,
        "scenarios": {name: ride.title for name, ride in plan.scenarios.items()},
        "engines": list(plan.engines),
        "complete": complete,
        "bisected": bisected,
        "remarks": [*plan.remarks, *list_registry_companions(rows)],
        "releases": entries,
        "turning_points": turning_points,
        "libraries": list_suite_versions(plan.package),
    }


def _describe_row(
    ride: PlannedRide, row: Mapping[str, Any], date: str | None, verdict: StepVerdict | None, since: str | None
) -> dict[str, Any]:
    return {
        "version": ride.release.version,
        "release": ride.release.label,
        "date": date,
        "wheel": None if ride.release.wheel is None else str(ride.release.wheel),
        "companions": [str(file.path) for file in ride.release.files[1:]],
        "engine": ride.engine,
        "scenario": ride.scenario,
        "status": row["status"],
        "reason": row["reason"],
        "packages": row.get("packages", {}),
        "installed": row.get("installed"),
        "bits": row.get("bits"),
        "quantities": row.get("quantities", {}) if row["status"] == RODE else {},
        "limits": row.get("limits", {}) if row["status"] == RODE else {},
        "compared_with": since,
        "since_previous": None if verdict is None else verdict.status,
        "changed": [] if verdict is None else [move.quantity for move in verdict.moves],
    }
