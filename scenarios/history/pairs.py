"""The documents of pairs of rides: what the two releases of a turning point ride, side by side."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..run import library_versions
from .plan import HistoryPlan, PlannedRide
from .releases import Release
from .ride import RODE
from .verdicts import StepVerdict

Row = Mapping[str, Any]


def make_pair_document(
    plan: HistoryPlan, rides: tuple[PlannedRide, PlannedRide], rows: tuple[Row, Row], verdict: StepVerdict
) -> dict[str, Any] | None:
    """Return the document of a pair of rides, None unless both releases ride.

    Parameters
    ----------
    plan : HistoryPlan
    rides, rows : tuple
        Of the release before, and of the one that moved something.
    verdict : StepVerdict
        On the step between them.
    """
    if any(row["status"] != RODE for row in rows):
        return None
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
    return {
        "package": plan.package,
        "engine": rides[1].engine,
        "scenario": rides[1].scenario,
        "title": plan.scenarios[rides[1].scenario].title,
        "verdict": verdict.status,
        "moved": [move.as_json() for move in verdict.moves],
        "limits": rows[0]["limits"] | rows[1]["limits"],
        "before": before,
        "after": after,
        "distance": measure_separation(before, after),
        "libraries": list_suite_versions(plan.package),
        "command": write_pair_command(first, second, rides[1].engine, rides[1].scenario),
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


def write_pair_command(before: Release, after: Release, engine: str, scenario: str) -> str:
    """Return the command that rides two releases again, for the shell; wheels are named as the user did."""
    versions = [release.version for release in (before, after) if release.wheel is None]
    wheels = [str(release.wheel) for release in (before, after) if release.wheel is not None]
    wanted = before.package + ("==" + ",".join(versions) if versions else "")
    named = [part for wheel in wheels for part in ("--wheel", wheel)]
    return shlex.join(["velodrome", "history", wanted, scenario, "--engine", engine, *named, "--out", "two-releases"])
