"""The reference of the commands, from the command line's own parser."""

from __future__ import annotations

import enum
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer

from velodrome.scenarios.cli import app

_WORDS = {str: "TEXT", int: "WHOLE NUMBER", float: "NUMBER", Path: "PATH"}


def commands() -> dict[str, Any]:
    """Every command by its name, in the order of the help."""
    group: Any = typer.main.get_command(app)
    return dict(group.commands)


def describe_commands() -> str:
    """Markdown of every command with all its arguments and options."""
    return "\n\n".join(_describe(name, command) for name, command in commands().items())


def option_names(command: Any) -> list[str]:
    """All spellings of all options of a command."""
    return [spelling for one in command.params for spelling in (*one.opts, *one.secondary_opts) if spelling[0] == "-"]


def _describe(name: str, command: Any) -> str:
    arguments = [one for one in command.params if not one.opts[0].startswith("-")]
    options = [one for one in command.params if one.opts[0].startswith("-")]
    usage = " ".join(["velodrome", name, *(["[OPTIONS]"] if options else []), *map(_usage, arguments)])
    lines = [f"(command-{name})=", f"## `velodrome {name}`", "", command.help, "", f"```text\n{usage}\n```", ""]
    for one in (*arguments, *options):
        lines += [_title(one), *(f": {line}" for line in _facts(one)), ""]
    return "\n".join(lines)


def _usage(argument: Any) -> str:
    word = _placeholder(argument)
    if argument.nargs == -1:
        word = f"{word}..."
    return word if argument.required else f"[{word}]"


def _placeholder(one: Any) -> str:
    if one.metavar:
        return one.metavar
    if not one.opts[0].startswith("-"):
        return one.name.upper()
    return _WORDS.get(_kind(one), "TEXT")


def _kind(one: Any) -> Any:
    kind = one.type_descriptor.annotation
    return kind if isinstance(kind, type) and not issubclass(kind, enum.Enum) else str


def _title(one: Any) -> str:
    if not one.opts[0].startswith("-"):
        return f"`{_usage(one)}`"
    word = "" if one.is_flag else f" {_placeholder(one)}"
    return ", ".join(f"`{spelling}{word}`" for spelling in (*one.opts, *one.secondary_opts))


def _facts(one: Any) -> Iterator[str]:
    if one.help:
        yield one.help
    if one.required:
        yield "Required."
    default = one.default
    if callable(default):
        default = default()
    if not one.required and default is not None and default is not False and default not in ([], ()):
        yield "On by default." if default is True else f"Default: `{default}`."
