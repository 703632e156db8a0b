"""The JSON document of a history: rows, the verdicts between neighbouring releases, and the turning points."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

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
    entries: list[dict[str, Any]] = []
    turning_points: list[dict[str, Any]] = []
    last: dict[tuple[str, str], PlannedRide] = {}
    for ride in plan.rides:
        row = rows.get(ride)
        if row is None:
            continue
        pair = (ride.engine, ride.scenario)
        earlier = last.get(pair)
        verdict = None if earlier is None else judge_step(rows[earlier], row)
        since = None if earlier is None else earlier.release.label
        entries.append(_describe_row(ride, row, verdict, since))
        if verdict is not None and verdict.moved:
            turning_points.append(
                {
                    "version": ride.release.version,
                    "release": ride.release.label,
                    "since": since,
                    "engine": ride.engine,
                    "scenario": ride.scenario,
                    "verdict": verdict.status,
                    "quantities": [move.as_json() for move in verdict.moves],
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
        "remarks": list(plan.remarks),
        "releases": entries,
        "turning_points": turning_points,
    }


def _describe_row(
    ride: PlannedRide, row: Mapping[str, Any], verdict: StepVerdict | None, since: str | None
) -> dict[str, Any]:
    return {
        "version": ride.release.version,
        "release": ride.release.label,
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
