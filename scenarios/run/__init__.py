"""A scenario in every engine: planned, run, measured, and stored as a run folder."""

from .folder import Plan, library_versions
from .installed import installed
from .runner import Outcome, Trace, Watch, claimed_noise, configure, measure_one, plan_run, run
from .stored import document, part, read_json, ride

__all__ = [
    "Outcome",
    "Plan",
    "Trace",
    "Watch",
    "claimed_noise",
    "configure",
    "document",
    "installed",
    "library_versions",
    "measure_one",
    "part",
    "plan_run",
    "read_json",
    "ride",
    "run",
]
