"""The reference of the JSON documents and of the stored columns."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from velodrome.engines.storage import trajectory_columns

# In every document; the page says what it is.
COMMON = ("schema_version",)


def documented() -> dict[str, Any]:
    """Heading and keys of every document, by its name; see the file."""
    return tomllib.loads(Path(__file__).with_name("documents.toml").read_text(encoding="utf-8"))


def describe_documents() -> str:
    """Markdown of all keys of all JSON documents."""
    parts = []
    for document in documented().values():
        parts.append(f"## {document['heading']}")
        lines = [f"`{key}`\n: {meaning}\n" for key, meaning in document["keys"].items()]
        parts.append("\n".join(lines))
    return "\n\n".join(parts)


def find_paths(value: Any, path: str = "") -> Iterator[str]:
    """Paths of all leaves of a document, ``[]`` for each item of a list of objects."""
    if isinstance(value, dict):
        for key, part in value.items():
            yield from find_paths(part, f"{path}.{key}" if path else key)
    elif isinstance(value, list) and value and all(isinstance(item, dict) for item in value):
        for item in value:
            yield from find_paths(item, f"{path}[]")
    else:
        yield path


def find_key(path: str, keys: list[str]) -> str | None:
    """The documented key that says what is at a path; None if there is none."""
    for key in keys:
        parts = re.split(r"(\*)", key)
        pattern = "".join(r"[^.]+" if part == "*" else re.escape(part) for part in parts)
        # An empty list has no items that a key could speak of.
        if re.fullmatch(rf"{pattern}([.\[].*)?", path) or key.startswith(f"{path}[]"):
            return key
    return None


def describe_columns_of_trajectories() -> str:
    """Markdown of the Parquet columns of a trajectory."""
    lines = []
    for field, columns in trajectory_columns():
        names = ", ".join(f"`{column}`" for column, _ in columns)
        units = " and ".join(dict.fromkeys(unit for _, unit in columns))
        lines += [f"`{field}` [{units}]", f": {names}", ""]
    return "\n".join(lines)
