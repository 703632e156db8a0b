"""Run a sweep with the options of `velodrome sweep`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ...engines.names import suggest_name
from ..error import ScenarioError
from ..files import DEFAULT_FIGURES, FigureOutput
from ..scenario import show_value
from ..sweep import (
    STATUSES,
    Work,
    check_plots,
    locally,
    parse_plots,
    plan_sweep,
    read_sweep_folder,
    resume_command,
    run_sweep,
    status_of,
    summarise_sweep,
    write_sweep_figures,
    write_sweep_page,
)
from .options import count_cores, ending_with, print_json, show_written
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
    *,
    plots: Sequence[str] = (),
    output: FigureOutput = DEFAULT_FIGURES,
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
    plots : sequence of str
        Figures to draw of the data set, as ``Y:X``.
    output : FigureOutput
        How the figures are written.

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
    wanted = parse_plots(plots)
    with ProgressBars("checking the sweep") as progress:
        plan = plan_sweep(path)
        check_plots(wanted, plan)
        work = _choose_work(scheduler, workers)
        counter = SweepCounter(progress, plan.name, plan.tasks)
        folder = FOLDER / plan.name if out is None else out
        outcome = run_sweep(plan, folder, work, resume, counter.watch, retry, counter.recall)
    document = summarise_sweep(plan, outcome)
    if document["complete"]:
        write_sweep_page(plan, outcome, document)
    figures, fault = [], None
    if outcome.stopped is None:
        try:
            figures = write_sweep_figures(outcome.folder, wanted, output)
        except ScenarioError as error:  # no row has a value: said after the summary of what was ridden
            fault = error
    document["figures"] = [str(figure) for figure in figures]
    with ending_with(0):
        show_summary(make_console(stderr=as_json), document, resume_command(plan, outcome, retry))
        if as_json:
            print_json(document)
        else:
            show_written(figures)
    if fault is not None:
        raise fault
    return status_of(outcome)


def draw_sweep_command(
    folder: Path, refused: Sequence[str], plots: Sequence[str], output: FigureOutput, as_json: bool
) -> None:
    """Draw figures of a finished sweep from its folder, without running anything.

    Parameters
    ----------
    folder : Path
    refused : sequence of str
        Options that were given and belong to a run.
    plots : sequence of str
        Figures to draw, as ``Y:X``.
    output : FigureOutput
        How the figures are written.
    as_json : bool
        Whether to print a JSON document instead of the paths.

    Raises
    ------
    ScenarioError
        If there is nothing to draw, an option does not belong here, or the folder is not of a finished sweep.
    """
    if refused:
        raise ScenarioError(
            f"{refused[0]}: it belongs to a sweep file; {folder} is a folder, of which figures are drawn"
        )
    if not plots:
        raise ScenarioError(f"{folder}: is a folder; name a sweep file, or the figures to draw by --plot Y:X")
    manifest, wanted = read_sweep_folder(folder), parse_plots(plots)
    with ProgressBars("drawing the figures"):
        figures = write_sweep_figures(folder, wanted, output)
    document = {
        "sweep": folder.resolve().name,
        "title": manifest.get("title", ""),
        "folder": str(folder),
        "tasks": manifest["tasks"],
        "missing": 0,
        "complete": True,
        "stopped": None,
        "engines": {},
        "figures": [str(figure) for figure in figures],
    }
    with ending_with(0):
        if as_json:
            print_json(document)
        else:
            show_written(figures)


def _choose_work(scheduler: str | None, workers: int | None) -> Work:
    if scheduler is None:
        return locally(workers or count_cores())
    # Imported here, since loading Dask takes half a second.
    from ..sweep import on_cluster

    return on_cluster(scheduler)
