"""The command `show`."""

from __future__ import annotations

from typing import Annotated

import typer

from .completion import complete_shown
from .options import JsonOption, ending_with, print_json


def show_command(
    name: Annotated[
        str,
        typer.Argument(
            help="A scenario or its file, an engine, or bicycle; scenario or sweep for what their files may hold.",
            autocompletion=complete_shown,
        ),
    ],
    as_json: JsonOption = False,
    schema: Annotated[
        bool, typer.Option("--schema", help="The JSON schema that editors use: of scenarios, sweeps, settings.")
    ] = False,
) -> None:
    """A scenario as resolved, an engine's settings, the bicycle's parameters, or what a file may hold."""
    from .progress import ProgressBars
    from .terminal import make_console

    with ProgressBars():
        from ..show import kind_of, make_document, make_schema
        from ..sweep import SweepFile
        from .present_show import show_document

        document = make_schema(kind_of(name), name, SweepFile) if schema else make_document(name, SweepFile)
    with ending_with(0):
        if as_json or schema:
            print_json(document)
        else:
            show_document(make_console(), document)
