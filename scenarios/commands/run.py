"""The commands `list` and `run`."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..error import MissingMotionError, ScenarioError
from .completion import complete_engine, complete_scenario
from .options import (
    BicycleOption,
    CacheOption,
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
    from rich.console import Console

    from ...reference.bicycle import Bicycle
    from ..history import OpenedRelease
    from ..run import RunOutcome
    from ..scenario import Scenario
    from .progress import ProgressBars


def list_command(as_json: JsonOption = False) -> None:
    """Scenarios of the library, and engines with the commands that install those that are not there."""
    from .progress import ProgressBars
    from .terminal import make_console

    with ProgressBars():
        scenarios, engines = _list_scenarios(), _list_engines()
    with ending_with(0):
        if as_json:
            print_json({"scenarios": scenarios, "engines": engines})
        else:
            show_list(make_console(), scenarios, engines)


def _list_scenarios() -> list[dict[str, Any]]:
    """Return the scenarios of the library as JSON objects."""
    from ..scenario import library_names, load_scenario

    scenarios = []
    for name in library_names():
        _, scenario = load_scenario(name)
        scenarios.append({"name": name, "title": scenario.title, "tags": list(scenario.tags)})
    return scenarios


def _list_engines() -> list[dict[str, Any]]:
    """Return the engines as JSON objects, those whose libraries are not installed last."""
    from ...engines.engine import describe_engine
    from ...engines.registry import load_engine, uninstalled_engines
    from ...engines.releases import find_reach
    from ..run import installed_engines

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
    return engines + [
        {"name": name, "version": None, "gives": [], "install": command}
        for name, command in uninstalled_engines().items()
    ]


def show_list(console: Console, scenarios: list[dict[str, Any]], engines: list[dict[str, Any]]) -> None:
    """Print the tables of `velodrome list`, and the commands that install the libraries of further engines."""
    from rich.table import Table
    from rich.text import Text

    from .terminal import print_line

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
        if "install" in entry:
            continue
        words = Text(entry["error"], "red") if "error" in entry else Text(entry["description"])
        table.add_row(entry["name"], entry["version"] or "–", words)
    console.print(table)
    installs: dict[str, list[str]] = {}
    for entry in engines:
        if "install" in entry:
            installs.setdefault(entry["install"], []).append(entry["name"])
    for command, names in installs.items():
        print_line(console, f"not installed: {', '.join(names)}", "dim")
        print_line(console, f"  {command}", "dim")


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
    release: Annotated[
        str | None,
        typer.Option(
            metavar="PACKAGE==VERSION",
            help="Run the engines of this package with this release of it, in an environment of its own, as velodrome "
            "history does; a package alone with --wheel.",
        ),
    ] = None,
    wheel: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FILE.whl",
            help="A build as the release of --release; given again for wheels of packages that it requires.",
        ),
    ] = None,
    cache: CacheOption = None,
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
    from .progress import COMPUTING, RIDING, ProgressBars
    from .terminal import make_console

    with ExitStack() as using:
        with answering_missing_motion(as_json), showing_traceback(traceback), ProgressBars() as progress:
            from ..run import installed_engines
            from .present_run import outcome_json, show_outcome

            sources = [*(scenario or []), *(_find_tagged(tag) if tag is not None else [])]
            if not sources:
                raise ScenarioError("nothing to run: name a scenario, or a tag with --tag; velodrome list shows them")
            if wheel and release is None:
                raise ScenarioError("--wheel: it belongs to --release, e.g. --release mujoco --wheel FILE.whl")
            if record_rate is not None and not 0 < record_rate < math.inf:
                raise ScenarioError(
                    f"--record-rate is {record_rate:g}; it must be a positive number of samples a second [Hz]"
                )
            if record_rate is not None and no_recording:
                raise ScenarioError("--record-rate and --no-recording exclude one another: leave one out")
            changes = parse_changes(change, duration)
            installed_engines()  # raises here if two packages announce one engine, which is not a fault of a scenario
            other = None if bicycle is None else load_bicycle(bicycle).bicycle
            sources = list(dict.fromkeys(sources))
            progress.say(COMPUTING)
            if release is None:
                rides = [_plan_source(source, changes, engine, other, out, traceback) for source in sources]
            else:
                loaded = {source: _load_source(source, changes, other) for source in sources}
                progress.say(f"opening the environment of {release}")
                opened = using.enter_context(_open_release(progress, release, engine, wheel, cache))
                rides = [_plan_in_release(opened, source, *one, out, traceback) for source, one in loaded.items()]
        console = make_console(stderr=as_json)
        outcomes = []
        for ride in rides:
            with showing_traceback(traceback), ProgressBars(RIDING) as progress:
                outcome = ride.start(progress, not no_recording, record_rate)
            outcomes.append((ride, outcome))
            with ending_with(0):  # the next run goes on if the reader of this table has closed the pipe
                show_outcome(console, ride.name, ride.scenario, outcome)
            if outcome.interrupted:
                break
    with ending_with(_exit_status([outcome for _, outcome in outcomes])):
        if as_json:
            print_json({"runs": [outcome_json(ride.name, outcome) for ride, outcome in outcomes]})


@dataclass(frozen=True)
class _Ride:
    """A run that has been checked; ``start`` takes whether to record it, and the largest rate of samples then [Hz]."""

    name: str
    scenario: Scenario
    start: Callable[[ProgressBars, bool, float | None], RunOutcome]


def _exit_status(outcomes: Sequence[RunOutcome]) -> int:
    """Return the exit status: 130 after Ctrl-C, 1 if an engine did not run or a verdict does not hold, else 0."""
    if any(outcome.interrupted for outcome in outcomes):
        return 130
    holds = (not outcome.failures and all(verdict["holds"] for verdict in outcome.verdicts) for outcome in outcomes)
    return 0 if all(holds) else 1


def _plan_source(
    source: str,
    changes: dict[str, Any],
    wanted: list[str] | None,
    bicycle: Bicycle | None,
    out: Path,
    traceback: bool,
) -> _Ride:
    """Check a run of a scenario with the installed releases."""
    from ..run import plan_run, run_plan
    from ..scenario import load_scenario

    name, scenario = load_scenario(source, changes, "--set", bicycle)
    with _naming(source):
        plan = plan_run(name, scenario, wanted)
    trace = print_traceback if traceback else None

    def start(progress: ProgressBars, recording: bool, rate: float | None) -> RunOutcome:
        watch, note, say = progress.watch, progress.note, progress.say
        return run_plan(plan, out, watch, note, trace, say=say, recording=recording, record_rate=rate)

    return _Ride(name, plan.scenario, start)


def _load_source(source: str, changes: dict[str, Any], bicycle: Bicycle | None) -> tuple[str, Scenario]:
    """Load a scenario whose start exists."""
    from ..scenario import load_scenario, make_start

    name, scenario = load_scenario(source, changes, "--set", bicycle)
    with _naming(source):
        make_start(scenario)
    return name, scenario


@contextmanager
def _open_release(
    progress: ProgressBars, wanted: str, engines: list[str] | None, wheels: list[Path] | None, cache: Path | None
) -> Iterator[OpenedRelease]:
    """Install a release, or find it in the cache."""
    from ..history import Children, find_cache_folder, open_release, plan_release_run

    children, environments = Children(), find_cache_folder(cache)
    try:
        plan = plan_release_run(wanted, engines or (), wheels or (), cache=environments, children=children)
        with open_release(plan, progress.note, cache=environments, children=children) as opened:
            yield opened
    finally:
        children.stop()


def _plan_in_release(
    opened: OpenedRelease, source: str, name: str, scenario: Scenario, out: Path, traceback: bool
) -> _Ride:
    """Return a run of a scenario with a release."""
    from ..history import RunEnded, run_in_release

    def start(progress: ProgressBars, recording: bool, rate: float | None) -> RunOutcome:
        trace = (lambda text: print(text, file=sys.stderr, end="")) if traceback else None
        try:
            with _naming(source):
                return run_in_release(
                    opened,
                    name,
                    scenario,
                    out,
                    progress.watch,
                    progress.note,
                    trace,
                    recording=recording,
                    record_rate=rate,
                )
        except RunEnded as error:
            progress.note(f"velodrome: {source}: {error}")
            raise typer.Exit(1) from error

    return _Ride(name, scenario, start)


@contextmanager
def _naming(source: str) -> Iterator[None]:
    """Put the name of the scenario before what is wrong."""
    try:
        yield
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
