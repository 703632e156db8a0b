"""Scenario files: their schema, the surfaces they can name, and the start they describe."""

from .schema import (
    OF_THE_MOTION,
    CircularTable,
    Gate,
    Scenario,
    Simulation,
    library_names,
    load_scenario,
    read_file,
    validate,
)
from .start import Start, make_start
from .surfaces import bowl, named, parse_surface
from .table import Table, UnknownName, kinds, one_line, placed, read_toml, refuse_unknown, shown

__all__ = [
    "OF_THE_MOTION",
    "CircularTable",
    "Gate",
    "Scenario",
    "Simulation",
    "Start",
    "Table",
    "UnknownName",
    "bowl",
    "kinds",
    "library_names",
    "load_scenario",
    "make_start",
    "named",
    "one_line",
    "parse_surface",
    "placed",
    "read_file",
    "read_toml",
    "refuse_unknown",
    "shown",
    "validate",
]
