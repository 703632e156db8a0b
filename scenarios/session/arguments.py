"""Checks of what users pass from Python: one line names the argument, what it is and what would be right."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from numbers import Real
from pathlib import Path
from typing import Any, cast

import numpy as np

from ...engines.engine import REFERENCE, Settings
from ...reference.bicycle import Bicycle
from ...reference.inputs import NO_INPUTS, Inputs
from ...reference.surface import Surface
from ..error import ScenarioError
from ..scenario import find_bicycle, parse_surface, show_value


def read_path(name: str, value: Any) -> Path:
    """Return an argument that is a path.

    Raises
    ------
    ScenarioError
        If it is neither text nor a path, or no path of the file system.
    """
    if not isinstance(value, str | os.PathLike):
        raise _refuse(name, value, "it must be a str or a Path")
    text = os.fspath(cast("str | os.PathLike[Any]", value))
    if not isinstance(text, str):
        raise _refuse(name, value, "it must be a str or a Path")
    if "\0" in text:
        raise _refuse(name, text, "a path has no null character")
    return Path(text)


def read_engines(engines: Any) -> list[str] | None:
    """Return the names of engines that ``engines`` holds, None if it is None.

    Raises
    ------
    ScenarioError
        If it is neither a name nor an iterable of names.
    """
    if engines is None:
        return None
    if isinstance(engines, str):
        return [engines]
    if not isinstance(engines, Iterable) or isinstance(engines, Mapping | bytes):
        raise _refuse("engines", engines, _give_name(engines))
    names = list(cast("Iterable[Any]", engines))
    for k, name in enumerate(names):
        if not isinstance(name, str):
            raise _refuse(f"engines[{k}]", name, _give_name(name))
    return names or [REFERENCE]


def _give_name(value: Any) -> str:
    """Say that engines are given by name, with that of an engine object."""
    name = getattr(value, "name", None)
    if hasattr(value, "simulate") and isinstance(name, str):
        return f"engines are given by name: engines=[{show_value(repr(name))}]"
    return "engines are given by name, such as engines=['exudyn']"


def read_changes(changes: Any) -> dict[str, Any]:
    """Return changes of a scenario's fields by dotted key, with values that a TOML file could hold.

    Raises
    ------
    ScenarioError
        If they are not a mapping, or a key is not text.
    """
    if changes is None:
        return {}
    right = "it must be a mapping of dotted keys to values, such as {'perturbation.lean_rate': 0.2}"
    if not isinstance(changes, Mapping):
        raise _refuse("changes", changes, right)
    return _with_plain_values("changes", cast("Mapping[Any, Any]", changes), right)


def read_settings(settings: Any) -> dict[str, dict[str, Any]]:
    """Return settings by the name of an engine as tables of plain values.

    Raises
    ------
    ScenarioError
        If they are not a mapping of names to tables of settings.
    """
    if settings is None:
        return {}
    right = "it must be a mapping of engine names to settings, such as {'exudyn': {'step': 0.001}}"
    if not isinstance(settings, Mapping):
        raise _refuse("settings", settings, right)
    found: dict[str, dict[str, Any]] = {}
    for name, given in cast("Mapping[Any, Any]", settings).items():
        if not isinstance(name, str):
            raise _refuse("a key of settings", name, right)
        where = f"settings[{show_value(repr(name))}]"
        if isinstance(given, Settings):
            found[name] = given.model_dump(mode="json", exclude_none=True)
        elif isinstance(given, Mapping):
            table = cast("Mapping[Any, Any]", given)
            found[name] = _with_plain_values(where, table, "settings are given by name, such as {'step': 0.001}")
        else:
            raise _refuse(where, given, "it must be a mapping such as {'step': 0.001}, or an instance of its Settings")
    return found


def _with_plain_values(where: str, table: Mapping[Any, Any], right: str) -> dict[str, Any]:
    for key in table:
        if not isinstance(key, str):
            raise _refuse(f"a key of {where}", key, right)
    return {key: plain_value(value) for key, value in table.items()}


def plain_value(value: Any) -> Any:
    """Return a value of numpy as one that a TOML file could hold, and others as they are."""
    given: Any = value
    return given.tolist() if isinstance(value, np.generic | np.ndarray) else value


def read_progress(value: Any) -> Callable[..., None]:
    """Return the function that is called with progress; one that ignores it if the argument is None.

    Raises
    ------
    ScenarioError
        If the argument can neither be called nor is None.
    """
    if value is None:
        return ignore_progress
    if not callable(value):
        raise _refuse("progress", value, "it must be a function, or None")
    return cast("Callable[..., None]", value)


def ignore_progress(*_: object) -> None:
    """Ignore progress and notes."""


def read_number(name: str, value: Any, unit: str) -> float:
    """Return an argument that is a number; whether it is finite and in range is checked where it is used.

    Raises
    ------
    ScenarioError
        If it is none.
    """
    number = plain_value(value)  # an array without axes is a number too
    if isinstance(number, bool) or not isinstance(number, Real):
        raise _refuse(name, value, f"it must be a number [{unit}]")
    return float(number)


def read_family(family: Any) -> int | None:
    """Return the number of a solution family; whether there is such a family is checked where it is used.

    Raises
    ------
    ScenarioError
        If it is no whole number.
    """
    if family is None:
        return None
    number = plain_value(family)
    if type(number) is not int:  # neither a bool
        raise _refuse("family", family, "it must be one of the whole numbers 1, 2, 3 and 4")
    return number


def read_near(near: Any) -> tuple[float, float] | None:
    """Return lean and steer [rad].

    Raises
    ------
    ScenarioError
        If they are not two numbers.
    """
    if near is None:
        return None
    right = "it must be two angles, lean and steer [rad], such as (0.74, 2.84)"
    if isinstance(near, str | bytes | Mapping | set) or not isinstance(near, Iterable):
        raise _refuse("near", near, right)
    try:
        lean, steer = (read_number("near", angle, "rad") for angle in cast("Iterable[Any]", near))
    except (TypeError, ValueError) as error:
        raise _refuse("near", near, right) from error
    return lean, steer


def read_ground(alpha: Any, surface: Any) -> Surface | float:
    """Return the ground that one of ``alpha`` and ``surface`` gives.

    Raises
    ------
    ScenarioError
        If both or none are given, or what is given is no ground.
    """
    if (alpha is None) == (surface is None):
        raise ScenarioError("give the bowl by one of alpha and surface, such as alpha=0.005 or surface=Sphere(20.0)")
    if surface is None:
        return read_number("alpha", alpha, "1/m")
    if isinstance(surface, str):
        return parse_surface(surface)
    if isinstance(surface, type):
        made = f"{surface.__name__}(...)"
        raise _refuse("surface", surface, f"it must be a surface, not its class: {show_value(made)}")
    if not (hasattr(surface, "function") and hasattr(surface, "parameters")):
        raise _refuse("surface", surface, "it must be a surface such as Sphere(20.0), or a text: 'sphere:radius=20'")
    ground: Surface = surface
    return ground


def read_bicycle(bicycle: Any) -> Bicycle:
    """Return the bicycle, the benchmark bicycle if it is None, that of a file if it is a path.

    Raises
    ------
    ScenarioError
        If it is no bicycle, or the file cannot be read.
    """
    if bicycle is None:
        return Bicycle()
    if isinstance(bicycle, str | os.PathLike):
        source = str(read_path("bicycle", bicycle))
        try:
            return find_bicycle(source).bicycle
        except ScenarioError as error:
            named = f"bicycle is {show_value(repr(source))}; it must be a Bicycle or the path of a bicycle file"
            raise ScenarioError(f"{named}: {error}") from error
    if not isinstance(bicycle, Bicycle):
        raise _refuse("bicycle", bicycle, "it must be a Bicycle, such as Bicycle(trail=0.1), or a bicycle file")
    return bicycle


def read_inputs(inputs: Any) -> Inputs:
    """Return the inputs, none if they are None.

    Raises
    ------
    ScenarioError
        If they are no inputs.
    """
    if inputs is None:
        return NO_INPUTS
    if not isinstance(inputs, Inputs):
        raise _refuse("inputs", inputs, "it must be an Inputs, such as Inputs(steer_torque=0.1)")
    return inputs


def _refuse(name: str, value: Any, right: str) -> ScenarioError:
    """Return the error of an argument: what it is, and what would be right."""
    try:
        text = repr(value)
    except Exception:  # an object of the user's may have a repr that breaks
        text = "an object without a repr"
    return ScenarioError(f"{name} is {show_value(' '.join(text.split()))} ({type(value).__name__}); {right}")
