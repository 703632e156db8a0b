"""The schema of scenario files, and functions that read and validate them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError, ValidatorFunctionWrapHandler, field_validator, model_validator

from ...engines.names import suggest_name
from ...reference.bicycle import Bicycle, require_rigid_bodies
from ...reference.inputs import Inputs
from ..error import ScenarioError
from ..names import LIBRARY as LIBRARY
from ..names import list_library
from .bicycle_source import FILE, insert_bicycle_file
from .engine_settings import list_engine_faults
from .parameters import PARAMETERS
from .surfaces import SurfaceTable
from .table import Table, Texts, join_complaints, list_complaints, read_toml, set_keys, show_value, validate_known

# Tables of a scenario that determine its motion.
OF_THE_MOTION = ("surface", "motion", "perturbation", "bicycle", "inputs")

# Description of the key `file`.
BICYCLE_FILE = "bicycle file, from the scenario's folder, that gives every parameter not named beside it"

# Larger than any value of a real bicycle, and small enough that products do not overflow.
_Moderate = Annotated[float, Field(ge=-1e6, le=1e6)]


class Near(Table):
    """Angles that a circular motion is near to."""

    lean: float = Field(description="lean", json_schema_extra={"unit": "rad"})
    steer: float = Field(description="steer, positive to the left", json_schema_extra={"unit": "rad"})


class CircularTable(Table):
    """A circular motion to start from."""

    kind: Literal["circular"] = "circular"
    rear_rate: float = Field(gt=0, le=1e4, description="rate of the rear wheel", json_schema_extra={"unit": "rad/s"})
    family: Annotated[int, Field(ge=1, le=4)] | None = Field(default=None, description="number of the solution family")
    near: Near | None = Field(default=None, description="angles that the motion is near to, where there are several")

    @model_validator(mode="after")
    def _determined(self) -> CircularTable:
        if self.family is None and self.near is None:
            raise ValueError("a circular motion needs family = 1 to 4, near = { lean, steer }, or both")
        return self


class UprightTable(Table):
    """A straight upright start along x, the rear contact in the origin."""

    kind: Literal["upright"]
    speed: float = Field(gt=0, le=1e4, description="forward speed", json_schema_extra={"unit": "m/s"})


class Perturbation(Table):
    """Added to the independent variables of the start; the rest is solved."""

    x: _Moderate = Field(
        default=0.0, description="of the point D on the steering axis", json_schema_extra={"unit": "m"}
    )
    y: _Moderate = Field(
        default=0.0, description="of the point D on the steering axis", json_schema_extra={"unit": "m"}
    )
    lean: _Moderate = Field(default=0.0, description="of the rear frame", json_schema_extra={"unit": "rad"})
    steer: _Moderate = Field(default=0.0, description="positive to the left", json_schema_extra={"unit": "rad"})
    lean_rate: _Moderate = Field(default=0.0, description="of the rear frame", json_schema_extra={"unit": "rad/s"})
    steer_rate: _Moderate = Field(default=0.0, description="positive to the left", json_schema_extra={"unit": "rad/s"})
    rear_rate: _Moderate = Field(default=0.0, description="of the rear wheel", json_schema_extra={"unit": "rad/s"})


class InputsTable(Table):
    """Generalised forces, the same in every engine and constant during the ride."""

    steer_torque: _Moderate = Field(
        default=0.0,
        description="on the front frame against the rear frame, positive to the left",
        json_schema_extra={"unit": "N m"},
    )
    rear_wheel_torque: _Moderate = Field(
        default=0.0,
        description="on the rear wheel against the rear frame, positive forward",
        json_schema_extra={"unit": "N m"},
    )
    steer_damping: Annotated[float, Field(ge=0, le=1e6)] = Field(
        default=0.0,
        description="coefficient of the torque against the steer rate on the front frame",
        json_schema_extra={"unit": "N m s/rad"},
    )


class Simulation(Table):
    """How long, and how often to report."""

    duration: float = Field(gt=0, le=1e5, description="simulated time", json_schema_extra={"unit": "s"})
    output_rate: float = Field(
        default=100.0, gt=0, le=1e5, description="samples a second", json_schema_extra={"unit": "1/s"}
    )
    beyond_fall: bool = Field(default=False, description="whether a ride goes on after the bicycle has fallen")

    @model_validator(mode="after")
    def _whole_samples(self) -> Simulation:
        samples = self.duration * self.output_rate
        if samples > 5e6:
            raise ValueError(f"duration x output_rate is {samples:.3g} samples; at most 5e6 fit a run folder")
        if samples < 0.999 or abs(samples - round(samples)) > 1e-6 * samples:
            raise ValueError(
                f"duration {self.duration!r} s is no whole number of output intervals of {1 / self.output_rate!r} s"
            )
        return self


class Gate(Simulation):
    """How the drift gate rides a scenario, and what it measures beside the ride."""

    # The slowest engine needs some seconds for this duration.
    duration: float = Field(default=3.0, gt=0, le=1e5, description="simulated time", json_schema_extra={"unit": "s"})
    # Doubled steps divide this interval too, so that engines with a coarser step can be judged.
    output_rate: float = Field(
        default=50.0, gt=0, le=1e5, description="samples a second", json_schema_extra={"unit": "1/s"}
    )
    order: bool = Field(default=True, description="measure the order of convergence")
    eigenvalues: bool = Field(default=True, description="measure the engine's own eigenvalues, of a circular motion")


class Criterion(Table):
    """A verdict that a benchmark asks of every engine."""

    energy_variation: float = Field(
        gt=0, description="limit of 100 (Emax - Emin) / E(0)", json_schema_extra={"unit": "percent"}
    )


def _list_parameters(schema: dict[str, Any]) -> None:
    """Add the parameters of a bicycle to the JSON schema of their table."""
    value = schema.pop("additionalProperties")
    benchmark = Bicycle()
    schema["properties"] = {
        name: value | {"default": getattr(benchmark, name), "description": meaning, "unit": unit}
        for name, (unit, meaning) in PARAMETERS.items()
    }
    schema["properties"][FILE] = {"type": "string", "description": BICYCLE_FILE}
    schema["additionalProperties"] = False


class Scenario(Table):
    """A scenario as its file declares it."""

    title: str = Field(description="one line of text")
    tags: Texts = Field(default=(), description="for velodrome run --tag")
    surface: SurfaceTable = Field(description="the ground")
    motion: Annotated[CircularTable | UprightTable, Field(discriminator="kind")] = Field(
        description="the motion to start from"
    )
    perturbation: Perturbation = Field(default=Perturbation(), description="added to the start; the rest is solved")
    simulation: Simulation = Field(description="how long, and how often to report")
    gate: Gate | None = Field(default=None, description="how velodrome check rides it")
    criterion: Criterion | None = Field(default=None, description="a verdict on every engine")
    bicycle: dict[str, _Moderate] = Field(
        default_factory=dict,
        description="parameters that differ from the benchmark bicycle's",
        json_schema_extra=_list_parameters,
    )
    inputs: InputsTable = Field(
        default=InputsTable(), description="generalised forces; a circular motion is the one with them held"
    )
    engines: dict[str, dict[str, Any]] = Field(
        default_factory=dict, description="settings by engine, each checked by its engine"
    )

    @field_validator("title")
    @classmethod
    def _title_is_one_line(cls, title: str) -> str:
        return _require_line_of_text(title)

    @field_validator("tags")
    @classmethod
    def _tags_are_lines(cls, tags: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(_require_line_of_text(tag) for tag in tags)

    @field_validator("motion", mode="before")
    @classmethod
    def _circular_by_default(cls, motion: Any) -> Any:
        if isinstance(motion, Mapping) and "kind" not in motion:
            return {"kind": "circular", **motion}
        return motion

    @field_validator("bicycle")
    @classmethod
    def _bicycle_exists(cls, bicycle: dict[str, float]) -> dict[str, float]:
        faults = _list_bicycle_faults(bicycle)
        if faults:
            raise ValueError("; ".join(faults))
        return bicycle

    @field_validator("bicycle", mode="wrap")
    @classmethod
    def _known_parameters(cls, bicycle: Any, handler: ValidatorFunctionWrapHandler) -> dict[str, float]:
        words = "{name} is unknown ({meant})"
        return validate_known("Bicycle", bicycle, Bicycle.__dataclass_fields__, handler, words)

    def make_bicycle(self) -> Bicycle:
        """Build the benchmark bicycle with this scenario's overrides."""
        return _make_bicycle(tuple(self.bicycle.items()))

    def make_inputs(self) -> Inputs:
        """Make the inputs of this scenario's rides."""
        return Inputs(**self.inputs.model_dump())


@lru_cache(maxsize=64)
def _make_bicycle(changed: tuple[tuple[str, float], ...]) -> Bicycle:
    return Bicycle(**dict(changed))


def _list_bicycle_faults(values: Mapping[str, float]) -> list[str]:
    """List the faults of single parameters, or the fault of all parameters together if no single one is wrong."""
    try:
        require_rigid_bodies(Bicycle(**values))
    except ValueError as error:
        joint_fault = str(error)
    else:
        return []
    faults = []
    for name, value in values.items():
        try:
            Bicycle(**{name: value})
        except ValueError as error:
            # Inertias can be checked only together with the other parameters.
            if str(error).startswith(f"bicycle parameter {name} is"):
                faults.append(str(error))
    return [
        fault.removeprefix("bicycle parameter ").removeprefix("bicycle parameters ")
        for fault in faults or [joint_fault]
    ]


def _require_line_of_text(text: str) -> str:
    if not text.strip() or not text.isprintable():
        raise ValueError("must be one line of text")
    return text


def library_names() -> list[str]:
    """Return the names of the library's scenarios, sorted."""
    return list_library()


def load_scenario(
    source: str,
    changes: Mapping[str, Any] | None = None,
    given_by: str = "changes:",
    bicycle: Bicycle | None = None,
) -> tuple[str, Scenario]:
    """Read a scenario by library name or path, apply changes, and validate the result.

    Parameters
    ----------
    source : str
        A library name, or a path to a TOML file.
    changes : mapping, optional
        Dotted key to value, e.g. ``{"simulation.duration": 5.0}``.
    given_by : str
        What the changes were given by, for errors: an argument or an option.
    bicycle : Bicycle, optional
        Replaces the scenario's bicycle, its whole table ``[bicycle]``, before the changes apply.

    Returns
    -------
    name : str
        The library name or the file's stem.
    scenario : Scenario

    Raises
    ------
    ScenarioError
        If the scenario cannot be read or is not valid. The message is one line.
    """
    names = library_names()
    if source in names:
        name, text = source, (LIBRARY / f"{source}.toml").read_text(encoding="utf-8")
    elif Path(source).suffix != ".toml":
        raise ScenarioError(
            f"no scenario {show_value(repr(source))} in the library ({suggest_name(source, names)})"
            "; name one of it, or give a path to a .toml file"
        )
    else:
        name, text = read_scenario_file(source)
    try:
        data = read_toml(text)
    except ValueError as error:
        raise ScenarioError(f"{show_value(source)}: not valid TOML: {show_value(str(error))}") from error
    if bicycle is not None:
        data = {**data, "bicycle": asdict(bicycle)}
    faults = []
    for key, value in (changes or {}).items():
        try:
            data = set_keys(data, {key: _locate_change(key, value, bicycle)})
        except ValueError as error:
            faults.append(f"{given_by} {error}")
    try:
        data = insert_bicycle_file(data, LIBRARY if name == source else Path(source).parent)
    except ScenarioError as error:
        faults.append(str(error) if f"bicycle.{FILE}" in (changes or {}) else f"{show_value(source)}: {error}")
        data = {**data, "bicycle": {key: value for key, value in data["bicycle"].items() if key != FILE}}
    try:
        scenario = validate_scenario(data, source)
    except ScenarioError as error:
        if not faults:
            raise
        faults.append(str(error))
    else:
        if not faults:
            return name, scenario
    raise ScenarioError(join_complaints(faults))


def _locate_change(key: str, value: Any, bicycle: Bicycle | None) -> Any:
    """Return the value of a change; a bicycle file is named from the working folder, not from the scenario's.

    Raises
    ------
    ValueError
        If the change names a bicycle file, and the scenario's bicycle has been replaced by another one already.
    """
    if key != f"bicycle.{FILE}":
        return value
    if bicycle is not None:
        raise ValueError(f"{key}: the bicycle is given already")
    return str(Path(value).absolute()) if isinstance(value, str) and Path(value).is_file() else value


def validate_scenario(data: Mapping[str, Any], source: str) -> Scenario:
    """Validate a scenario's data.

    Raises
    ------
    ScenarioError
        If the data are not valid. The message lists all faults in one line, including those of the settings of all
        engines. If the settings are the only possible fault, they are left to `velodrome.scenarios.run.plan_run`,
        since loading all engines takes a second.
    """
    try:
        return Scenario.model_validate(data)
    except ValidationError as error:
        faults = [*list_complaints(error), *list_engine_faults(data.get("engines"))]
        raise ScenarioError(f"{show_value(source)}: {join_complaints(faults)}") from error


def read_scenario_file(source: str) -> tuple[str, str]:
    """Read a scenario or sweep file; return the stem of its name and its text.

    Raises
    ------
    ScenarioError
        If the file cannot be read.
    """
    path = Path(source)
    # Run folders and their files are named after the stem.
    if not path.stem.isprintable():
        raise ScenarioError(f"{show_value(source)}: cannot be read: a scenario's file name must be printable text")
    try:
        if path.exists() and not path.is_file():
            # Reading a pipe would block.
            what = "it is a folder" if path.is_dir() else "it is no file"
            raise ScenarioError(f"{show_value(source)}: cannot be read: {what}")
        return path.stem, path.read_text(encoding="utf-8-sig")
    except (OSError, ValueError) as error:
        if isinstance(error, ScenarioError):
            raise
        reason = error.strerror if isinstance(error, OSError) else "not UTF-8 text"
        raise ScenarioError(f"{show_value(source)}: cannot be read: {reason}") from error
