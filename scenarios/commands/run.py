"""The commands `list` and `run`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..error import MissingMotionError, ScenarioError
from .completion import complete_engine, complete_scenario
from .options import (
    STARTING,
    BicycleOption,
    ChangesOption,
    DurationOption,
    JsonOption,
    TracebackOption,
    answering_missing_motion,
    ending_with,
    load_bicycle,
    parse_changes,
    print_json,
    print_traceback,
    showing_traceback,
)

if TYPE_CHECKING:
    from ...reference.bicycle import Bicycle
    from ..run import RunOutcome, RunPlan


def list_command(as_json: JsonOption = False) -> None:
    """Scenarios of the library, and engines with the commands that install those that are not there."""
    from ...engines.engine import describe_engine
    from ...engines.registry import load_engine, uninstalled_engines
    from ...engines.releases import find_reach
    from ..run import installed_engines
    from ..scenario import library_names, load_scenario

    scenarios = []
    for name in library_names():
        _, scenario = load_scenario(name)
        scenarios.append({"name": name, "title": scenario.title, "tags": list(scenario.tags)})
    engines: list[dict[str, Any]] = []
    for name in installed_engines():
        try:
            engine = load_engine(name)
            given = {"gives": list(engine.gives), "takes_inputs": engine.takes_inputs}
            described = {"version": engine.version, "description": describe_engine(engine)}
            reach = find_reach(engine)
            refusal = None if reach is None else reach.find_refusal(name)
            engines.append({"name": name, **described, **given, **({} if refusal is None else {"error": refusal})})
        except ValueError as error:
            engines.append({"name": name, "version": None, "gives": [], "error": " ".join(str(error).split())})
    engines += [
        {"name": name, "version": None, "gives": [], "install": command}
        for name, command in uninstalled_engines().items()
    ]
    with ending_with(0):
        if as_json:
            print_json({"scenarios": scenarios, "engines": engines})
        else:
            _show_list(scenarios, engines)


def _show_list(scenarios: list[dict[str, Any]], engines: list[dict[str, Any]]) -> None:
    from rich.table import Table
    from rich.text import Text

    from .terminal import make_console

    console = make_console()
    table = Table(box=None, pad_edge=False)
    for title in ("scenario", "title", "tags"):
        table.add_column(title, no_wrap=title == "scenario")
    for entry in scenarios:
        table.add_row(entry["name"], entry["title"], ", ".join(entry["tags"]))
    console.print(table)
    console.print()
    table = Table(box=None, pad_edge=False)
    for title in ("engine", "version", "what it is"):
        table.add_column(title, no_wrap=title == "engine")
    for entry in engines:
        if "error" in entry:
            words = Text(entry["error"], "red")
        elif "install" in entry:
            words = Text(f"not installed: {entry['install']}", "dim")
        else:
            words = Text(entry["description"])
        table.add_row(entry["name"], entry["version"] or "–", words)
    console.print(table)


def run_command(
    scenario: Annotated[
        list[str] | None, typer.Argument(help="Library names or paths to TOML files.", autocompletion=complete_scenario)
    ] = None,
    engine: Annotated[
        list[str] | None,
        typer.Option(
            help="Run only these engines, beside the reference: a name, a pattern such as 'mujoco-*', or all; may be "
            "given several times. Without it those of the suite's own dependencies run.",
            autocompletion=complete_engine,
        ),
    ] = None,
    tag: Annotated[str | None, typer.Option(help="Run all library scenarios with this tag.")] = None,
    change: ChangesOption = None,
    duration: DurationOption = None,
    bicycle: BicycleOption = None,
    out: Annotated[Path, typer.Option(help="Folder for the run folders.")] = Path("runs"),
    record_rate: Annotated[
        float | None,
        typer.Option(
            metavar="HZ",
            help="Largest number of samples a second in the recording. Without it rides of more than 2500 samples are "
            "thinned. Trajectories and metrics always have all samples.",
        ),
    ] = None,
    no_recording: Annotated[
        bool, typer.Option("--no-recording", help="Write no recording; velodrome view makes it when it is asked for.")
    ] = False,
    traceback: TracebackOption = False,
    as_json: JsonOption = False,
) -> None:
    """Run scenarios in every engine from the same computed start and compare with the reference.

    --bicycle replaces a scenario's bicycle; --set bicycle.KEY=VALUE then changes single parameters of it.
    """
    from ..run import installed_engines, run_plan
    from .present_run import outcome_json, show_outcome
    from .progress import ProgressBars, show_working
    from .terminal import make_console

    sources = [*(scenario or []), *(_find_tagged(tag) if tag is not None else [])]
    if not sources:
        raise ScenarioError("nothing to run: name a scenario, or a tag with --tag; velodrome list shows them")
    if record_rate is not None and not 0 < record_rate < math.inf:
        raise ScenarioError(f"--record-rate is {record_rate:g}; it must be a positive number of samples a second [Hz]")
    if record_rate is not None and no_recording:
        raise ScenarioError("--record-rate and --no-recording exclude one another: leave one out")
    changes = parse_changes(change, duration)
    installed_engines()  # raises here if two packages announce one engine, which is not a fault of a scenario
    other = None if bicycle is None else load_bicycle(bicycle).bicycle
    with answering_missing_motion(as_json), showing_traceback(traceback), show_working(STARTING):
        plans = [_plan_source(source, changes, engine, other) for source in dict.fromkeys(sources)]
    console = make_console(stderr=as_json)
    outcomes = []
    for plan in plans:
        with ProgressBars() as progress:
            outcome = run_plan(
                plan,
                out,
                progress.watch,
                progress.note,
                print_traceback if traceback else None,
                recording=not no_recording,
                record_rate=record_rate,
            )
        outcomes.append((plan, outcome))
        with ending_with(0):  # the next run goes on if the reader of this table has closed the pipe
            show_outcome(console, plan, outcome)
        if outcome.interrupted:
            break
    with ending_with(_exit_status([outcome for _, outcome in outcomes])):
        if as_json:
            print_json({"runs": [outcome_json(plan, outcome) for plan, outcome in outcomes]})


def _exit_status(outcomes: Sequence[RunOutcome]) -> int:
    """Return the exit status: 130 after Ctrl-C, 1 if an engine did not run or a verdict does not hold, else 0."""
    if any(outcome.interrupted for outcome in outcomes):
        return 130
    holds = (not outcome.failures and all(verdict["holds"] for verdict in outcome.verdicts) for outcome in outcomes)
    return 0 if all(holds) else 1


def _plan_source(source: str, changes: dict[str, Any], wanted: list[str] | None, bicycle: Bicycle | None) -> RunPlan:
    from ..run import plan_run
    from ..scenario import load_scenario

    name, scenario = load_scenario(source, changes, "--set", bicycle)
    try:
        return plan_run(name, scenario, wanted)
    except MissingMotionError as error:
        raise MissingMotionError(f"{source}: {error}", error.reason) from error
    except ScenarioError as error:
        raise ScenarioError(f"{source}: {error}") from error


def _find_tagged(tag: str) -> list[str]:
    from ...engines.names import suggest_name
    from ..scenario import library_names, load_scenario

    tags = {name: load_scenario(name)[1].tags for name in library_names()}
    names = [name for name in tags if tag in tags[name]]
    if not names:
        known = sorted({word for words in tags.values() for word in words})
        raise ScenarioError(f"--tag {tag}: no scenario has it ({suggest_name(tag, known)})")
    return names
