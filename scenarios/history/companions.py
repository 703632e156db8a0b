"""Remarks on what of a build's release is not of the build."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .plan import PlannedRide


def name_registry_companions(rows: Mapping[PlannedRide, Mapping[str, Any]]) -> list[str]:
    """Return a line for every release of wheels with packages that pip took from the registry.

    A build's engine may lie in a companion of the wheel, and its changes would then not have ridden at all.

    Parameters
    ----------
    rows : mapping
        By ride.
    """
    found: dict[str, None] = {}
    for ride, row in rows.items():
        taken = [
            f"{name} {package['version']}"
            for name, package in row.get("packages", {}).items()
            if ride.release.files and package["wheel"] is None
        ]
        if taken:
            found[
                f"{ride.release.label}: not of the given wheels but of the registry: {', '.join(taken)}; if it is of "
                "the build too, give its wheel by a further --wheel"
            ] = None
    return list(found)
