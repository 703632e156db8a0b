"""Terminal output of `velodrome show`: one line per name, with its description below."""

from __future__ import annotations

import json
from collections.abc import Mapping
from textwrap import wrap
from typing import Any

from rich.console import Console
from rich.text import Text

from .terminal import print_line

_LONGEST = 6  # items of a list that are printed; --json has all


def show_document(console: Console, document: Mapping[str, Any]) -> None:
    """Print a document of `velodrome.scenarios.show.make_document`."""
    kind = document["kind"]
    if kind == "engine":
        _show_engine(console, document)
    elif kind == "bicycle":
        _show_bicycle(console, document)
    elif kind == "file":
        _show_file(console, document)
    else:
        _show_scenario(console, document)


def _show_engine(console: Console, document: Mapping[str, Any]) -> None:
    print_line(console, f"{document['name']} {document['version'] or ''}".rstrip(), "bold")
    _print_below(console, document["description"], indent=0)
    if document["install"] is not None:
        _print_below(console, f"its library is not installed; install: {document['install']}", indent=0)
    if document["package"] is not None:
        _print_below(console, f"announced by the package {document['package']}", indent=0)
    gives = ", ".join(document["gives"]) or "nothing"
    _print_below(console, f"gives, beside coordinates and poses: {gives}", indent=0)
    takes = "torques and steer damping" if document["takes_inputs"] else "none"
    _print_below(console, f"inputs that it applies: {takes}", indent=0)
    if document["releases"] is not None:
        _show_releases(console, document["releases"])
    console.print()
    print_line(console, f"[engines.{document['name']}]", "bold")
    _show_fields(console, document["settings"])


def _show_releases(console: Console, releases: Mapping[str, Any]) -> None:
    _print_below(console, f"rides with {releases['package']} {releases['oldest']} or newer", indent=0)
    if releases["refusal"] is not None:
        _print_below(console, f"refused: {releases['refusal']}", indent=0)
    for key in ("left_out", "replaced"):
        for name, text in releases[key].items():
            _print_below(console, f"{key.replace('_', ' ')}, {name}: {text}", indent=0)


def _show_bicycle(console: Console, document: Mapping[str, Any]) -> None:
    print_line(console, f"{document['name']} bicycle", "bold")
    _print_below(console, document["description"], indent=0)
    console.print()
    print_line(console, "[bicycle]", "bold")
    for name, value in document["parameters"].items():
        print_line(console, f"{name} = {_format_value(value)} {document['units'][name]}")
        _print_below(console, document["descriptions"][name])


def _show_file(console: Console, document: Mapping[str, Any]) -> None:
    print_line(console, f"what a {document['name']} file may hold", "bold")
    for table in document["tables"]:
        if not table["fields"] and table["table"]:
            continue
        console.print()
        if table["table"]:
            print_line(console, f"[{table['table']}]", "bold")
        _print_below(console, table["description"], indent=0)
        if table["kind"] is not None:
            print_line(console, f"kind = {_format_value(table['kind'])}")
        others = {key: field for key, field in table["fields"].items() if key != "kind" or table["kind"] is None}
        _show_fields(console, others)


def _show_fields(console: Console, fields: Mapping[str, Mapping[str, Any]]) -> None:
    for name, field in fields.items():
        unit = f" {field['unit']}" if field["unit"] not in (None, "1") else ""
        if field["required"]:
            first = f"{name}{unit and f' in{unit}'}, required"
        elif field["default"] is None:
            first = f"{name}{unit and f' in{unit}'}, not set by default"
        else:
            first = f"{name} = {_format_value(field['default'])}{unit}"
        print_line(console, first)
        _print_below(console, field["range"])
        _print_below(console, field["description"])


def _show_scenario(console: Console, document: Mapping[str, Any]) -> None:
    print_line(console, document["name"], "bold")
    _print_below(console, document["title"], indent=0)
    if document["tags"]:
        _print_below(console, f"tags: {', '.join(document['tags'])}", indent=0)
    for name, value in document.items():
        if isinstance(value, Mapping):
            _show_table(console, name, value, document.get("units", {}))


def _show_table(console: Console, name: str, table: Mapping[str, Any], units: Mapping[str, str]) -> None:
    """Print a table of a scenario as its file has it, with units."""
    plain = {key: value for key, value in table.items() if not isinstance(value, Mapping)}
    if plain:
        console.print()
        print_line(console, f"[{name}]", "bold")
    for key, value in plain.items():
        unit = units.get(f"{name}.{key}", "")
        print_line(console, f"{key} = {_format_value(value)} {unit}".rstrip())
    for key, value in table.items():
        if isinstance(value, Mapping):
            _show_table(console, f"{name}.{key}", value, units)


def _format_value(value: Any) -> str:
    """Format a JSON value as in TOML; of a long list, only the beginning."""
    if isinstance(value, list):
        shown = ", ".join(_format_value(item) for item in value[:_LONGEST])
        return f"[{shown}]" if len(value) <= _LONGEST else f"[{shown}, ... {len(value)} in all]"
    return repr(value) if isinstance(value, float) else json.dumps(value, ensure_ascii=False)


def _print_below(console: Console, words: str, indent: int = 4) -> None:
    """Print text below a name, wrapped to the width of the terminal."""
    for line in wrap(words, max(console.width - indent, 20), break_long_words=False, break_on_hyphens=False):
        console.print(Text(" " * indent + line, "dim" if indent else ""), soft_wrap=True)
