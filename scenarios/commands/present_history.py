"""Terminal output of `velodrome history`, and the count of its rides."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from ...reports.page import describe_run, group_releases
from ..history import HistoryPlan, PlannedRide
from .progress import ProgressBars
from .tables import Column, print_table
from .terminal import print_words

_MOST_QUANTITIES = 4  # of a turning point, in the table; the document has all of them
_UNMOVED = {"same-bits": "same to the bit", "round-off": "same within round-off"}
_STYLES = {"worse": "red", "changed": "yellow", "better": "cyan"}


class HistoryCounter:
    """Counts a history's rides on a command's bars, and tells failures, each once.

    Parameters
    ----------
    progress : ProgressBars
    plan : HistoryPlan
    bisect : bool
        Whether only some of the rides are needed, so that their number is not known.
    """

    def __init__(self, progress: ProgressBars, plan: HistoryPlan, bisect: bool) -> None:
        self._progress, self._package = progress, plan.package
        self._rides, self._total = 0, None if bisect else len(plan.rides)
        self._told: set[str] = set()
        progress.say("installing releases")

    def watch(self, ride: PlannedRide, row: Mapping[str, Any], fresh: bool) -> None:
        """Count a row; a row of an earlier session is not told again."""
        self._rides += 1
        self._progress.watch(self._package, self._rides, self._total, "rides")
        line = f"{ride.release.label} {ride.engine}: {row['status']}: {row['reason']}"
        # The same reason on every scenario is told once.
        if fresh and row["reason"] is not None and line not in self._told:
            self._told.add(line)
            self._progress.note(line)


def show_history(console: Console, document: Mapping[str, Any]) -> None:
    """Print a table per scenario and engine, one line for each group of releases that ride alike, then what changed."""
    by_pair: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
    for row in document["releases"]:
        by_pair.setdefault((row["scenario"], row["engine"]), []).append(row)
    slow = {(move["scenario"], move["engine"], move["release"]) for move in document["gradual_moves"]}
    for (scenario, engine), rows in by_pair.items():
        console.print()
        print_words(console, f"{scenario}: {engine}", "bold")
        found = group_releases(rows)
        columns = [
            Column("releases", [_name_releases(group) for group in found], right=False),
            Column("number", [str(len(group)) for group in found]),
            Column("among them", [_describe_inside(group, slow) for group in found], right=False),
            Column("since the release before", [_describe_step(group[0]) for group in found], right=False),
        ]
        print_table(console, columns)
    console.print()
    builds = {row["release"]: [row["wheel"], *row["companions"]] for row in document["releases"] if row["wheel"]}
    for release, wheels in builds.items():
        print_words(console, f"{release}: {', '.join(wheels)}", "dim")
    _show_turning_points(console, document)
    for line in document["remarks"]:
        print_words(console, line, "yellow")


def _name_releases(group: Sequence[Mapping[str, Any]]) -> str:
    first, last = group[0]["release"], group[-1]["release"]
    return first if len(group) == 1 else f"{first} to {last}"


def _describe_inside(group: Sequence[Mapping[str, Any]], slow: Collection[tuple[str, str, str]]) -> str:
    """Return what releases have in common; ``slow`` are those until which something moved gradually."""
    if group[0]["status"] != "rode":
        return group[0]["status"]
    inside = {row["since_previous"] for row in group[1:]}
    if not inside:
        return "rode"
    if any((row["scenario"], row["engine"], row["release"]) in slow for row in group[1:]):
        return "moved gradually, each step round-off"
    return "same to the bit" if inside == {"same-bits"} else "same within round-off"


def _describe_step(row: Mapping[str, Any]) -> str:
    since, moved = row["since_previous"], [name for name in row["changed"] if name != "run"]
    if since is None:
        return "–"
    if row["status"] != "rode":
        return "does not ride any more"
    rides = ""
    if len(moved) < len(row["changed"]):
        if since == "changed" and not moved:
            return "rides, and none before did"
        rides = f"rides again; against {row['compared_with']} "
    if not moved:
        return rides + _UNMOVED[since]
    return rides + (f"{since}: {len(moved)} quantities" if len(moved) > 1 else f"{since}: {moved[0]}")


def _show_turning_points(console: Console, document: Mapping[str, Any]) -> None:
    points, gradual = document["turning_points"], document["gradual_moves"]
    if points:
        console.print("turning points", style="bold")
    for point in points:
        verdict = _UNMOVED.get(point["verdict"], point["verdict"])
        line = f"{point['release']}, since {point['since']}: {point['scenario']}: {point['engine']}: {verdict}"
        _show_moves(console, line, point)
    if gradual:
        console.print("moved gradually, in no single release beyond a limit", style="bold")
    for move in gradual:
        line = f"between {move['since']} and {move['release']}: {move['scenario']}: {move['engine']}: {move['verdict']}"
        _show_moves(console, line, move)
    if not points and not gradual:
        compared = any(row["since_previous"] is not None for row in document["releases"])
        if compared:
            console.print("no release moved a quantity beyond its limit", style="bold green")
        else:
            console.print("nothing to compare: of no engine and scenario two releases rode", style="yellow")


def _show_moves(console: Console, line: str, point: Mapping[str, Any]) -> None:
    """Print a line, and below it what moved most."""
    print_words(console, line, _STYLES.get(point["verdict"], ""))
    moved = sorted(point["quantities"], key=_rank_move)
    for move in moved[:_MOST_QUANTITIES]:
        print_words(console, f"  {_describe_move(move)}")
    if len(moved) > _MOST_QUANTITIES:
        more = ", ".join(move["quantity"] for move in moved[_MOST_QUANTITIES:])
        print_words(console, f"  and {more}")


def _rank_move(move: Mapping[str, Any]) -> float:
    """Return a number by which the observed order comes first, and then what moved most against its limit."""
    if move["quantity"] in ("observed_order", "run"):
        return -float("inf")
    if move["before"] is None or move["after"] is None or not move["limit"]:
        return 0.0
    return -abs(move["after"] - move["before"]) / move["limit"]


def _describe_move(move: Mapping[str, Any]) -> str:
    if move["quantity"] == "run":
        return describe_run(move["status"])
    before, after = ("none" if move[part] is None else f"{move[part]:.6g}" for part in ("before", "after"))
    limit = "" if move["limit"] is None else f", limit {move['limit']:.2g}"
    return f"{move['quantity']}: {move['status']}: {before} -> {after}{limit}"


def resume_history_command(out: Path) -> str:
    """Return the command that continues an interrupted history, for the shell."""
    arguments = [argument for argument in sys.argv[1:] if argument != "--resume"]
    where = [] if any(argument.startswith("--out") for argument in arguments) else ["--out", str(out)]
    return shlex.join(["velodrome", *arguments, *where, "--resume"])
