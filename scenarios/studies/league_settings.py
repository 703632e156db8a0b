"""The file of settings with which a league replaces the engines' defaults."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..error import ScenarioError
from ..scenario import join_complaints, list_engine_faults, read_scenario_file, read_toml, show_value

_SOURCE = "source"  # key of a table that is no setting: whose choice the settings are


@dataclass(frozen=True)
class LeagueSettings:
    """Settings of engines that replace their defaults in a league.

    Attributes
    ----------
    file : str
        Name of the file.
    engines : dict
        Settings by engine.
    sources : dict
        Text by engine that says whose choice they are; engines without one are left out.
    """

    file: str
    engines: dict[str, dict[str, Any]]
    sources: dict[str, str]

    def describe_source(self, engine: str) -> str:
        """Return whose choice an engine's settings are, in one line."""
        source = self.sources.get(engine)
        return f"{self.file}: {source}" if source else f"{self.file}, which names no source"


def read_league_settings(path: Path) -> LeagueSettings:
    """Read a file of settings: tables ``[engines.NAME]`` with the engine's settings and an optional ``source``.

    Raises
    ------
    ScenarioError
        If the file cannot be read, has other tables, or settings are unknown or out of range. The message lists all
        faults in one line.
    """
    where = f"--settings {show_value(str(path))}"
    try:
        _, text = read_scenario_file(str(path))
    except ScenarioError as error:
        raise ScenarioError(f"--settings {error}") from error
    try:
        data = read_toml(text)
    except (tomllib.TOMLDecodeError, ValueError) as error:
        raise ScenarioError(f"{where}: not valid TOML: {show_value(str(error))}") from error
    faults = [f"{show_value(key)} is unknown; tables are [engines.NAME]" for key in data if key != "engines"]
    tables = data.get("engines", {})
    if not isinstance(tables, Mapping) or not tables:
        faults.append("it has no table [engines.NAME]")
        tables = {}
    engines, sources = {}, {}
    for name, table in tables.items():
        if not isinstance(table, Mapping):
            faults.append(f"engines.{show_value(name)} must be a table of settings")
            continue
        engines[name] = {key: value for key, value in table.items() if key != _SOURCE}
        if _SOURCE in table:
            source = table[_SOURCE]
            if isinstance(source, str) and source.strip() and source.isprintable():
                sources[name] = source
            else:
                faults.append(f"engines.{name}.{_SOURCE} must be one line of text")
    faults += list_engine_faults(engines)
    if faults:
        raise ScenarioError(f"{where}: {join_complaints(faults)}")
    return LeagueSettings(path.name, engines, sources)
