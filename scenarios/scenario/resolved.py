"""Resolved scenarios, which state all parameters and settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from ...engines.engine import Settings
from .schema import Scenario


def resolve_scenario(scenario: Scenario, settings: Mapping[str, Settings]) -> Scenario:
    """Return a scenario that states all parameters of its bicycle and all settings of some engines.

    Written to a file and read back, the result gives the same problem and the same settings to the bit.

    Parameters
    ----------
    scenario : Scenario
    settings : mapping
        Settings by engine. The scenario's tables of other engines are not changed.
    """
    engines = dict(scenario.engines)
    for name, chosen in settings.items():
        values = chosen.model_dump(mode="json", exclude_none=True)
        if not _has_none(values):
            engines[name] = values
    return scenario.model_copy(update={"bicycle": asdict(scenario.make_bicycle()), "engines": engines})


def _has_none(value: Any) -> bool:
    """Return whether a value contains None, which TOML cannot express."""
    if isinstance(value, Mapping):
        return any(_has_none(item) for item in value.values())
    if isinstance(value, list):
        return any(_has_none(item) for item in value)
    return value is None
