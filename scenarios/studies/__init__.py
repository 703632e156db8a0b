"""Studies of a bicycle, of the precision of engines, and of all engines side by side."""

from .bicycle import BicycleStudy, study_bicycle, write_bicycle
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
    "plan_league",
    "read_league_settings",
    "run_league",
    "study_bicycle",
    "study_precision",
    "write_bicycle",
    "write_precision",
]
