"""Sweeps: a sweep file, its tasks, worker processes or a Dask cluster, and one data set of results."""

from .cluster import on_cluster
from .file import SweepFile
from .live import SweepView
from .plan import plan_sweep
from .rows import STATUSES
from .run import Work, locally, run_sweep
from .summary import resume_command, show_summary, status_of, summarise_sweep

__all__ = [
    "STATUSES",
    "SweepFile",
    "SweepView",
    "Work",
    "locally",
    "on_cluster",
    "plan_sweep",
    "resume_command",
    "run_sweep",
    "show_summary",
    "status_of",
    "summarise_sweep",
]
