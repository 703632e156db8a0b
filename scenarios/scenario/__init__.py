"""Scenario files: their schema, surfaces, engine settings and start.

Names are imported when they are first used: a single motion needs a third of what a scenario does.
"""

from typing import TYPE_CHECKING

from ...engines.lazy import import_when_used as _import_when_used

if TYPE_CHECKING:
    from .bicycle_file import BicycleFile as BicycleFile
    from .bicycle_file import read_bicycle_file as read_bicycle_file
    from .bicycle_source import BENCHMARK as BENCHMARK
    from .bicycle_source import find_bicycle as find_bicycle
    from .bicycle_source import insert_bicycle_file as insert_bicycle_file
    from .bicycle_source import name_bicycle as name_bicycle
    from .engine_settings import EngineChoice as EngineChoice
    from .engine_settings import choose_engines as choose_engines
    from .engine_settings import configure_engine as configure_engine
    from .engine_settings import fits_engine as fits_engine
    from .engine_settings import installed_engines as installed_engines
    from .engine_settings import list_engine_faults as list_engine_faults
    from .missing_motion import describe_missing_motion as describe_missing_motion
    from .parameters import PARAMETERS as PARAMETERS
    from .resolved import resolve_scenario as resolve_scenario
    from .schema import BICYCLE_FILE as BICYCLE_FILE
    from .schema import OF_THE_MOTION as OF_THE_MOTION
    from .schema import CircularTable as CircularTable
    from .schema import Gate as Gate
    from .schema import Perturbation as Perturbation
    from .schema import Scenario as Scenario
    from .schema import Simulation as Simulation
    from .schema import library_names as library_names
    from .schema import load_scenario as load_scenario
    from .schema import read_scenario_file as read_scenario_file
    from .schema import validate_scenario as validate_scenario
    from .start import Start as Start
    from .start import make_start as make_start
    from .start import make_starts as make_starts
    from .start import output_times as output_times
    from .surfaces import make_bowl as make_bowl
    from .surfaces import name_surface as name_surface
    from .surfaces import parse_surface as parse_surface
    from .table import Table as Table
    from .table import Texts as Texts
    from .table import error_place as error_place
    from .table import format_validation_error as format_validation_error
    from .table import join_complaints as join_complaints
    from .table import list_complaints as list_complaints
    from .table import read_toml as read_toml
    from .table import set_keys as set_keys
    from .table import show_value as show_value
    from .template import ScenarioTemplate as ScenarioTemplate
    from .units import find_unit as find_unit

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

if not TYPE_CHECKING:  # with __getattr__, type checkers would accept any name
    __getattr__ = _import_when_used(
        __name__,
        {
            ".bicycle_file": (
                "BicycleFile",
                "read_bicycle_file",
            ),
            ".bicycle_source": (
                "BENCHMARK",
                "find_bicycle",
                "insert_bicycle_file",
                "name_bicycle",
            ),
            ".engine_settings": (
                "EngineChoice",
                "choose_engines",
                "configure_engine",
                "fits_engine",
                "installed_engines",
                "list_engine_faults",
            ),
            ".missing_motion": ("describe_missing_motion",),
            ".parameters": ("PARAMETERS",),
            ".resolved": ("resolve_scenario",),
            ".schema": (
                "BICYCLE_FILE",
                "OF_THE_MOTION",
                "CircularTable",
                "Gate",
                "Perturbation",
                "Scenario",
                "Simulation",
                "library_names",
                "load_scenario",
                "read_scenario_file",
                "validate_scenario",
            ),
            ".start": (
                "Start",
                "make_start",
                "make_starts",
                "output_times",
            ),
            ".surfaces": (
                "make_bowl",
                "name_surface",
                "parse_surface",
            ),
            ".table": (
                "Table",
                "Texts",
                "error_place",
                "format_validation_error",
                "join_complaints",
                "list_complaints",
                "read_toml",
                "set_keys",
                "show_value",
            ),
            ".template": ("ScenarioTemplate",),
            ".units": ("find_unit",),
        },
    )
