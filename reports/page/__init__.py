"""The report of a run, and the pages of studies, each a self-contained HTML document."""

from .anchors import AnchorNames
from .atlas import make_atlas_page
from .bicycle import make_bicycle_page
from .document import make_page
from .families import make_families_page
from .findings import describe_stop
from .gate import make_gate_page
from .history import describe_run, group_releases, make_history_page
from .league import LEAGUE_COLUMNS, LeagueColumn, find_creeping, make_league_page, rank_rides
from .precision import make_precision_page
from .ride_pair import make_ride_pair_page
from .run_diff import make_diff_page
from .sweep import make_sweep_page

__all__ = [
    "LEAGUE_COLUMNS",
    "AnchorNames",
    "LeagueColumn",
    "describe_run",
    "describe_stop",
    "find_creeping",
    "group_releases",
    "make_atlas_page",
    "make_bicycle_page",
    "make_diff_page",
    "make_families_page",
    "make_gate_page",
    "make_history_page",
    "make_league_page",
    "make_page",
    "make_precision_page",
    "make_ride_pair_page",
    "make_sweep_page",
    "rank_rides",
]
