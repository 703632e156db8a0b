"""The JSON document of a history: rows, the verdicts between releases, the turning points, and what moved slowly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from .companions import list_registry_companions
from .pairs import PAIR_FOLDER, list_suite_versions
from .plan import HistoryPlan, PlannedRide
from .ride import RODE
from .sequence import judge_sequence
from .verdicts import MOVED, RUN, QuantityMove, StepVerdict, sum_up_moves


def make_history_document(
    plan: HistoryPlan, rows: Mapping[PlannedRide, Mapping[str, Any]], *, complete: bool, bisected: bool
) -> dict[str, Any]:
    """Return the document of the rows that there are.

    Releases are judged by `velodrome.scenarios.history.sequence.judge_sequence`.

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

    described: dict[PlannedRide, dict[str, Any]] = {}
    turning_points: dict[PlannedRide, dict[str, Any]] = {}
    gradual_moves: dict[PlannedRide, list[dict[str, Any]]] = {}
    by_pair: dict[tuple[str, str], list[PlannedRide]] = {}
    for ride in plan.rides:
        if ride in rows:
            by_pair.setdefault((ride.engine, ride.scenario), []).append(ride)
    for rides in by_pair.values():
        for ride, found in zip(rides, judge_sequence([rows[ride] for ride in rides]), strict=True):
            date = plan.find_date(ride.release)
            since = None if found.compared_with is None else rides[found.compared_with].release.label
            verdict = found.verdict
            described[ride] = _describe_row(ride, rows[ride], date, verdict, since)
            if since is not None and verdict is not None and verdict.moved:
                status, moves = verdict.status, verdict.moves
                turning_points[ride] = _describe_moves(ride, date, since, status, moves) | {"page": None}
            gradual_moves[ride] = [
                _describe_moves(ride, date, rides[one.since].release.label, sum_up_moves(one.moves), one.moves)
                for one in found.gradual
            ]
    names = AnchorNames()
    for ride in plan.rides:
        point = turning_points.get(ride)
        # Both rode where more is said than that one of them did.
        if point is not None and point["verdict"] in MOVED and any(m["quantity"] != RUN for m in point["quantities"]):
            name = names.choose(ride.engine, ride.scenario, point["since"], ride.release.label)
            point["page"] = f"{PAIR_FOLDER}/{name}.html"
    return {
        "package": plan.package,
        "scenarios": {name: ride.title for name, ride in plan.scenarios.items()},
        "engines": list(plan.engines),
        "complete": complete,
        "bisected": bisected,
        "remarks": [
            *plan.remarks,
            *list_registry_companions(rows),
            *(_list_unsearched(plan, rows, by_pair) if bisected else []),
        ],
        "releases": [described[ride] for ride in plan.rides if ride in described],
        "turning_points": [turning_points[ride] for ride in plan.rides if ride in turning_points],
        "gradual_moves": [move for ride in plan.rides for move in gradual_moves.get(ride, [])],
        "libraries": list_suite_versions(plan.package),
    }


def _list_unsearched(
    plan: HistoryPlan,
    rows: Mapping[PlannedRide, Mapping[str, Any]],
    by_pair: Mapping[tuple[str, str], Sequence[PlannedRide]],
) -> list[str]:
    """Return a line for every engine and scenario of which a bisection found no release that rides, and left some."""
    return [
        f"{engine} on {scenario}: neither the first nor the last release rides, so that --bisect rode none between "
        "them; without it all are ridden"
        for (engine, scenario), rides in by_pair.items()
        if len(rides) < len(plan.releases) and not any(rows[ride]["status"] == RODE for ride in rides)
    ]


def _describe_moves(
    ride: PlannedRide, date: str | None, since: str, verdict: str, moves: Sequence[QuantityMove]
) -> dict[str, Any]:
    return {
        "version": ride.release.version,
        "release": ride.release.label,
        "date": date,
        "since": since,
        "engine": ride.engine,
        "scenario": ride.scenario,
        "verdict": verdict,
        "quantities": [move.as_json() for move in moves],
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
