"""The command `sweep`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .completion import complete_toml
from .options import ColumnsOption, FormatOption, JsonOption, parse_figure_output


def sweep_command(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE.toml",
            help="What to vary, see examples/sweeps; with --plot also the folder of a finished sweep.",
            autocompletion=complete_toml,
        ),
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
    plot: Annotated[
        list[str] | None,
        typer.Option(
            metavar="Y:X",
            help="Figure of a quantity over a field with all runs, e.g. position_error_max:motion.rear_rate, or "
            "energy_drift:engines.*.step for each engine's own setting; Z:X,Y is a map of a quantity, or of the share "
            "of a status, e.g. fell:surface.alpha,motion.rear_rate. May be given several times.",
        ),
    ] = None,
    formats: FormatOption = None,
    columns: ColumnsOption = None,
    as_json: JsonOption = False,
) -> None:
    """Many runs over a grid, a list or a Latin hypercube, on local processes or a Dask cluster."""
    from .progress import ProgressBars

    with ProgressBars():
        from .run_sweep import draw_sweep_command, run_sweep_command
    figures = parse_figure_output(formats, columns, None if plot else "--plot")
    if file.is_dir():
        options = {"--scheduler": scheduler, "--workers": workers, "--out": out, "--resume": resume, "--retry": retry}
        draw_sweep_command(file, [name for name, value in options.items() if value], plot or [], figures, as_json)
        return
    status = run_sweep_command(
        file, scheduler, workers, out, resume, as_json, retry or [], plots=plot or [], output=figures
    )
    if status:
        raise typer.Exit(status)
