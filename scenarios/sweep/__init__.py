"""Sweeps: a sweep file, its tasks, worker processes or a Dask cluster, and one data set of results."""

from .cluster import on_cluster
from .file import SweepFile
from .live import ROW_STYLES, SweepView
from .page import PAGE, write_sweep_page
from .plan import plan_sweep
from .rows import STATUSES
from .run import Work, locally, run_sweep
from .store import RESULTS
from .summary import resume_command, status_of, summarise_sweep

__all__ = [
    "PAGE",
    "RESULTS",
    "ROW_STYLES",
    "STATUSES",
    "SweepFile",
    "SweepView",
    "Work",
    "locally",
    "on_cluster",
    "plan_sweep",
    "resume_command",
    "run_sweep",
    "status_of",
    "summarise_sweep",
    "write_sweep_page",
]
