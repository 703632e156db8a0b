"""Sweeps: a sweep file, its tasks, worker processes or a Dask cluster, and one data set of results."""

from .cluster import on_cluster
from .figure import SweepPlot, check_plots, parse_plots, read_sweep_folder, write_sweep_figures
from .file import SweepFile
from .page import PAGE, write_sweep_page
from .plan import Task, plan_sweep
from .pool import Done
from .rows import BROKEN, COMPUTED, REFUSED, STATUSES
from .run import Work, locally, run_sweep
from .store import RESULTS
from .summary import resume_command, status_of, summarise_sweep

__all__ = [
    "BROKEN",
    "COMPUTED",
    "PAGE",
    "REFUSED",
    "RESULTS",
    "STATUSES",
    "Done",
    "SweepFile",
    "SweepPlot",
    "Task",
    "Work",
    "check_plots",
    "locally",
    "on_cluster",
    "parse_plots",
    "plan_sweep",
    "read_sweep_folder",
    "resume_command",
    "run_sweep",
    "status_of",
    "summarise_sweep",
    "write_sweep_figures",
    "write_sweep_page",
]
