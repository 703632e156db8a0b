"""The same rides in every release of an engine's package, and which release changed what."""

from .children import Children
from .environments import find_cache_folder
from .plan import HistoryPlan, PlannedRide, plan_history
from .run import HistoryOptions, run_history
from .store import HistoryFolder

__all__ = [
    "Children",
    "HistoryFolder",
    "HistoryOptions",
    "HistoryPlan",
    "PlannedRide",
    "find_cache_folder",
    "plan_history",
    "run_history",
]
