"""The same rides in every release of an engine's package, and which release changed what."""

from .children import Children
from .environments import find_cache_folder
from .origin import find_stored_histories, name_origins
from .plan import HistoryPlan, PlannedRide, plan_history
from .release_baselines import plan_release_baselines, ride_release_baselines
from .release_run import OpenedRelease, RunEnded, open_release, plan_release_run, run_in_release
from .run import HistoryOptions, run_history
from .store import HistoryFolder

__all__ = [
    "Children",
    "HistoryFolder",
    "HistoryOptions",
    "HistoryPlan",
    "OpenedRelease",
    "PlannedRide",
    "RunEnded",
    "find_cache_folder",
    "find_stored_histories",
    "name_origins",
    "open_release",
    "plan_history",
    "plan_release_baselines",
    "plan_release_run",
    "ride_release_baselines",
    "run_history",
    "run_in_release",
]
