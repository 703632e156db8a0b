"""Validation of the engines' settings in a scenario file, each by its own engine."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from typing import Any

from pydantic import ValidationError

from ...engines.engine import Engine, Settings, engine_names, load_engine, why_failed
from ...engines.guard import call_engine
from ...engines.names import suggest_name
from ..error import ScenarioError
from .table import UnknownName, join_complaints, list_complaints, list_unknown, show_value


def installed_engines() -> list[str]:
    """Return the names of all installed engines, the reference first.

    Raises
    ------
    ScenarioError
        If two packages announce engines with the same name.
    """
    try:
        return engine_names()
    except ValueError as error:
        raise ScenarioError(str(error)) from error


def configure_engine(name: str, values: Mapping[str, Any]) -> tuple[Engine, Settings]:
    """Load an engine and validate its settings.

    Raises
    ------
    ScenarioError
        If there is no such engine, or settings are unknown or out of range. The message lists all faults in one line.
    """
    try:
        engine = load_engine(name)
    except ValueError as error:
        raise ScenarioError(" ".join(str(error).split())) from error
    where = f"engines.{name}"
    known = engine.settings.model_fields
    complaints = [f"{where}: {line}" for line in list_unknown(values, known)]
    cause: Exception | None = UnknownName(complaints[0]) if complaints else None
    try:
        # Validated as JSON, since strict validation of Python values refuses a list for a tuple.
        text = json.dumps({key: value for key, value in values.items() if key in known}, default=str)
        settings = call_engine(engine.settings.model_validate_json, text, strict=True)
    except ValidationError as error:
        cause = cause or error
        complaints += [f"{where}.{line}" for line in list_complaints(error)]
    except ValueError as error:
        cause = cause or error
        complaints.append(f"{where}: {error}")
    except Exception as error:  # settings may have code of their own
        raise ScenarioError(f"{where}: its settings failed: {why_failed(error)}") from error
    else:
        if not complaints:
            return engine, settings
    raise ScenarioError(join_complaints(complaints)) from cause


def list_engine_faults(engines: Any, skipped: Collection[str] = ()) -> list[str]:
    """List all faults of the tables ``[engines.NAME]`` of a scenario, whether the engines take part in a run or not.

    Parameters
    ----------
    engines : Any
        Settings by engine. Values that are not tables are left to the schema, and installed engines that cannot be
        loaded are left to the run that needs them.
    skipped : collection of str
        Engines that are not checked.
    """
    if not isinstance(engines, Mapping):
        return []
    try:
        installed = installed_engines()
    except ScenarioError:  # two packages announce one engine, which is not a fault of the scenario
        return []
    faults = []
    for name, values in engines.items():
        if name in skipped:
            continue
        if name not in installed:
            faults.append(refuse_engine(name, installed))
        elif isinstance(values, Mapping) and _is_loadable(name):
            try:
                configure_engine(name, values)
            except ScenarioError as error:
                faults.append(str(error))
    return faults


def refuse_engine(name: str, installed: Collection[str]) -> str:
    """Return the message for an engine that is not installed, with the closest installed name."""
    return f"engine {show_value(repr(name))} is not installed ({suggest_name(name, installed)})"


def _is_loadable(name: str) -> bool:
    try:
        load_engine(name)
    except ValueError:
        return False
    return True
