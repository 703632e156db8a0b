"""Scenario files: their schema, the surfaces they can name, and the start they describe."""

from .schema import (
    OF_THE_MOTION,
    CircularTable,
    Gate,
    Scenario,
    Simulation,
    library_names,
    load_scenario,
    read_scenario_file,
    validate_scenario,
)
from .start import Start, make_start, output_times
from .surfaces import make_bowl, name_surface, parse_surface
from .table import (
    Table,
    UnknownName,
    format_validation_error,
    list_kinds,
    place_error,
    read_toml,
    refuse_unknown,
    show_value,
)

__all__ = [
    "OF_THE_MOTION",
    "CircularTable",
    "Gate",
    "Scenario",
    "Simulation",
    "Start",
    "Table",
    "UnknownName",
    "format_validation_error",
    "library_names",
    "list_kinds",
    "load_scenario",
    "make_bowl",
    "make_start",
    "name_surface",
    "output_times",
    "parse_surface",
    "place_error",
    "read_scenario_file",
    "read_toml",
    "refuse_unknown",
    "show_value",
    "validate_scenario",
]
