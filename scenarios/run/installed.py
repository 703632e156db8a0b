"""Installed engines: their names, or one line that says why they have none."""

from __future__ import annotations

from ...engines.engine import engine_names
from ..error import ScenarioError


def installed_engines() -> list[str]:
    """Names of all installed engines, the reference first.

    Raises
    ------
    ScenarioError
        If two packages announce an engine of one name.
    """
    try:
        return engine_names()
    except ValueError as error:
        raise ScenarioError(str(error)) from error
