"""The histories of releases that the site shows, from ``docs/histories``; see `benchmarks.release_history`."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from velodrome.reports.page import describe_run, group_releases
from velodrome.reports.page.history import describe_unit, format_figures, format_limit, rank_moves
from velodrome.reports.page.judged_quantities import format_title

HISTORIES = Path(__file__).parents[1] / "histories"
MOST_QUANTITIES = 4  # of a turning point; the others are named
_INSIDE = {"same-bits": "same to the bit", "round-off": "same within round-off"}


def read_history(package: str) -> dict[str, Any]:
    """Return the stored history of a package."""
    return json.loads((HISTORIES / f"{package}.json").read_text(encoding="utf-8"))


def list_turning_points(package: str) -> dict[str, list[Mapping[str, Any]]]:
    """Return the turning points of a package by release, oldest first."""
    document = read_history(package)
    order = dict.fromkeys(row["release"] for row in document["releases"])
    points = {release: [each for each in document["turning_points"] if each["release"] == release] for release in order}
    return {release: found for release, found in points.items() if found}


def describe_history(package: str) -> str:
    """Markdown of the command, its date, and how the releases ride in every engine and scenario."""
    document = read_history(package)
    rows = document["releases"]
    dates = {row["release"]: row["date"] for row in rows}
    first, last = next(iter(dates)), next(reversed(dates))
    versions = ", ".join(f"{name} {document['libraries'][name]}" for name in ("velodrome", "numpy", "scipy", "numba"))
    lines = [
        f"```sh\n{document['command']}\n```\n",
        f"{len(dates)} releases from {first} ({dates[first]}) to {last} ({dates[last]}), ridden on "
        f"{document['ridden_on']} with {versions}.\n",
        "| scenario | engine | releases | how they ride | since the release before |",
        "| --- | --- | --- | --- | --- |",
    ]
    for scenario in document["scenarios"]:
        for engine in document["engines"]:
            own = [row for row in rows if (row["scenario"], row["engine"]) == (scenario, engine)]
            lines += [f"| `{scenario}` | `{engine}` | {_describe_group(group)} |" for group in group_releases(own)]
    return "\n".join(lines)


def _describe_group(group: Sequence[Mapping[str, Any]]) -> str:
    """Return three cells: the releases, what they have in common, and what the first of them changed."""
    first, last = group[0], group[-1]
    name = first["release"] if len(group) == 1 else f"{first['release']} to {last['release']} ({len(group)})"
    inside = {row["since_previous"] for row in group[1:]}
    if first["status"] != "rode":
        reason = first["reason"].partition(", this is ")[0].removeprefix(f"{first['engine']} ")
        how = f"{first['status']}: {reason}"
    elif not inside:
        how = "rode"
    else:
        how = f"rode, {_INSIDE['same-bits' if inside == {'same-bits'} else 'round-off']}"
    since, count = first["since_previous"], len(first["changed"])
    if since is None:
        step = "–"
    elif not count:
        step = _INSIDE[since]
    elif first["status"] != "rode":
        step = "does not ride any more"
    elif first["changed"] == ["run"]:
        step = (
            "the first that rides"
            if since == "changed"
            else f"rides again, {_INSIDE[since]} as {first['compared_with']}"
        )
    else:
        step = f"{since}: {count} {'quantities' if count > 1 else 'quantity'}"
    return f"{name} | {how} | {step}"


def describe_turning_point(package: str, release: str) -> str:
    """Markdown of what a release moved, in every engine and scenario."""
    points = [point for point in list_turning_points(package)[release] if set(_list_moved(point)) != {"run"}]
    starts = [point for point in list_turning_points(package)[release] if "run" in _list_moved(point)]
    lines = [
        f"- `{point['engine']}` on {point['scenario']}: "
        + describe_run(next(move["status"] for move in point["quantities"] if move["quantity"] == "run"))
        for point in starts
    ]
    for point in points:
        moves = [move for move in rank_moves(point["quantities"]) if move["quantity"] != "run"]
        lines += ["", f"`{point['engine']}` on {point['scenario']}: {point['verdict']}", ""]
        lines += [f"| quantity | {point['since']} | {release} | limit | |", "| --- | ---: | ---: | ---: | --- |"]
        for move in moves[:MOST_QUANTITIES]:
            unit = describe_unit(move["quantity"])
            title = format_title(move["quantity"]) + (f" [{unit}]" if unit else "")
            before, after = format_figures(move["before"], move["after"])
            lines.append(f"| {title} | {before} | {after} | {format_limit(move['limit'])} | {move['status']} |")
        others = ", ".join(format_title(move["quantity"]) for move in moves[MOST_QUANTITIES:])
        if others:
            lines += ["", f"And {others}."]
    return "\n".join(lines)


def _list_moved(point: Mapping[str, Any]) -> list[str]:
    return [move["quantity"] for move in point["quantities"]]
