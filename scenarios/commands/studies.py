"""The commands `paper` and `precision`."""

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

PaperFormatOption = Annotated[
    list[str] | None,
    typer.Option(
        "--format", help="Format of figures: png, svg or pdf; may be given several times; svg and png if not given."
    ),
]


def paper_command(
    out: Annotated[Path | None, typer.Option(help="Folder for the figures, tables and ledger.")] = None,
    formats: PaperFormatOption = None,
    columns: ColumnsOption = None,
    whole: Annotated[bool, typer.Option("--all", help="Print every claim, not only those that matter.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Every figure and printed number of Xiong et al. (2020), computed and held against the print.

    The exit status is 0 if every claim holds but those that are known not to, by the paper's own fault.
    """
    from .progress import ProgressBars
    from .terminal import make_console

    figures = parse_figure_output(formats, columns, None if out is not None else "--out", ("svg", "png"))
    with ProgressBars() as progress:
        from ..files import make_folder
        from ..paper import known_discrepancies, ledger_document, make_ledger, write_paper
        from .present_paper import show_ledger

        if out is not None:
            make_folder(out)  # first, so that half a minute of work is not lost if it fails
        lines = make_ledger(lambda part, done, parts: progress.watch(part, done, parts, "parts of the paper"))
        written = []
        if out is not None:
            written = write_paper(
                out, lines, lambda name, done, total: progress.watch(name, done, total, "figures"), figures
            )
    found = ledger_document(lines, known_discrepancies())
    with ending_with(1 if found["surprises"] else 0):
        if as_json:
            print_json(found)
        else:
            show_ledger(make_console(), lines, found["surprises"], whole)
            show_written(written)


def precision_command(
    scenario: Annotated[
        str, typer.Argument(help="Library name or path to a TOML file.", autocompletion=complete_scenario)
    ],
    engine: Annotated[
        list[str] | None,
        typer.Option(
            help="Study only these engines, beside the reference: a name, a pattern, or all; may be given several "
            "times.",
            autocompletion=complete_engine,
        ),
    ] = None,
    change: ChangesOption = None,
    duration: DurationOption = None,
    bicycle: BicycleOption = None,
    levels: Annotated[
        int,
        typer.Option(
            min=2, max=12, help="Number of step sizes: four times the scenario's step, then halved each time."
        ),
    ] = 5,
    eigenvalues: Annotated[bool, typer.Option(help="Measure each engine's own eigenvalues too.")] = True,
    out: Annotated[Path | None, typer.Option(help="Folder for the document, its page and its figure.")] = None,
    formats: FormatOption = None,
    columns: ColumnsOption = None,
    traceback: TracebackOption = False,
    as_json: JsonOption = False,
) -> None:
    """Work-precision: error and CPU time over step sizes, observed order, limit, the engine's own eigenvalues."""
    from .progress import COMPUTING, ProgressBars
    from .terminal import make_console

    figures = parse_figure_output(formats, columns, None if out is not None else "--out")
    with answering_missing_motion(as_json), showing_traceback(traceback), ProgressBars() as progress:
        from ..files import make_folder
        from ..scenario import load_scenario
        from ..studies import all_ran, study_precision, write_precision
        from .present_precision import show_precision

        changes = parse_changes(change, duration)
        other = None if bicycle is None else load_bicycle(bicycle).bicycle
        name, loaded = load_scenario(scenario, changes, "--set", other)
        if out is not None:
            make_folder(out)  # first, so that no work is lost if it fails
        progress.say(COMPUTING)
        trace = print_traceback if traceback else None
        document = study_precision(name, loaded, engine, levels, eigenvalues, progress.watch, trace)
    written = [] if out is None else write_precision(document, out, figures)
    with ending_with(0 if all_ran(document) else 1):
        if as_json:
            print_json(document)
        else:
            show_precision(make_console(), document)
            show_written(written)
