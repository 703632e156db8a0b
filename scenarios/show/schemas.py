"""JSON schemas of what users write, for editors: scenario files, sweep files, engines' settings, a bicycle's table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel

from ...engines.engine import load_engine, why_failed
from ...engines.guard import call_engine
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
        Of the engine; not looked at otherwise.
    sweep : type
        Model of sweep files, which belong to a room that this one does not know.

    Returns
    -------
    dict
        In the dialect 2020-12.

    Raises
    ------
    ScenarioError
        If the engine cannot be loaded.
    """
    if kind == "engine":
        return _headed(settings_schema(name), f"Settings of {name}: the table [engines.{name}] of a scenario file")
    if kind == "sweep":
        return _headed(sweep.model_json_schema(), "A sweep file")
    scenario = scenario_schema()
    if kind == "bicycle":
        return _headed(scenario["properties"]["bicycle"], "The table [bicycle] of a scenario file")
    return _headed(scenario, "A scenario file")


def scenario_schema() -> dict[str, Any]:
    """JSON schema of scenario files, with the settings of all installed engines that can be loaded."""
    schema = Scenario.model_json_schema()
    engines = {}
    for name in installed_engines():
        try:
            engines[name] = _nested(name, settings_schema(name), schema.setdefault("$defs", {}))
        except ScenarioError:
            continue  # a scenario for the other engines can be written all the same
    # A table for an engine that is not installed here is refused, so it is named as a mistake here too.
    schema["properties"]["engines"] |= {"properties": engines, "additionalProperties": False}
    return schema


def settings_schema(name: str) -> dict[str, Any]:
    """JSON schema of an engine's settings.

    Raises
    ------
    ScenarioError
        If the engine cannot be loaded, or its settings have none.
    """
    try:
        engine = load_engine(name)
    except ValueError as error:
        raise ScenarioError(" ".join(str(error).split())) from error
    try:
        return call_engine(engine.settings.model_json_schema)
    except Exception as error:  # settings may have code of their own
        raise ScenarioError(f"engine {name!r}: its settings have no JSON schema: {why_failed(error)}") from error


def _nested(name: str, schema: dict[str, Any], definitions: dict[str, Any]) -> dict[str, Any]:
    """A schema inside another: its own definitions move there, under names of their own."""
    for key, definition in schema.pop("$defs", {}).items():
        definitions[f"{name}.{key}"] = _moved(definition, name)
    return _moved(schema, name)


def _moved(value: Any, name: str) -> Any:
    if isinstance(value, Mapping):
        moved = {key: _moved(inner, name) for key, inner in value.items()}
        reference = moved.get("$ref")
        if isinstance(reference, str):
            moved["$ref"] = reference.replace("#/$defs/", f"#/$defs/{name}.", 1)
        return moved
    return [_moved(inner, name) for inner in value] if isinstance(value, list) else value


def _headed(schema: Mapping[str, Any], title: str) -> dict[str, Any]:
    return {"$schema": DIALECT} | dict(schema) | {"title": title}
