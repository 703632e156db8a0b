"""The commands about stored runs: `diff` and `view`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..error import ScenarioError
from .completion import complete_engine, complete_folder
from .options import JsonOption, ending_with, print_json, show_written


def diff_command(
    before: Annotated[
        Path, typer.Argument(metavar="RUN", help="The earlier run's folder.", autocompletion=complete_folder)
    ],
    after: Annotated[
        Path, typer.Argument(metavar="RUN", help="The later run's folder.", autocompletion=complete_folder)
    ],
    engine: Annotated[
        list[str] | None,
        typer.Option(
            help="Compare only this engine, beside the reference; may be given several times.",
            autocompletion=complete_engine,
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for diff.json, diff.md, the page diff.html and the recording diff.rrd.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Two stored runs of one scenario against each other: what moved by more than round-off."""
    from .progress import ProgressBars
    from .terminal import make_console

    with ProgressBars() as progress:
        from ..compare import diff_runs, read_pair, write_diff
        from ..run import installed_engines
        from .present_diff import show_diff

        installed_engines()  # raises here if two packages announce one engine, which is not a fault of the runs
        progress.say("comparing the runs")
        pair = read_pair(before, after, engine)
        found = diff_runs(pair)
        written = [] if out is None else write_diff(pair, found, out)
    with ending_with(0 if found["same"] else 1):
        if as_json:
            print_json(found)
        else:
            show_diff(make_console(), found)
            show_written(written)


def view_command(
    run_folder: Annotated[
        Path,
        typer.Argument(
            metavar="RUN", help="A run folder, or what diff --out has written.", autocompletion=complete_folder
        ),
    ],
    web: Annotated[bool, typer.Option("--web", help="Serve the report page with the viewer in it.")] = False,
    port: Annotated[
        int | None, typer.Option(min=0, max=65535, help="Port for --web; any free one if not given.")
    ] = None,
) -> None:
    """A run's recording in the native viewer, or its report page in the browser, for this machine only."""
    from ..view import open_native, serve

    if web:
        serve(run_folder, port or 0, lambda address: print(f"{address}\nCtrl-C ends it", flush=True))
    elif port is not None:
        raise ScenarioError("--port goes with --web")
    else:
        open_native(run_folder)
