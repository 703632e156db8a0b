"""Remarks on what of a build's release is not of the build."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .plan import PlannedRide
from .releases import Release


def describe_registry_companions(release: Release, packages: Mapping[str, Mapping[str, str | None]]) -> str | None:
    """Return a line about those packages of a build's environment that pip took from the registry; None without any.

    A build's engine may lie in a companion of the wheel, and its changes would then not have ridden at all.

    Parameters
    ----------
    release : Release
    packages : mapping
        As in `velodrome.scenarios.history.environments.ReleaseEnvironment`.
    """
    taken = [f"{name} {package['version']}" for name, package in packages.items() if package["wheel"] is None]
    if not release.files or not taken:
        return None
    return (
        f"{release.label}: not of the given wheels but of the registry: {', '.join(taken)}; if it is of the build too, "
        "give its wheel by a further --wheel"
    )


def list_registry_companions(rows: Mapping[PlannedRide, Mapping[str, Any]]) -> list[str]:
    """Return such a line for every build among the rows of a history.

    Parameters
    ----------
    rows : mapping
        By ride.
    """
    told = [describe_registry_companions(ride.release, row.get("packages", {})) for ride, row in rows.items()]
    return list(dict.fromkeys(line for line in told if line is not None))
