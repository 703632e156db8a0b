"""Studies of a bicycle, of the precision of engines, of all engines side by side, and of single precision.

What needs the room of bifurcations is imported when it is first used.
"""

from typing import TYPE_CHECKING

from ...engines.lazy import import_when_used as _import_when_used
from .bicycle import BicycleStudy, study_bicycle, write_bicycle
from .float32 import all_rode_float32, study_float32, write_float32
from .league import (
    LEAGUE_LEVELS,
    LEAGUE_SCENARIOS,
    LeagueFolder,
    all_rode,
    plan_league,
    run_league,
)
from .league_settings import LeagueSettings, read_league_settings
from .precision import all_ran, study_precision, write_precision

if TYPE_CHECKING:
    from .engine_ends import EngineEnd as EngineEnd
    from .engine_ends import configure_steps as configure_steps
    from .engine_ends import measure_engine_ends as measure_engine_ends

__all__ = [
    "LEAGUE_LEVELS",
    "LEAGUE_SCENARIOS",
    "BicycleStudy",
    "EngineEnd",
    "LeagueFolder",
    "LeagueSettings",
    "all_ran",
    "all_rode",
    "all_rode_float32",
    "configure_steps",
    "measure_engine_ends",
    "plan_league",
    "read_league_settings",
    "run_league",
    "study_bicycle",
    "study_float32",
    "study_precision",
    "write_bicycle",
    "write_float32",
    "write_precision",
]

if not TYPE_CHECKING:  # with __getattr__, type checkers would accept any name
    __getattr__ = _import_when_used(
        __name__,
        {
            ".engine_ends": ("EngineEnd", "configure_steps", "measure_engine_ends"),
        },
    )
