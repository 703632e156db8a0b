"""A scenario in every engine: planned, run, measured, and stored as a run folder."""

from ..scenario import configure_engine
from .folder import RunPlan, library_versions
from .installed import installed_engines
from .runner import RunOutcome, RunWatch, Trace, claimed_noise, measure_one, plan_run, run_plan
from .stored import find_part, read_document, read_json, read_ride

__all__ = [
    "RunOutcome",
    "RunPlan",
    "RunWatch",
    "Trace",
    "claimed_noise",
    "configure_engine",
    "find_part",
    "installed_engines",
    "library_versions",
    "measure_one",
    "plan_run",
    "read_document",
    "read_json",
    "read_ride",
    "run_plan",
]
