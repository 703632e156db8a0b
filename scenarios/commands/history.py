"""The command `history`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .completion import complete_engine, complete_scenario
from .options import (
    HISTORIES,
    LONGEST_RIDE,
    CacheOption,
    JsonOption,
    TracebackOption,
    answering_missing_motion,
    count_cores,
    ending_with,
    print_json,
    show_written,
    showing_traceback,
)


def history_command(
    releases: Annotated[
        str,
        typer.Argument(
            metavar="'PACKAGE==V1,V2,...' or 'PACKAGE>=A,<B'",
            help="The package of an engine with its releases: a list of versions, or a range; with --wheel the package "
            "alone is enough.",
        ),
    ],
    scenario: Annotated[
        list[str] | None,
        typer.Argument(
            help="Library names or paths to TOML files. Without any: a circle on the plane, and a disturbed stable "
            "circle in a bowl.",
            autocompletion=complete_scenario,
        ),
    ] = None,
    engine: Annotated[
        list[str] | None,
        typer.Option(
            help="Ride only these engines of the package: a name, a pattern such as 'mujoco-*', or all; may be given "
            "several times. Without it all of them ride.",
            autocompletion=complete_engine,
        ),
    ] = None,
    wheel: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FILE.whl",
            help="A build of your own as one release among the others, after that of its version; may be given several "
            "times. A wheel of another package belongs to the release of the wheels that require it.",
        ),
    ] = None,
    bisect: Annotated[
        bool,
        typer.Option(
            "--bisect",
            help="Ride the first and the last release and only those between that are needed to find which one "
            "moved something.",
        ),
    ] = False,
    out: Annotated[Path | None, typer.Option(help="The history's folder; history/PACKAGE if not given.")] = None,
    resume: Annotated[
        bool,
        typer.Option(
            "--resume",
            help="Go on with what the folder has: ride what is missing, and again what a limit or a signal ended. "
            "Releases, engines and scenarios may be added.",
        ),
    ] = False,
    cache: CacheOption = None,
    workers: Annotated[
        int | None, typer.Option(min=1, max=64, help="Number of releases that ride at once; two if not given.")
    ] = None,
    time_limit: Annotated[
        float,
        typer.Option(min=1.0, help="Time after which a ride with its measurements counts as hung [s]; inf for none."),
    ] = LONGEST_RIDE,
    traceback: TracebackOption = False,
    as_json: JsonOption = False,
) -> None:
    """The same rides in every release of an engine's package: which release changed what.

    Every release is installed with pip into a folder of its own, which is laid over the suite's environment for a
    process that rides it. The suite's own environment does not change.
    """
    from .progress import COMPUTING, ProgressBars
    from .terminal import make_console

    with answering_missing_motion(as_json), showing_traceback(traceback), ProgressBars() as progress:
        from ..history import Children, HistoryFolder, HistoryOptions, find_cache_folder, plan_history, run_history
        from .present_history import HistoryCounter, resume_history_command, show_history

        environments = find_cache_folder(cache)
        children = Children()
        progress.say(COMPUTING)
        plan = plan_history(releases, scenario or (), engine or (), wheel or (), cache=environments, children=children)
        where = HISTORIES / plan.package if out is None else out
        folder = HistoryFolder(where, resume)
        options = HistoryOptions(environments, workers or min(2, count_cores()), time_limit, bisect)
        for line in plan.remarks:
            progress.note(line)
        counter = HistoryCounter(progress, plan, bisect)
        document, written = run_history(plan, folder, options, counter.watch, children)
    rode = any(row["status"] == "rode" for row in document["releases"])
    with ending_with(130 if not document["complete"] else 0 if rode else 1):
        if as_json:
            print_json(document)
        else:
            console = make_console()
            show_history(console, document)
            show_written(written)
            if not document["complete"]:
                console.print(
                    f"interrupted; continue with: {resume_history_command(where)}", markup=False, soft_wrap=True
                )
