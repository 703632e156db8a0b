"""JSON schemas for editors: scenario files, sweep files, settings of engines, and the table of a bicycle."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel

from ...engines.engine import why_failed
from ...engines.guard import call_engine
from ...engines.registry import preview_engine, uninstalled_engines
from ..error import ScenarioError
from ..scenario import Scenario, installed_engines

DIALECT = "https://json-schema.org/draft/2020-12/schema"


def make_schema(kind: str, name: str, sweep: type[BaseModel]) -> dict[str, Any]:
    """Make a JSON schema.

    Parameters
    ----------
    kind : str
        ``scenario``, ``sweep``, ``bicycle`` or ``engine``.
    name : str
        Name of the engine; ignored for other kinds.
    sweep : type
        Model of sweep files, passed in because this subpackage does not import `velodrome.scenarios.sweep`.

    Returns
    -------
    dict
        A schema in the dialect 2020-12.

    Raises
    ------
    ScenarioError
        If the engine cannot be loaded.
    """
    if kind == "engine":
        return _add_heading(settings_schema(name), f"Settings of {name}: the table [engines.{name}] of a scenario file")
    if kind == "sweep":
        return _add_heading(sweep.model_json_schema(), "A sweep file")
    scenario = scenario_schema()
    if kind == "bicycle":
        return _add_heading(scenario["properties"]["bicycle"], "The table [bicycle] of a scenario file")
    return _add_heading(scenario, "A scenario file")


def scenario_schema() -> dict[str, Any]:
    """Return the JSON schema of scenario files, with the settings of all announced engines that can be loaded."""
    schema = Scenario.model_json_schema()
    engines = {}
    for name in [*installed_engines(), *uninstalled_engines()]:
        try:
            engines[name] = _nest_schema(name, settings_schema(name), schema.setdefault("$defs", {}))
        except ScenarioError:
            continue  # the schema is still useful for the other engines
    # Scenarios with tables of engines that are not announced are refused, so the schema refuses them too.
    schema["properties"]["engines"] |= {"properties": engines, "additionalProperties": False}
    return schema


def settings_schema(name: str) -> dict[str, Any]:
    """Return the JSON schema of an engine's settings.

    Raises
    ------
    ScenarioError
        If the engine cannot be loaded, or its settings have no JSON schema.
    """
    try:
        engine = preview_engine(name)
    except ValueError as error:
        raise ScenarioError(" ".join(str(error).split())) from error
    try:
        return call_engine(engine.settings.model_json_schema)
    except Exception as error:  # settings may have code of their own
        raise ScenarioError(f"engine {name!r}: its settings have no JSON schema: {why_failed(error)}") from error


def _nest_schema(name: str, schema: dict[str, Any], definitions: dict[str, Any]) -> dict[str, Any]:
    """Prepare a schema for use inside another one, whose ``definitions`` receive its own under unique names."""
    for key, definition in schema.pop("$defs", {}).items():
        definitions[f"{name}.{key}"] = _move_references(definition, name)
    return _move_references(schema, name)


def _move_references(value: Any, name: str) -> Any:
    if isinstance(value, Mapping):
        moved = {key: _move_references(inner, name) for key, inner in value.items()}
        reference = moved.get("$ref")
        if isinstance(reference, str):
            moved["$ref"] = reference.replace("#/$defs/", f"#/$defs/{name}.", 1)
        return moved
    return [_move_references(inner, name) for inner in value] if isinstance(value, list) else value


def _add_heading(schema: Mapping[str, Any], title: str) -> dict[str, Any]:
    return {"$schema": DIALECT} | dict(schema) | {"title": title}
