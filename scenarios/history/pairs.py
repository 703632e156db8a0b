"""The documents of pairs of rides: what the two releases of a turning point ride, side by side."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping
from pathlib import PurePosixPath
from typing import Any

import numpy as np

from ..run import library_versions
from .plan import HistoryPlan, PlannedRide
from .problems import MeasuredRide
from .releases import Release
from .verdicts import RUN

PAIR_FOLDER = "rides"  # of the documents and pages, beside the document of the history

Row = Mapping[str, Any]


def make_pair_documents(
    plan: HistoryPlan, rows: Mapping[PlannedRide, Row], document: Mapping[str, Any]
) -> dict[str, dict[str, Any]]:
    """Return the documents of the turning points at which quantities moved.

    Parameters
    ----------
    plan : HistoryPlan
    rows : mapping
        By ride.
    document : mapping
        Of the history, by `velodrome.scenarios.history.document.make_history_document`.

    Returns
    -------
    dict
        By name of the file, without its suffix, as the turning points have it in ``page``.
    """
    rides = {(ride.release.label, ride.engine, ride.scenario): ride for ride in rows}
    found = {}
    for point in document["turning_points"]:
        if point["page"] is not None:
            before, after = (rides[point[key], point["engine"], point["scenario"]] for key in ("since", "release"))
            found[PurePosixPath(point["page"]).stem] = _describe_pair(
                plan, (before, after), (rows[before], rows[after]), point
            )
    return found


def _describe_pair(
    plan: HistoryPlan, rides: tuple[PlannedRide, PlannedRide], rows: tuple[Row, Row], point: Mapping[str, Any]
) -> dict[str, Any]:
    before, after = (
        {
            "release": ride.release.label,
            "date": plan.find_date(ride.release),
            "bits": row["bits"],
            "settings": row["settings"],
            "quantities": row["quantities"],
            "time": row["samples"]["time"],
            "position": [sample[:3] for sample in row["samples"]["q"]],
        }
        for ride, row in zip(rides, rows, strict=True)
    )
    first, second = rides[0].release, rides[1].release
    ride = plan.scenarios[rides[1].scenario]
    return {
        "package": plan.package,
        "engine": rides[1].engine,
        "scenario": rides[1].scenario,
        "title": ride.title,
        "verdict": point["verdict"],
        "moved": [move for move in point["quantities"] if move["quantity"] != RUN],
        "limits": rows[0]["limits"] | rows[1]["limits"],
        "before": before,
        "after": after,
        "distance": measure_separation(before, after),
        "libraries": list_suite_versions(plan.package),
        "command": write_pair_command(first, second, rides[1].engine, ride.source),
        "commands": write_run_commands(first, second, rides[1].engine, ride),
    }


def list_suite_versions(package: str) -> dict[str, str]:
    """Return the versions of the suite's environment, without the package whose releases ride."""
    return {name: version for name, version in library_versions().items() if name != package}


def measure_separation(before: Row, after: Row) -> dict[str, list[float]]:
    """Return the distance of the points D of two rides at the samples that both have.

    Parameters
    ----------
    before, after : mapping
        With ``time`` and ``position``.

    Returns
    -------
    dict
        ``time`` [s] and ``distance`` [m], of equal length.
    """
    time, first, second = np.intersect1d(before["time"], after["time"], return_indices=True)
    if not time.size:
        return {"time": [], "distance": []}
    apart = np.array(after["position"])[second] - np.array(before["position"])[first]
    return {"time": time.tolist(), "distance": np.linalg.norm(apart, axis=1).tolist()}


def write_pair_command(before: Release, after: Release, engine: str, source: str) -> str:
    """Return the command that rides two releases again, for the shell; files are named as the user did."""
    versions = [release.version for release in (before, after) if release.wheel is None]
    wheels = dict.fromkeys(str(file.path) for release in (before, after) for file in release.files)
    wanted = before.package + ("==" + ",".join(versions) if versions else "")
    named = [part for wheel in wheels for part in ("--wheel", wheel)]
    return shlex.join(["velodrome", "history", wanted, source, "--engine", engine, *named, "--out", "two-releases"])


def write_run_commands(before: Release, after: Release, engine: str, ride: MeasuredRide) -> list[str]:
    """Return the commands that run two releases, compare the runs, and show both in one recording, for the shell.

    The runs are the rides of the history, to the bit where its releases are those of the cache.
    """
    folder = "two-rides"
    runs = [
        _write_run_command(release, engine, ride, f"{folder}/{name}")
        for release, name in ((before, "before"), (after, "after"))
    ]
    # The names of run folders have the time.
    both = f"{folder}/before/* {folder}/after/*"
    return [*runs, f"velodrome diff {both}", f"velodrome view {both}"]


def _write_run_command(release: Release, engine: str, ride: MeasuredRide, out: str) -> str:
    wanted = release.package + ("" if release.files else f"=={release.version}")
    named = [part for file in release.files for part in ("--wheel", str(file.path))]
    simulation = {"simulation.output_rate": ride.gate.output_rate}
    changes = simulation | _list_leaves(ride.settings_of(engine), f"engines.{engine}")
    # Numbers, texts and lists are written in TOML as in JSON.
    settings = [part for key, value in changes.items() for part in ("--set", f"{key}={json.dumps(value)}")]
    what = ["velodrome", "run", ride.source, "--engine", engine, "--release", wanted, *named]
    return shlex.join([*what, "--duration", repr(ride.gate.duration), *settings, "--out", out])


def _list_leaves(values: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Return values that are no tables by their dotted keys."""
    found: dict[str, Any] = {}
    for key, value in values.items():
        found |= _list_leaves(value, f"{where}.{key}") if isinstance(value, Mapping) else {f"{where}.{key}": value}
    return found
