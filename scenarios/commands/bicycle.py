"""The command `bicycle`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..error import ScenarioError
from .completion import complete_scenario
from .options import (
    ColumnsOption,
    FormatOption,
    JsonOption,
    SteerDampingOption,
    ending_with,
    make_inputs,
    parse_figure_output,
    print_json,
    show_written,
)

_FINEST = 10_000  # speeds of a list
_FASTEST = 1e4  # [m/s]


def bicycle_command(
    source: Annotated[
        str,
        typer.Argument(
            help="benchmark, a bicycle file (BicycleParameters or TOML), or a scenario.",
            autocompletion=complete_scenario,
        ),
    ] = "benchmark",
    speeds: Annotated[
        str, typer.Option(metavar="FROM:TO", help="Range of forward speeds [m/s], or a list such as 1,3,5.")
    ] = "0:10",
    steer_damping: SteerDampingOption = 0.0,
    out: Annotated[
        Path | None, typer.Option(help="Folder for bicycle.json, its page and the figure eigenvalues.")
    ] = None,
    formats: FormatOption = None,
    columns: ColumnsOption = None,
    as_json: JsonOption = False,
) -> None:
    """A bicycle by itself: canonical matrices, eigenvalues over speed, weave and capsize speeds."""
    from .progress import ProgressBars
    from .terminal import make_console

    figures = parse_figure_output(formats, columns, None if out is not None else "--out")
    with ProgressBars() as progress:
        import numpy as np

        from ..scenario import find_bicycle
        from ..studies import study_bicycle, write_bicycle
        from .present_bicycle import show_bicycle

        damping = make_inputs(0.0, 0.0, steer_damping).steer_damping
        progress.say("computing the eigenvalues")
        study = study_bicycle(find_bicycle(source), np.array(parse_speeds(speeds)), damping)
        written = [] if out is None else write_bicycle(study, out, figures)
    with ending_with(0):
        if as_json:
            print_json(study.as_json())
        else:
            show_bicycle(make_console(), study)
            show_written(written)


def parse_speeds(text: str) -> list[float]:
    """Parse a range ``FROM:TO``, which is divided into 200 steps, or a list of rising speeds [m/s].

    Raises
    ------
    ScenarioError
        If it is neither, or a speed is out of range.
    """
    from ..scenario import show_value

    def refuse(what: str) -> ScenarioError:
        return ScenarioError(f"--speeds {show_value(repr(text))}: {what}")

    wrong = refuse("must be a range FROM:TO or rising speeds such as 1,3,5, in m/s from 0")
    separator = ":" if ":" in text else ","
    try:
        numbers = [float(part) for part in text.split(separator)]
    except ValueError:
        raise wrong from None
    if separator == ":" and len(numbers) != 2:
        raise wrong
    if not all(0 <= number <= _FASTEST for number in numbers):
        raise refuse(f"each speed must be from 0 to {_FASTEST:g} m/s")
    if len(numbers) > _FINEST:
        raise refuse(f"must be at most {_FINEST} speeds; they are {len(numbers)}")
    if sorted(set(numbers)) != numbers:
        raise refuse("TO must be above FROM" if separator == ":" else "each speed must be above the one before it")
    if separator == ",":
        return numbers
    start, end = numbers
    return [start + (end - start) * k / 200 for k in range(201)]
