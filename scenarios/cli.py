"""The command `velodrome`.

Compiled kernels, engines and plots take seconds to import. Each command therefore imports its libraries when it runs.
"""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Callable, Iterable
from contextlib import suppress
from itertools import pairwise
from typing import Annotated, NoReturn

import typer

from .commands import (
    atlas_command,
    basin_command,
    bicycle_command,
    bifurcations_command,
    check_command,
    circular_command,
    critical_command,
    diff_command,
    families_command,
    float32_command,
    history_command,
    league_command,
    list_command,
    paper_command,
    precision_command,
    print_versions,
    run_command,
    run_supervised,
    show_command,
    sweep_command,
    view_command,
    warm_up_command,
)
from .error import MissingMotionError, ScenarioError

# Environment variable that the shell sets when it asks for completions.
_COMPLETING = "_VELODROME_COMPLETE"


def _print_versions(wanted: bool) -> None:
    if wanted:
        print_versions()
        raise typer.Exit


def _take_options(
    version: Annotated[
        bool,
        typer.Option(
            "--version",
            callback=_print_versions,
            is_eager=True,
            help="Show the versions of the suite, its engines and libraries, and exit.",
        ),
    ] = False,
) -> None:
    pass


# In the order of the help. The short helps fit beside the names in 60 columns, where longer ones would be cut.
_COMMANDS: dict[Callable[..., None], str] = {
    list_command: "Scenarios and engines",
    show_command: "A scenario, engine, bicycle or file format",
    run_command: "Run scenarios and compare the engines",
    circular_command: "One circular motion and its stability",
    families_command: "The four families of circular motions",
    critical_command: "The critical shapes of the bowl",
    bifurcations_command: "What happens where stable circles end",
    basin_command: "What a stable circle survives",
    atlas_command: "Stability over alpha and rear rate",
    bicycle_command: "A bicycle by itself: eigenvalues, speeds",
    paper_command: "The paper's figures and numbers, computed",
    precision_command: "Error and CPU time over step sizes",
    float32_command: "What float32 costs, and why",
    league_command: "All installed engines side by side",
    diff_command: "Compare two stored runs",
    history_command: "Releases of an engine side by side",
    view_command: "View a run's recording or report",
    sweep_command: "Run a grid or a sample of scenarios",
    check_command: "Hold the gated scenarios to baselines",
    warm_up_command: "Compile ahead what commands need",
}


def _name_command(command: Callable[..., None]) -> str:
    return command.__name__.removesuffix("_command").replace("_", "-")


def _make_app(commands: Iterable[Callable[..., None]]) -> typer.Typer:
    """Make the application with some of the commands."""
    made = typer.Typer(
        name="velodrome",
        help="Cross-validation of multibody engines on a bicycle that rides hands-free in circles inside a bowl.",
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
    )
    made.callback()(_take_options)
    for command in commands:
        made.command(_name_command(command), short_help=_COMMANDS[command])(command)
    return made


app = _make_app(_COMMANDS)


def supervised_main() -> NoReturn:
    """Run the command under supervision: if its process ends before the command has finished, the status is not 0."""
    run_supervised(main)


def main() -> NoReturn:
    """Run the command in this process; bad input ends with one line on stderr and exit status 2.

    A motion that is not there is no bad input: its line ends with exit status 1.
    """
    # OpenBLAS starts its threads when numpy is imported, which takes tens of milliseconds of several cores. The suite's
    # matrices are too small for them.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Nearly all objects that imports and compilation make live on. To look for cycles among them at Python's usual
    # intervals takes a tenth of the time of both.
    gc.set_threshold(10_000, 50, 100)
    status = 0
    try:
        _refuse_empty_out(sys.argv[1:])
        arguments = sys.argv[1:] or ["--help"]
        status = _choose_app(arguments)(arguments, standalone_mode=False)
    except MissingMotionError as error:
        _complain(str(error), status=1)
    except ScenarioError as error:
        _complain(str(error))
    except typer.TyperException as error:
        _complain(error.format_message())
    except KeyboardInterrupt:
        sys.exit(130)
    except BrokenPipeError:
        # The reader has closed the pipe before there was a result.
        sys.stderr.close()
        sys.exit(1)
    except SystemExit as error:
        if _is_completion(sys.argv[1:]):
            raise  # typer ends completion in this way, and no engine has run
        # The commands end with typer.Exit, so that this exit comes from other code.
        _complain(f"something called sys.exit({error.code!r}) before the command was done", status=1)
    except (OSError, UnicodeEncodeError) as error:  # the latter for a path that is not valid text
        _complain(f"cannot write: {error}")
    sys.exit(status or 0)


def _choose_app(arguments: list[str]) -> typer.Typer:
    """Return the application with the command that the arguments begin with only, or with all.

    typer inspects the parameters of every command that it has, which takes longer than importing them.
    """
    commands = [command for command in _COMMANDS if arguments[0] == _name_command(command)]
    return _make_app(commands) if commands and not _is_completion(arguments) else app


def _refuse_empty_out(arguments: list[str]) -> None:
    """Refuse ``--out ''``, as a shell's unset variable makes it; parsed, it would be the working folder."""
    if "--out=" in arguments or ("--out", "") in pairwise(arguments):
        raise ScenarioError("--out: it is empty; name a folder, or . for the working folder")


def _is_completion(arguments: list[str]) -> bool:
    """Return whether the shell asks for completions or the user for the shell's script; neither runs a command."""
    return _COMPLETING in os.environ or arguments[:1] in (["--install-completion"], ["--show-completion"])


def _complain(message: str, status: int = 2) -> NoReturn:
    # The message may quote what was typed, so control characters are escaped.
    line = "".join(letter if letter.isprintable() else repr(letter)[1:-1] for letter in " ".join(message.split()))
    with suppress(BrokenPipeError):  # nobody reads it, and the status is the same
        print(f"velodrome: {line}", file=sys.stderr)
    sys.exit(status)
