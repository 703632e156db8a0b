"""Sweeps: a sweep file, its tasks, worker processes or a Dask cluster, and one data set of results.

Names are imported when they are first used: a worker needs a third of what the command does.
"""

from typing import TYPE_CHECKING

from ...engines.lazy import import_when_used as _import_when_used

if TYPE_CHECKING:
    from .cluster import on_cluster as on_cluster
    from .figure import SweepPlot as SweepPlot
    from .figure import check_plots as check_plots
    from .figure import parse_plots as parse_plots
    from .figure import read_sweep_folder as read_sweep_folder
    from .figure import write_sweep_figures as write_sweep_figures
    from .file import SweepFile as SweepFile
    from .page import PAGE as PAGE
    from .page import write_sweep_page as write_sweep_page
    from .plan import Task as Task
    from .plan import plan_sweep as plan_sweep
    from .pool import Done as Done
    from .rows import BROKEN as BROKEN
    from .rows import COMPUTED as COMPUTED
    from .rows import REFUSED as REFUSED
    from .rows import STATUSES as STATUSES
    from .run import Work as Work
    from .run import locally as locally
    from .run import run_sweep as run_sweep
    from .store import RESULTS as RESULTS
    from .summary import resume_command as resume_command
    from .summary import status_of as status_of
    from .summary import summarise_sweep as summarise_sweep

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

if not TYPE_CHECKING:  # with __getattr__, type checkers would accept any name
    __getattr__ = _import_when_used(
        __name__,
        {
            ".cluster": ("on_cluster",),
            ".figure": ("SweepPlot", "check_plots", "parse_plots", "read_sweep_folder", "write_sweep_figures"),
            ".file": ("SweepFile",),
            ".page": ("PAGE", "write_sweep_page"),
            ".plan": ("Task", "plan_sweep"),
            ".pool": ("Done",),
            ".rows": ("BROKEN", "COMPUTED", "REFUSED", "STATUSES"),
            ".run": ("Work", "locally", "run_sweep"),
            ".store": ("RESULTS",),
            ".summary": ("resume_command", "status_of", "summarise_sweep"),
        },
    )
