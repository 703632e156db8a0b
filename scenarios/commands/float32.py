"""The command `float32`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .completion import complete_engine, complete_scenario
from .options import (
    BicycleOption,
    ChangesOption,
    ColumnsOption,
    DurationOption,
    FormatOption,
    JsonOption,
    TracebackOption,
    answering_missing_motion,
    ending_with,
    load_bicycle,
    parse_changes,
    parse_figure_output,
    print_json,
    print_traceback,
    show_written,
    showing_traceback,
)


def float32_command(
    scenario: Annotated[
        str, typer.Argument(help="Library name or path to a TOML file.", autocompletion=complete_scenario)
    ],
    engine: Annotated[
        list[str] | None,
        typer.Option(
            help="Ride only these engines: a name, a pattern such as 'mjx*', or all; may be given several times. "
            "Without it all installed engines ride that compute in float32.",
            autocompletion=complete_engine,
        ),
    ] = None,
    change: ChangesOption = None,
    duration: DurationOption = None,
    bicycle: BicycleOption = None,
    starts: Annotated[
        int,
        typer.Option(min=1, max=100, help="Number of rides of each kind, from starts that differ in the last digits."),
    ] = 8,
    out: Annotated[Path | None, typer.Option(help="Folder for the document and its figure.")] = None,
    formats: FormatOption = None,
    columns: ColumnsOption = None,
    traceback: TracebackOption = False,
    as_json: JsonOption = False,
) -> None:
    """What float32 costs: rides in single precision against double precision, and what explains the distance.

    MuJoCo in C rides with its state rounded after every step; its ports that are installed ride in float32.
    """
    from .progress import COMPUTING, ProgressBars
    from .terminal import make_console

    figures = parse_figure_output(formats, columns, None if out is not None else "--out")
    with answering_missing_motion(as_json), showing_traceback(traceback), ProgressBars() as progress:
        from ..files import make_folder
        from ..scenario import load_scenario
        from ..studies import all_rode_float32, study_float32, write_float32
        from .present_float32 import show_float32

        changes = parse_changes(change, duration)
        other = None if bicycle is None else load_bicycle(bicycle).bicycle
        name, loaded = load_scenario(scenario, changes, "--set", other)
        if out is not None:
            make_folder(out)  # first, so that no work is lost if it fails
        progress.say(COMPUTING)
        trace = print_traceback if traceback else None
        document = study_float32(name, loaded, engine, starts, progress.watch, trace)
    written = [] if out is None else write_float32(document, out, figures)
    with ending_with(0 if all_rode_float32(document) else 1):
        if as_json:
            print_json(document)
        else:
            show_float32(make_console(), document)
            show_written(written)
