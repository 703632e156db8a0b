"""The JSON documents of `velodrome show`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from ...engines.engine import describe_engine
from ...engines.names import suggest_name
from ...engines.registry import package_of, preview_engine, uninstalled_engines
from ...engines.releases import find_reach
from ...reference.bicycle import Bicycle
from ..error import ScenarioError
from ..scenario import (
    PARAMETERS,
    configure_engine,
    installed_engines,
    join_complaints,
    library_names,
    list_engine_faults,
    load_scenario,
    resolve_scenario,
    show_value,
)
from .fields import list_fields, list_tables
from .schemas import scenario_schema, settings_schema

BICYCLE = "bicycle"
FILES = ("scenario", "sweep")


def kind_of(name: str) -> str:
    """Return what a name refers to: ``scenario``, ``sweep``, ``bicycle`` or ``engine``.

    Raises
    ------
    ScenarioError
        If the name refers to nothing.
    """
    if name in (BICYCLE, *FILES):
        return name
    if name in [*installed_engines(), *uninstalled_engines()]:
        return "engine"
    if name in library_names() or Path(name).suffix == ".toml":
        return "scenario"
    known = [*library_names(), *installed_engines(), BICYCLE, *FILES]
    raise ScenarioError(
        f"nothing is called {show_value(repr(name))} ({suggest_name(name, known)}); "
        "name a scenario, a path to a .toml file, an engine, bicycle, or the format of a file: scenario, sweep"
    )


def make_document(name: str, sweep: type[BaseModel]) -> dict[str, Any]:
    """Make the document of `velodrome show`.

    Parameters
    ----------
    name : str
        A scenario of the library, a path to a scenario file, an engine, ``bicycle``, or ``scenario`` or ``sweep`` for
        what such files may hold.
    sweep : type
        Model of sweep files.

    Returns
    -------
    dict
        ``kind`` and ``name``, and for a ``scenario``: its resolved tables, with all parameters of the bicycle and all
        settings of all installed engines, and ``units`` by dotted key. For an ``engine``: ``version``, ``install``
        (the command for its library where that is missing), ``package``, ``description``, ``gives``, ``releases`` of
        its library, ``settings`` by name (see `FieldFacts`). For the ``bicycle``: ``parameters``, ``units``,
        ``descriptions``. For a ``file``: ``tables`` (see `TableFacts`).

    Raises
    ------
    ScenarioError
        If the name refers to nothing, or the scenario or engine cannot be read or loaded.
    """
    kind = kind_of(name)
    if kind == "engine":
        return _describe_engine(name)
    if kind == BICYCLE:
        return _describe_bicycle()
    if name in FILES:
        schema = scenario_schema() if name == "scenario" else sweep.model_json_schema()
        return {"kind": "file", "name": name, "tables": [table.as_json() for table in list_tables(schema)]}
    return _describe_scenario(name)


def _describe_engine(name: str) -> dict[str, Any]:
    settings = settings_schema(name)
    engine = preview_engine(name)
    return {
        "kind": "engine",
        "name": name,
        "version": engine.version or None,
        "install": uninstalled_engines().get(name),
        "package": package_of(name),
        "description": describe_engine(engine),
        "gives": list(engine.gives),
        "takes_inputs": engine.takes_inputs,
        "releases": None if (reach := find_reach(engine)) is None else reach.as_json(name),
        "settings": {key: field.as_json() for key, field in list_fields(settings).items()},
    }


def _describe_bicycle() -> dict[str, Any]:
    return {
        "kind": "bicycle",
        "name": "benchmark",
        "description": "the benchmark bicycle of Meijaard et al. (2007); x forward, y to the left, z up",
        "parameters": asdict(Bicycle()),
        "units": {name: parameter.unit for name, parameter in PARAMETERS.items()},
        "descriptions": {name: parameter.meaning for name, parameter in PARAMETERS.items()},
    }


def _describe_scenario(source: str) -> dict[str, Any]:
    name, scenario = load_scenario(source)
    faults = list_engine_faults(scenario.engines)
    if faults:
        raise ScenarioError(f"{show_value(source)}: {join_complaints(faults)}")
    settings = {}
    for engine in installed_engines():
        try:
            settings[engine] = configure_engine(engine, scenario.engines.get(engine, {}))[1]
        except ScenarioError:
            continue  # the engine cannot be loaded; velodrome list gives the reason
    resolved = resolve_scenario(scenario, settings).model_dump(mode="json", exclude_none=True)
    return {"kind": "scenario", "name": name} | resolved | {"units": _find_units(resolved)}


def _find_units(resolved: Mapping[str, Any]) -> dict[str, str]:
    """Return the units of a resolved scenario's values by dotted key; dimensionless numbers and texts have none."""
    found = {}
    for table in list_tables(scenario_schema()):
        values: Any = resolved
        for key in table.name.split(".") if table.name else ():
            values = values.get(key, {})
        # If a table has several kinds, only the scenario's own kind counts.
        if table.kind is None or values.get("kind") == table.kind:
            for key, field in table.fields.items():
                if key in values and field.unit not in (None, "1"):
                    found[f"{table.name}.{key}"] = field.unit
    return found
