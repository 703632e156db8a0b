"""Studies of a bicycle, of the precision of engines, of all engines side by side, and of single precision."""

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

__all__ = [
    "LEAGUE_LEVELS",
    "LEAGUE_SCENARIOS",
    "BicycleStudy",
    "LeagueFolder",
    "LeagueSettings",
    "all_ran",
    "all_rode",
    "all_rode_float32",
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
