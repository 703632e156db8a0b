"""The command `league`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .completion import complete_engine, complete_scenario, complete_toml
from .options import (
    ChangesOption,
    DurationOption,
    JsonOption,
    TracebackOption,
    answering_missing_motion,
    ending_with,
    parse_changes,
    print_json,
    print_traceback,
    show_written,
    showing_traceback,
)


def league_command(
    scenario: Annotated[
        list[str] | None,
        typer.Argument(
            help="Library names or paths to TOML files. Without any: a circle on the plane, an upright manoeuvre, a "
            "disturbed stable circle in a bowl and an unstable one.",
            autocompletion=complete_scenario,
        ),
    ] = None,
    engine: Annotated[
        list[str] | None,
        typer.Option(
            help="Ride only these engines, beside the reference: a name, a pattern such as 'mujoco-*', or all; may be "
            "given several times. Without it all installed engines ride, those of extras and other packages too.",
            autocompletion=complete_engine,
        ),
    ] = None,
    settings: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.toml",
            help="Settings that replace engines' defaults: tables [engines.NAME], each with an optional source, one "
            "line that says whose choice they are.",
            autocompletion=complete_toml,
        ),
    ] = None,
    change: ChangesOption = None,
    duration: DurationOption = None,
    levels: Annotated[
        int, typer.Option(min=1, max=8, help="Number of step sizes: that of the settings, then halved each time.")
    ] = 3,
    out: Annotated[
        Path, typer.Option(help="Folder for the document, which is written after every ride, and the page.")
    ] = Path("league"),
    traceback: TracebackOption = False,
    as_json: JsonOption = False,
) -> None:
    """All installed engines side by side: errors, drift, order, creep, falls, repeatability and cost, with a page.

    An engine rides all scenarios with the same settings: its defaults, or those of --settings.
    """
    from .progress import COMPUTING, ProgressBars
    from .terminal import make_console

    with answering_missing_motion(as_json), showing_traceback(traceback), ProgressBars() as progress:
        from ..scenario import load_scenario
        from ..studies import LEAGUE_SCENARIOS, LeagueFolder, all_rode, plan_league, read_league_settings, run_league
        from .present_league import show_league

        changes = parse_changes(change, duration)
        chosen = None if settings is None else read_league_settings(settings)
        sources = dict.fromkeys(scenario or LEAGUE_SCENARIOS)
        progress.say(COMPUTING)
        loaded = [load_scenario(source, changes, "--set") for source in sources]
        league = plan_league(loaded, engine, chosen, levels)
        folder = LeagueFolder(out)  # before the rides, so that no work is lost if it cannot be made
        document = run_league(league, progress.watch, folder.store, print_traceback if traceback else None)
    written = folder.finish(document)
    with ending_with(0 if all_rode(document) else 1 if document["complete"] else 130):
        if as_json:
            print_json(document)
        else:
            show_league(make_console(), document)
            show_written(written)
