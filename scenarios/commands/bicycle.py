"""The command `bicycle`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..error import ScenarioError
from .completion import complete_scenario
from .options import JsonOption, ending_with, print_json, show_written

_MOST_SPEEDS = 10_000  # in a list of speeds


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
    out: Annotated[Path | None, typer.Option(help="Folder for bicycle.json and the figure eigenvalues.png.")] = None,
    as_json: JsonOption = False,
) -> None:
    """A bicycle by itself: canonical matrices, eigenvalues over speed, weave and capsize speeds."""
    import numpy as np
    from rich.console import Console

    from ..studies import find_bicycle, study_bicycle, write_bicycle
    from .present_bicycle import show_bicycle

    study = study_bicycle(find_bicycle(source), np.array(parse_speeds(speeds)))
    written = [] if out is None else write_bicycle(study, out)
    with ending_with(0):
        if as_json:
            print_json(study.as_json())
        else:
            show_bicycle(Console(), study)
            show_written(written)


def parse_speeds(text: str) -> list[float]:
    """Parse a range ``FROM:TO``, which is divided into 200 steps, or a list of rising speeds [m/s].

    Raises
    ------
    ScenarioError
        If the text is neither, or a speed is negative.
    """
    wrong = ScenarioError(f"--speeds {text!r}: must be a range FROM:TO or rising speeds such as 1,3,5, in m/s from 0")
    separator = ":" if ":" in text else ","
    try:
        numbers = [float(part) for part in text.split(separator)]
    except ValueError:
        raise wrong from None
    if (
        not all(0 <= number <= 1e4 for number in numbers)
        or sorted(set(numbers)) != numbers
        or len(numbers) > _MOST_SPEEDS
    ):
        raise wrong
    if separator == ",":
        return numbers
    if len(numbers) != 2:
        raise wrong
    start, end = numbers
    return [start + (end - start) * k / 200 for k in range(201)]
