"""The reference of scenario and sweep files, from their schemas."""

from __future__ import annotations

from collections.abc import Iterator
from inspect import getdoc
from typing import Any, get_args

from fields import list_fields
from pydantic import BaseModel

from velodrome.reference.bicycle import Bicycle
from velodrome.scenarios.scenario import BICYCLE_FILE, PARAMETERS
from velodrome.scenarios.scenario.schema import Scenario
from velodrome.scenarios.scenario.surfaces import SurfaceTable
from velodrome.scenarios.sweep.file import Hypercube, SweepFile


def scenario_tables() -> dict[str, list[type[BaseModel]]]:
    """Models of a scenario file's tables, by the name of the table; several where ``kind`` chooses."""
    found: dict[str, list[type[BaseModel]]] = {}
    for name, field in Scenario.model_fields.items():
        models = [model for model in _models(field.annotation) if issubclass(model, BaseModel)]
        if name == "surface":
            models = list(_models(SurfaceTable))
        if models:
            found[name] = models
    return found


def _models(annotation: Any) -> Iterator[type]:
    """Classes that an annotation is made of."""
    if isinstance(annotation, type):
        yield annotation
    for part in get_args(annotation):
        yield from _models(part)


def describe_scenario_file() -> str:
    """Markdown of all tables and fields of a scenario file."""
    tables = scenario_tables()
    links = {
        model.__name__: f"table [`[{name}]`](#table-{name})" for name, models in tables.items() for model in models
    }
    parts = ["## Top level", list_fields(Scenario, links)]
    for name, models in tables.items():
        parts += [f"(table-{name})=", f"## `[{name}]`"]
        for model in models:
            kind = model.model_fields.get("kind")
            if kind is not None:
                (value,) = get_args(kind.annotation)
                parts.append(f'### `kind = "{value}"`')
            parts += [first_line(model), list_fields(model)]
    parts += ["(table-bicycle)=", "## `[bicycle]`", "Parameters of the bicycle that differ from the benchmark's:"]
    parts.append(list_parameters())
    return "\n\n".join(parts)


def list_parameters() -> str:
    """Markdown of the bicycle's parameters with the benchmark's values."""
    lines = ["| parameter | benchmark | meaning |", "| --- | ---: | --- |", f"| `file` | none | {BICYCLE_FILE} |"]
    for name, parameter in PARAMETERS.items():
        unit = "" if parameter.unit == "1" else f" [{parameter.unit}]"
        lines.append(f"| `{name}` | {Bicycle.__dataclass_fields__[name].default!r} | {parameter.meaning}{unit} |")
    return "\n".join(lines)


def describe_sweep_file() -> str:
    """Markdown of all fields of a sweep file."""
    links = {Hypercube.__name__: "table [`[latin_hypercube]`](#table-latin-hypercube)"}
    return "\n\n".join(
        [
            "## Top level",
            list_fields(SweepFile, links),
            "(table-latin-hypercube)=",
            "## `[latin_hypercube]`",
            first_line(Hypercube),
            list_fields(Hypercube),
        ]
    )


def first_line(thing: Any) -> str:
    """First line of a docstring."""
    return (getdoc(thing) or "").partition("\n")[0]
