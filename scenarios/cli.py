"""The command `velodrome`.

Compiled kernels, engines and plots take seconds to import: each command imports what it needs, and none
of them waits for the others'.
"""

from __future__ import annotations

import os
import sys
from itertools import pairwise
from typing import Annotated, NoReturn

import typer

from .commands import (
    atlas_command,
    bicycle_command,
    check_command,
    circular_command,
    critical_command,
    diff_command,
    families_command,
    list_command,
    paper_command,
    precision_command,
    print_versions,
    run_command,
    run_supervised,
    show_command,
    sweep_command,
    view_command,
)
from .error import ScenarioError

# Set by the shell when it asks for completions.
_COMPLETING = "_VELODROME_COMPLETE"
app = typer.Typer(
    name="velodrome",
    help="Cross-validation of multibody engines on a bicycle that rides hands-free in circles inside a bowl.",
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


def _print_versions(wanted: bool) -> None:
    if wanted:
        print_versions()
        raise typer.Exit


@app.callback()
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


# In the order of the help.
for _command in (
    list_command,
    show_command,
    run_command,
    circular_command,
    families_command,
    critical_command,
    atlas_command,
    bicycle_command,
    paper_command,
    precision_command,
    diff_command,
    view_command,
    sweep_command,
    check_command,
):
    app.command(_command.__name__.removesuffix("_command"))(_command)


def supervised_main() -> NoReturn:
    """Run the command as the console does: a process that ends before the command has is no success."""
    run_supervised(main)


def main() -> NoReturn:
    """Run the command in this process; bad input ends with one line on stderr and exit status 2."""
    status = 0
    try:
        _refuse_empty_out(sys.argv[1:])
        status = app(sys.argv[1:] or ["--help"], standalone_mode=False)
    except ScenarioError as error:
        _complain(str(error))
    except typer.TyperException as error:
        _complain(error.format_message())
    except KeyboardInterrupt:
        sys.exit(130)
    except BrokenPipeError:
        # The reader has gone before there was a result: nobody is there to be told.
        sys.stderr.close()
        sys.exit(1)
    except SystemExit as error:
        if _is_completion(sys.argv[1:]):
            raise  # typer ends so, and no engine has been near
        # The commands end with typer.Exit: this is somebody else's.
        _complain(f"something called sys.exit({error.code!r}) before the command was done", status=1)
    except (OSError, UnicodeEncodeError) as error:  # the latter of a path that is no text
        _complain(f"cannot write: {error}")
    sys.exit(status or 0)


def _refuse_empty_out(arguments: list[str]) -> None:
    """Refuse ``--out ''``, as a shell's unset variable makes it; parsed, it would be the working folder."""
    if "--out=" in arguments or ("--out", "") in pairwise(arguments):
        raise ScenarioError("--out: it is empty; name a folder, or . for the working folder")


def _is_completion(arguments: list[str]) -> bool:
    """Whether the shell asks for completions, or the user for the shell's script; neither runs a command."""
    return _COMPLETING in os.environ or arguments[:1] in (["--install-completion"], ["--show-completion"])


def _complain(message: str, status: int = 2) -> NoReturn:
    # What was typed may be repeated, but must not move the cursor.
    line = "".join(letter if letter.isprintable() else repr(letter)[1:-1] for letter in " ".join(message.split()))
    print(f"velodrome: {line}", file=sys.stderr)
    sys.exit(status)
