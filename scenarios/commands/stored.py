"""The commands about stored runs: `diff` and `view`."""

from __future__ import annotations

import sys
from pathlib import Path
from shlex import quote
from tempfile import TemporaryDirectory
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
    run_folder: Annotated[Path, typer.Argument(metavar="RUN", help="A run folder.", autocompletion=complete_folder)],
    later: Annotated[
        Path | None,
        typer.Argument(metavar="[RUN]", help="A later run of the same scenario.", autocompletion=complete_folder),
    ] = None,
    web: Annotated[bool, typer.Option("--web", help="Serve the report page with the viewer in it.")] = False,
    port: Annotated[
        int | None, typer.Option(min=0, max=65535, help="Port for --web; any free one if not given.")
    ] = None,
) -> None:
    """A run's recording in the native viewer, or its report page in the browser, for this machine only.

    Of two runs the viewer shows both rides of every engine, and a ride that is the same to the bit once. A recording
    that a run did not write is made.
    """
    from ..view import open_native, serve

    if port is not None and not web:
        raise ScenarioError("--port goes with --web")
    if later is not None:
        _view_pair(run_folder, later, web, port or 0)
    elif web:
        serve(run_folder, port or 0, _print_address)
    else:
        open_native(run_folder)


def _view_pair(before: Path, after: Path, web: bool, port: int) -> None:
    from ..compare import diff_runs, read_pair, record_pair
    from ..view import open_recording, serve_recording

    pair = read_pair(before, after)
    with TemporaryDirectory(prefix="velodrome-") as folder:
        recording = Path(folder) / "diff.rrd"
        left_out = record_pair(recording, pair, diff_runs(pair))
        if left_out is not None:
            print(left_out, file=sys.stderr)
        if web:
            serve_recording(recording, port, _print_address)
        else:
            paths = " ".join(quote(str(path)) for path in (before, after))
            open_recording(recording, f"run: velodrome view --web {paths}")


def _print_address(address: str) -> None:
    print(f"{address}\nCtrl-C ends it", flush=True)
