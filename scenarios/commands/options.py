"""Options that several commands share, their parsers, and the output of results."""

from __future__ import annotations

import json
import os
import sys
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from traceback import print_exception
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..error import MissingMotionError, ScenarioError
from .completion import complete_scenario

if TYPE_CHECKING:
    from ...reference.inputs import Inputs
    from ...reference.surface import Surface
    from ..files import FigureOutput
    from ..scenario import BicycleFile

AlphaOption = Annotated[
    float | None, typer.Option("--alpha", help="Shape of the bowl z = alpha (x² + y²) [1/m]; 0 is the plane.")
]
GroundOption = Annotated[
    str | None,
    typer.Option("--surface", metavar="KIND:KEY=VALUE,...", help="Another bowl instead, e.g. sphere:radius=20."),
]
BicycleOption = Annotated[
    str | None,
    typer.Option(
        "--bicycle",
        metavar="FILE",
        help="Another bicycle: a bicycle file (BicycleParameters or TOML), or a scenario's; see velodrome bicycle.",
        autocompletion=complete_scenario,
    ),
]
ChangesOption = Annotated[
    list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Override a field, e.g. simulation.duration=5.")
]
DurationOption = Annotated[float | None, typer.Option(help="Simulated time [s].")]
TracebackOption = Annotated[
    bool, typer.Option("--traceback", help="Show on stderr the whole traceback of an engine that failed.")
]
SteerTorqueOption = Annotated[
    float, typer.Option(help="Torque that is held on the front frame about the steering axis, to the left [N m].")
]
RearTorqueOption = Annotated[
    float, typer.Option("--rear-wheel-torque", help="Torque on the rear wheel; a circle exists with 0 only [N m].")
]
SteerDampingOption = Annotated[
    float, typer.Option(min=0, help="Coefficient of the torque against the steer rate [N m s/rad].")
]
WithinOption = Annotated[
    bool,
    typer.Option(
        "--within", help="Search for the unstable orbits that bound stable motions, too; this takes some seconds."
    ),
]
CacheOption = Annotated[
    Path | None,
    typer.Option(
        "--cache",
        envvar="VELODROME_CACHE",
        show_envvar=True,
        help="Folder whose subfolder releases keeps the releases' environments; velodrome in the user's cache folder "
        "if not given.",
    ),
]
FormatOption = Annotated[
    list[str] | None,
    typer.Option("--format", help="Format of figures: png, svg or pdf; may be given several times; png if not given."),
]
ColumnsOption = Annotated[
    int | None,
    typer.Option(
        "--columns",
        min=1,
        max=2,
        help="Width of figures: 1 for one column of a journal (89 mm), 2 for two (183 mm); 2 if not given.",
    ),
]
HISTORIES = Path("history")  # where histories are written and looked for if no folder is named
LONGEST_RIDE = 600.0  # [s] after which a ride of a release counts as hung
JsonOption = Annotated[bool, typer.Option("--json", help="One JSON document on stdout, nothing else.")]


def load_bicycle(source: str | None) -> BicycleFile:
    """Return the bicycle that --bicycle names, the benchmark bicycle if it is not given."""
    from ..scenario import find_bicycle

    try:
        return find_bicycle("benchmark" if source is None else source)
    except ScenarioError as error:
        raise ScenarioError(f"--bicycle: {error}") from error


@contextmanager
def answering_missing_motion(as_json: bool) -> Iterator[None]:
    """Run the body; if it raises a `MissingMotionError` and JSON is wanted, print its document, and end the command.

    Without JSON, `velodrome.scenarios.cli.main` prints the message. The exit status is 1 in both cases.
    """
    try:
        yield
    except MissingMotionError as error:
        if not as_json:
            raise
        with ending_with(1):
            print_json(error.as_json())


def parse_changes(change: list[str] | None, duration: float | None) -> dict[str, Any]:
    """Return the fields that --set and --duration override, by dotted key."""
    changes, faults = {}, []
    for text in change or []:
        try:
            key, value = _parse_assignment(text)
            changes[key] = value
        except ScenarioError as error:
            faults.append(str(error))
    if faults:
        from ..scenario import join_complaints

        raise ScenarioError(join_complaints(faults))
    if duration is not None:
        changes["simulation.duration"] = duration
    return changes


def _parse_assignment(text: str) -> tuple[str, Any]:
    """Split KEY=VALUE; the value is TOML, or a plain word."""
    from ..scenario import read_toml, show_value

    key, equals, value = text.partition("=")
    key = key.strip()
    if not equals or not key or not all(key.split(".")):
        raise ScenarioError(f"--set {show_value(text)}: must be KEY=VALUE, e.g. simulation.duration=5")
    try:
        found = read_toml(f"value = {value}")
    except tomllib.TOMLDecodeError:
        return key, value
    except ValueError as error:
        raise ScenarioError(f"--set {show_value(text)}: {error}") from None
    # A line break would start a second TOML statement.
    return key, found["value"] if len(found) == 1 else value


def parse_angles(text: str | None) -> tuple[float, float] | None:
    """Return the lean and the steer that ``--near`` gives [rad]."""
    if text is None:
        return None
    try:
        lean, steer = (float(part) for part in text.split(","))
    except ValueError:
        from ..scenario import show_value

        raise ScenarioError(
            f"--near {show_value(text)}: must be two angles LEAN,STEER in rad, e.g. 0.74,2.84"
        ) from None
    return lean, steer


def parse_ground(alpha: float | None, surface: str | None) -> Surface | float:
    """Return the ground that exactly one of --alpha and --surface gives."""
    if (alpha is None) == (surface is None):
        raise ScenarioError("give the bowl by one of --alpha and --surface, e.g. --alpha 0.005")
    if surface is None:
        assert alpha is not None
        return alpha
    from ..scenario import parse_surface

    return parse_surface(surface, "--surface")


def make_inputs(steer_torque: float, rear_wheel_torque: float, steer_damping: float) -> Inputs:
    """Return the inputs that --steer-torque, --rear-wheel-torque and --steer-damping give."""
    from ...reference.inputs import Inputs

    try:
        return Inputs(steer_torque, rear_wheel_torque, steer_damping)
    except ValueError as error:
        name, space, rest = str(error).partition(" ")
        raise ScenarioError(f"--{name.replace('_', '-')}{space}{rest}") from error


def parse_figure_output(
    formats: list[str] | None, columns: int | None, needed: str | None = None, usual: tuple[str, ...] = ("png",)
) -> FigureOutput:
    """Return how the figures are written that --format and --columns ask for.

    Parameters
    ----------
    formats : list of str or None
    columns : int or None
    needed : str, optional
        Option without which the command writes no figures, if it was not given.
    usual : tuple of str
        Formats if none is given.

    Raises
    ------
    ScenarioError
        If there is no such format, or the command writes no figures.
    """
    from ..files import FIGURE_FORMATS, FigureOutput

    if needed is not None:
        for option, value in (("--format", formats), ("--columns", columns)):
            if value:
                raise ScenarioError(f"{option}: it is of figures, which are written with {needed} only")
    for name in formats or ():
        if name not in FIGURE_FORMATS:
            # Imported here: scenarios take half a second to load, in which the command has said nothing yet.
            from ...engines.names import suggest_name
            from ..scenario import show_value

            raise ScenarioError(f"--format {show_value(name)}: no such format ({suggest_name(name, FIGURE_FORMATS)})")
    return FigureOutput(tuple(dict.fromkeys(formats or usual)), 2 if columns is None else columns)


def show_written(paths: Iterable[Path]) -> None:
    """Print the paths of written files, one per line."""
    from .terminal import make_console

    for path in paths:
        make_console().print(f"written: {path}", markup=False, soft_wrap=True)


def print_json(document: Mapping[str, Any]) -> None:
    """Print one JSON document with its format version, and nothing else."""
    from ..files import versioned

    print(json.dumps(versioned(document), indent=1, allow_nan=False))


def count_cores() -> int:
    """Return the number of CPU cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def ending_with(status: int) -> Iterator[None]:
    """Run the body, which prints a command's result, and end the command with its exit status.

    If the reader of the output (``head``, ``less``) has closed the pipe, the status is the same.
    """
    try:
        yield
        if sys.stdout is not None:  # None if it was closed when the process started
            sys.stdout.flush()
    except (BrokenPipeError, SystemExit):  # rich turns the former into the latter
        # Redirect stdout, since the interpreter reports an error if its final flush fails.
        if sys.stdout is not None:
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    if status:
        raise typer.Exit(status)


def print_traceback(engine: str, error: Exception) -> None:
    """Print the traceback of an engine's exception on stderr."""
    from .terminal import leave_stderr

    try:
        print(f"{engine}:", file=sys.stderr)
        print_exception(error, file=sys.stderr)
    except BrokenPipeError:
        leave_stderr()


@contextmanager
def showing_traceback(wanted: bool) -> Iterator[None]:
    """Print the traceback of the cause of a `ScenarioError`, e.g. an engine that cannot be loaded, if requested."""
    try:
        yield
    except ScenarioError as error:
        if wanted and error.__cause__ is not None:
            print_exception(error.__cause__, file=sys.stderr)
        raise
