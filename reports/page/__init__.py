"""The report of a run, and the pages of a league and of a history, as self-contained HTML."""

from .anchors import AnchorNames
from .document import make_page
from .history import describe_run, group_releases, make_history_page
from .league import LEAGUE_COLUMNS, LeagueColumn, find_creeping, make_league_page, rank_rides
from .ride_pair import make_ride_pair_page

__all__ = [
    "LEAGUE_COLUMNS",
    "AnchorNames",
    "LeagueColumn",
    "describe_run",
    "find_creeping",
    "group_releases",
    "make_history_page",
    "make_league_page",
    "make_page",
    "make_ride_pair_page",
    "rank_rides",
]
