"""The command `sweep`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .completion import complete_toml
from .options import JsonOption


def sweep_command(
    file: Annotated[
        Path,
        typer.Argument(metavar="FILE.toml", help="What to vary; see examples/sweeps.", autocompletion=complete_toml),
    ],
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="A Dask scheduler instead of processes of this machine.")
    ] = None,
    workers: Annotated[
        int | None, typer.Option(min=1, max=1024, help="Number of processes; one a core if not given.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="The sweep's folder; sweeps/NAME if not given.")] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with what the folder has: do what is missing.")
    ] = False,
    retry: Annotated[
        list[str] | None,
        typer.Option(
            metavar="STATUS",
            help="With --resume: do rows of this status again, such as timeout or failed; may be given several times.",
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Many runs over a grid, a list or a Latin hypercube, on local processes or a Dask cluster."""
    from .progress import ProgressBars

    with ProgressBars():
        from .run_sweep import run_sweep_command
    status = run_sweep_command(file, scheduler, workers, out, resume, as_json, retry or [])
    if status:
        raise typer.Exit(status)
