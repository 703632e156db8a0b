"""Scenario files: their schema, surfaces, engine settings and start."""

from .bicycle_file import BicycleFile, read_bicycle_file
from .bicycle_source import BENCHMARK, find_bicycle, insert_bicycle_file, name_bicycle
from .engine_settings import (
    EngineChoice,
    choose_engines,
    configure_engine,
    fits_engine,
    installed_engines,
    list_engine_faults,
)
from .parameters import PARAMETERS
from .resolved import resolve_scenario
from .schema import (
    BICYCLE_FILE,
    OF_THE_MOTION,
    CircularTable,
    Gate,
    Perturbation,
    Scenario,
    Simulation,
    library_names,
    load_scenario,
    read_scenario_file,
    validate_scenario,
)
from .start import Start, describe_missing_motion, make_start, make_starts, output_times
from .surfaces import make_bowl, name_surface, parse_surface
from .table import (
    Table,
    Texts,
    error_place,
    format_validation_error,
    join_complaints,
    list_complaints,
    read_toml,
    set_keys,
    show_value,
)
from .template import ScenarioTemplate
from .units import find_unit

__all__ = [
    "BENCHMARK",
    "BICYCLE_FILE",
    "OF_THE_MOTION",
    "PARAMETERS",
    "BicycleFile",
    "CircularTable",
    "EngineChoice",
    "Gate",
    "Perturbation",
    "Scenario",
    "ScenarioTemplate",
    "Simulation",
    "Start",
    "Table",
    "Texts",
    "choose_engines",
    "configure_engine",
    "describe_missing_motion",
    "error_place",
    "find_bicycle",
    "find_unit",
    "fits_engine",
    "format_validation_error",
    "insert_bicycle_file",
    "installed_engines",
    "join_complaints",
    "library_names",
    "list_complaints",
    "list_engine_faults",
    "load_scenario",
    "make_bowl",
    "make_start",
    "make_starts",
    "name_bicycle",
    "name_surface",
    "output_times",
    "parse_surface",
    "read_bicycle_file",
    "read_scenario_file",
    "read_toml",
    "resolve_scenario",
    "set_keys",
    "show_value",
    "validate_scenario",
]
