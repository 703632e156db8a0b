"""The report of a run and the page of a league, as self-contained HTML."""

from .document import make_page
from .league import LEAGUE_COLUMNS, find_creeping, make_league_page, rank_rides

__all__ = ["LEAGUE_COLUMNS", "find_creeping", "make_league_page", "make_page", "rank_rides"]
