"""Validation of the engines' settings in a scenario file, each by its own engine."""

from __future__ import annotations

import fnmatch
import json
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from pydantic import ValidationError

from ...engines.engine import REFERENCE, Engine, Settings, why_failed
from ...engines.guard import call_engine
from ...engines.names import suggest_name
from ...engines.registry import default_engines, engine_names, load_engine, uninstalled_engines
from ..error import ScenarioError
from .table import UnknownName, join_complaints, list_complaints, list_unknown, show_value

# Chooses all installed engines, on the command line and elsewhere.
ALL_ENGINES = "all"


def fits_engine(entry: str, name: str) -> bool:
    """Return whether an entry, which is a name, a pattern or ``all``, chooses an engine."""
    return entry == ALL_ENGINES or fnmatch.fnmatchcase(name, entry)


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


@dataclass(frozen=True)
class EngineChoice:
    """Engines that were chosen for a run.

    Attributes
    ----------
    names : tuple of str
        The reference first.
    named : frozenset of str
        Those that were chosen by their own names. An engine chosen by a pattern is left out where the ground does not
        suit it; one that was named is refused.
    """

    names: tuple[str, ...]
    named: frozenset[str]


def choose_engines(wanted: Iterable[str] | None) -> tuple[EngineChoice, dict[str, str]]:
    """Choose engines by name, by pattern such as ``mujoco-*``, or with ``all``.

    Parameters
    ----------
    wanted : iterable of str, optional
        Without any, the engines of the suite's own dependencies are chosen.

    Returns
    -------
    choice : EngineChoice
        It always contains the reference.
    faults : dict
        A line by entry, for each entry that chooses nothing.

    Raises
    ------
    ScenarioError
        If two packages announce engines with the same name.
    """
    installed = installed_engines()
    asked = list(wanted or [])
    if not asked:
        return EngineChoice(tuple(default_engines()), frozenset()), {}
    chosen, faults = {REFERENCE}, dict[str, str]()
    for entry in asked:
        found = [name for name in installed if fits_engine(entry, name)]
        if not found:
            faults[entry] = refuse_engine(entry, installed)
        chosen.update(found)
    names = tuple(name for name in installed if name in chosen)
    return EngineChoice(names, frozenset(name for name in asked if name in installed)), faults


def configure_engine(name: str, values: Mapping[str, Any], any_release: bool = False) -> tuple[Engine, Settings]:
    """Load an engine and validate its settings.

    Parameters
    ----------
    name : str
    values : mapping
    any_release : bool
        Whether releases of its library that its extra excludes are loaded too; see `load_engine`.

    Raises
    ------
    ScenarioError
        If there is no such engine, or settings are unknown or out of range. The message lists all faults in one line.
    """
    try:
        engine = load_engine(name, any_release)
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
        Settings by engine. Values that are not tables are left to the schema, and announced engines that cannot be
        loaded are left to the run that needs them.
    skipped : collection of str
        Engines that are not checked.
    """
    if not isinstance(engines, Mapping):
        return []
    try:
        installed, uninstalled = installed_engines(), uninstalled_engines()
    except (ScenarioError, ValueError):  # two packages announce one engine, which is not a fault of the scenario
        return []
    faults = []
    for name, values in engines.items():
        if name in skipped or name in uninstalled:
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
    """Return the message for an engine that is not installed: how to install it, or the closest installed name."""
    commands = {other: command for other, command in uninstalled_engines().items() if fits_engine(name, other)}
    if commands:
        several = f"engines {', '.join(commands)} are" if len(commands) > 1 else f"engine {next(iter(commands))!r} is"
        return f"{several} not installed; install: {'; '.join(dict.fromkeys(commands.values()))}"
    if any(letter in name for letter in "*?["):
        return f"no installed engine fits {show_value(repr(name))}: there are {', '.join(installed)}"
    return f"engine {show_value(repr(name))} is not installed ({suggest_name(name, installed)})"


def _is_loadable(name: str) -> bool:
    try:
        load_engine(name)
    except ValueError:
        return False
    return True
