"""The command `basin`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..error import ScenarioError
from .completion import complete_scenario
from .options import (
    BicycleOption,
    ChangesOption,
    ColumnsOption,
    FormatOption,
    JsonOption,
    answering_missing_motion,
    count_cores,
    ending_with,
    load_bicycle,
    parse_changes,
    parse_figure_output,
    print_json,
    show_written,
)

_MOST_RIDES = 1_000_000


def basin_command(
    scenario: Annotated[
        str, typer.Argument(help="Library name or path to a TOML file.", autocompletion=complete_scenario)
    ],
    along: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KEY",
            help="Search for the edge along this disturbance, both ways; may be given several times. If not given, "
            "along the scenario's perturbation, or along lean_rate, steer_rate and lean.",
        ),
    ] = None,
    over: Annotated[
        str | None, typer.Option("--map", metavar="KEY,KEY", help="Map the outcomes over two disturbances.")
    ] = None,
    rides: Annotated[int, typer.Option(min=4, max=_MOST_RIDES, help="Rides of the map, roughly.")] = 2500,
    sample: Annotated[
        int, typer.Option(min=0, max=_MOST_RIDES, help="Disturbances to draw at random, for the share survived.")
    ] = 0,
    reach: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KEY=VALUE",
            help="Largest disturbance of the map, and of those drawn; may be given several times. If not given, the "
            "map reaches beyond the edges, and lean_rate, steer_rate and rear_rate are drawn up to 0.3 rad/s.",
        ),
    ] = None,
    fixed_energy: Annotated[
        bool, typer.Option("--fixed-energy", help="Solve for the rear rate so that disturbances keep the energy.")
    ] = False,
    follow: Annotated[bool, typer.Option(help="Follow the edges to what they lead to.")] = True,
    change: ChangesOption = None,
    bicycle: BicycleOption = None,
    out: Annotated[Path | None, typer.Option(help="Folder for basin.json and the figures edges and map.")] = None,
    formats: FormatOption = None,
    columns: ColumnsOption = None,
    as_json: JsonOption = False,
) -> None:
    """Which disturbances a stable circle survives: edges of its basin, maps, the share of a set that is survived."""
    from .progress import COMPUTING, ProgressBars
    from .terminal import make_console

    figures = parse_figure_output(formats, columns, None if out is not None else "--out")
    with answering_missing_motion(as_json), ProgressBars() as progress:
        from ..files import make_folder
        from ..motions import BasinRequest, find_basin, write_basin
        from ..scenario import load_scenario
        from .present_basin import show_basin

        request = BasinRequest(
            along=tuple(_check_key("--along", key) for key in along or ()),
            map=_parse_map(over),
            rides=rides,
            sample=sample,
            reach=_parse_reach(reach),
            fixed_energy=fixed_energy,
            follow=follow,
        )
        other = None if bicycle is None else load_bicycle(bicycle)
        name, loaded = load_scenario(
            scenario, parse_changes(change, None), "--set", None if other is None else other.bicycle
        )
        if out is not None:
            make_folder(out)  # first, so that no work is lost if it fails
        progress.say(COMPUTING)
        found = find_basin(name, loaded, request, count_cores(), progress.watch)
        document = found.as_json(None if other is None else other.name)
    written = [] if out is None else write_basin(document, out, figures)
    with ending_with(0):
        if as_json:
            print_json(document)
        else:
            show_basin(make_console(), document)
            show_written(written)


def _check_key(option: str, key: str) -> str:
    from ...reference.stability import VARIABLES

    if key not in VARIABLES:
        from ...engines.names import suggest_name
        from ..scenario import show_value

        raise ScenarioError(f"{option} {show_value(key)}: no such disturbance ({suggest_name(key, VARIABLES)})")
    return key


def _parse_map(text: str | None) -> tuple[str, str] | None:
    """Return the two disturbances that --map names."""
    if text is None:
        return None
    names = text.split(",")
    if len(names) != 2 or names[0] == names[1]:
        from ..scenario import show_value

        raise ScenarioError(f"--map {show_value(text)}: must be two disturbances KEY,KEY, e.g. lean_rate,steer_rate")
    return _check_key("--map", names[0]), _check_key("--map", names[1])


def _parse_reach(texts: list[str] | None) -> dict[str, float] | None:
    """Return the largest disturbances that --reach gives."""
    found = {}
    for text in texts or ():
        key, _, value = text.partition("=")
        try:
            size = float(value)
        except ValueError:
            size = 0.0
        if not 0 < size <= 1e6:
            from ..scenario import show_value

            raise ScenarioError(f"--reach {show_value(text)}: must be KEY=VALUE, a positive number, e.g. lean_rate=0.3")
        found[_check_key("--reach", key)] = size
    return found or None
