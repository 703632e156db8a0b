"""The schema of a sweep file: a base scenario, engines, and changes from run to run."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Field, ValidationError, field_validator, model_validator

from ...engines.engine import REFERENCE
from ..error import ScenarioError
from ..scenario import (
    Scenario,
    Table,
    Texts,
    insert_bicycle_file,
    join_complaints,
    list_complaints,
    load_scenario,
    read_scenario_file,
    read_toml,
    show_value,
    validate_scenario,
)

_Range = Annotated[tuple[float, float], Field(strict=False)]  # TOML has arrays only
_Values = Annotated[tuple[Any, ...], Field(strict=False, min_length=1)]
_Names = Annotated[Texts, Field(min_length=1)]


def flatten_table(table: Any) -> Any:
    """Replace tables in tables by dotted keys: ``{"surface": {"alpha": 1}}`` becomes ``{"surface.alpha": 1}``."""
    if not isinstance(table, Mapping):
        return table  # validation reports the error
    found: dict[str, Any] = {}
    for key, value in table.items():
        if isinstance(value, Mapping) and value:
            found |= {f"{key}.{rest}": part for rest, part in flatten_table(value).items()}
        else:
            found[key] = value
    return found


def _allow_tables(schema: dict[str, Any]) -> None:
    """Allow nested tables in the JSON schema of dotted keys; `flatten_table` reads both forms."""
    leaf = schema["additionalProperties"]
    schema["additionalProperties"] = {"anyOf": [leaf, {"type": "object"}]}


class Hypercube(Table):
    """Points of a Latin hypercube."""

    count: int = Field(ge=1, description="number of points")
    seed: int = Field(ge=0, description="seed of the random numbers")
    ranges: dict[str, _Range] = Field(
        min_length=1,
        description="scenario's keys, dotted or as tables, to [low, high]",
        json_schema_extra=_allow_tables,
    )

    @field_validator("ranges", mode="before")
    @classmethod
    def _dotted(cls, ranges: Any) -> Any:
        return flatten_table(ranges)

    @field_validator("ranges")
    @classmethod
    def _rising(cls, ranges: dict[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
        for key, (low, high) in ranges.items():
            if not low < high:
                raise ValueError(f"{key} must be [low, high] with low < high")
        return ranges


class SweepFile(Table):
    """A sweep as its file declares it."""

    title: str = Field(default="", description="one line of text")
    scenario: str | dict[str, Any] = Field(description="library name, path from the sweep file, or tables")
    engines: _Names = Field(
        default=(REFERENCE,), description="engines that ride at every point: names, patterns, or all"
    )
    time_limit: float = Field(
        default=600.0, gt=0, le=1e6, description="of a run, on the clock", json_schema_extra={"unit": "s"}
    )
    memory_limit: float | None = Field(
        default=None,
        ge=1,
        le=1e9,
        description="memory that a run may take for itself",
        json_schema_extra={"unit": "MB"},
    )
    grid: dict[str, _Values] = Field(
        default_factory=dict,
        description="scenario's keys, dotted or as tables, to lists of values: all combinations",
        json_schema_extra=_allow_tables,
    )
    latin_hypercube: Hypercube | None = Field(default=None, description="points of a Latin hypercube")
    list: Annotated[tuple[dict[str, Any], ...], Field(strict=False)] = Field(
        default=(), description="points, a table each"
    )

    @field_validator("grid", mode="before")
    @classmethod
    def _dotted(cls, grid: Any) -> Any:
        return flatten_table(grid)

    @field_validator("list")
    @classmethod
    def _rows_dotted(cls, rows: tuple[dict[str, Any], ...]) -> tuple[dict[str, Any], ...]:
        return tuple(flatten_table(row) for row in rows)

    @model_validator(mode="after")
    def _each_key_once(self) -> Self:
        places = {"grid": set(self.grid), "list": {key for row in self.list for key in row}}
        places["latin_hypercube"] = set(self.latin_hypercube.ranges) if self.latin_hypercube else set()
        taken: dict[str, str] = {}
        for place, keys in places.items():
            for key in sorted(keys):
                for other, where in taken.items():
                    if key == other or key.startswith(f"{other}.") or other.startswith(f"{key}."):
                        raise ValueError(f"{place}: {key!r} is changed by {where} {other!r} already")
            taken |= dict.fromkeys(keys, place)
        if len(set(self.engines)) < len(self.engines):
            raise ValueError("engines: each engine once")
        return self


def read_sweep(path: Path) -> tuple[SweepFile, dict[str, Any]]:
    """Read a sweep file and its base scenario.

    Parameters
    ----------
    path : Path

    Returns
    -------
    sweep : SweepFile
    base : dict
        The base scenario as resolved, JSON values.

    Raises
    ------
    ScenarioError
        With one line.
    """
    _, text = read_scenario_file(str(path))
    try:
        data = read_toml(text)
    except ValueError as error:
        raise ScenarioError(f"{show_value(str(path))}: not valid TOML: {show_value(str(error))}") from error
    faults, sweep, base = [], None, None
    cause: ScenarioError | ValidationError | None = None
    try:
        sweep = SweepFile.model_validate(data)
    except ValidationError as error:
        faults += list_complaints(error)
        cause = error
    try:
        base = _base(data.get("scenario"), path)
    except ScenarioError as error:
        faults.append(f"scenario: {error}")
        cause = cause or error
    if sweep is None or base is None:
        raise ScenarioError(f"{show_value(str(path))}: {join_complaints(faults)}") from cause
    return sweep, base.model_dump(mode="json", exclude_none=True)


def _base(source: Any, path: Path) -> Scenario | None:
    """Return the base scenario; None where its entry is neither text nor a table."""
    if isinstance(source, dict):
        return validate_scenario(insert_bicycle_file(source, path.parent), "its tables")
    if not isinstance(source, str):
        return None
    return load_scenario(str(path.parent / source) if source.endswith(".toml") else source)[1]
