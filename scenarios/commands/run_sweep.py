"""Run a sweep with the options of `velodrome sweep`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from ...engines.names import suggest_name
from ..error import ScenarioError
from ..scenario import show_value
from ..sweep import (
    STATUSES,
    Work,
    locally,
    plan_sweep,
    resume_command,
    run_sweep,
    status_of,
    summarise_sweep,
    write_sweep_page,
)
from .options import ending_with, print_json
from .present_sweep import SweepCounter, show_summary
from .progress import ProgressBars
from .terminal import make_console

FOLDER = Path("sweeps")


def run_sweep_command(
    path: Path,
    scheduler: str | None,
    workers: int | None,
    out: Path | None,
    resume: bool,
    as_json: bool,
    retry: Sequence[str] = (),
) -> int:
    """Run a sweep file, or its missing runs, and print a summary.

    Parameters
    ----------
    path : Path
        The sweep file.
    scheduler : str or None
        Address of a Dask scheduler; if None, processes of this machine are used.
    workers : int or None
        Number of processes; one per core if None.
    out : Path or None
        The sweep's folder; if None, a folder in `FOLDER` with the name of the file.
    resume : bool
        Whether to continue a sweep in that folder.
    as_json : bool
        Whether to print the summary as JSON on stdout and the table on stderr.
    retry : sequence of str
        Statuses of rows that are run again; requires ``resume``.

    Returns
    -------
    int
        Exit status: 0 if every run has a result, 1 if some failed or are missing, 130 after Ctrl-C.

    Raises
    ------
    ScenarioError
        If the options contradict each other, or the sweep cannot be run. The message is one line.
    """
    if scheduler is not None and workers is not None:
        raise ScenarioError("--workers goes without --scheduler: a cluster's workers are started with it")
    if retry and not resume:
        raise ScenarioError("--retry: it belongs to --resume, which goes on with a sweep")
    for status in retry:
        if status not in STATUSES:
            raise ScenarioError(
                f"--retry {show_value(status)}: no row has such a status ({suggest_name(status, STATUSES)})"
            )
    with ProgressBars("checking every run of the sweep") as progress:
        plan = plan_sweep(path)
        work = _choose_work(scheduler, workers)
        counter = SweepCounter(progress, plan.name, len(plan.tasks))
        outcome = run_sweep(plan, FOLDER / plan.name if out is None else out, work, resume, counter.watch, retry)
    document = summarise_sweep(plan, outcome)
    if document["complete"]:
        write_sweep_page(plan, outcome, document)
    with ending_with(0):
        show_summary(make_console(stderr=as_json), document, resume_command(plan, outcome, retry))
        if as_json:
            print_json(document)
    return status_of(outcome)


def _choose_work(scheduler: str | None, workers: int | None) -> Work:
    if scheduler is None:
        return locally(workers or len(os.sched_getaffinity(0)))
    # Imported here, since loading Dask takes half a second.
    from ..sweep import on_cluster

    return on_cluster(scheduler)
