"""What the shell completes: names of scenarios and engines, and files.

It runs at every press of the tab key, so nothing here loads an engine, a kernel or a schema.
"""

from __future__ import annotations

import os
from pathlib import Path

from ..names import announced_names, list_library


def complete_scenario(incomplete: str) -> list[str]:
    """Names of the library's scenarios, and paths to TOML files and folders on the way to them."""
    return [*_beginning(list_library(), incomplete), *_paths(incomplete, ".toml")]


def complete_engine(incomplete: str) -> list[str]:
    """Names of engines that are announced."""
    return _beginning(announced_names(), incomplete)


def complete_shown(incomplete: str) -> list[str]:
    """Whatever `velodrome show` knows."""
    others = _beginning([*announced_names(), "bicycle", "scenario", "sweep"], incomplete)
    return [*complete_scenario(incomplete), *others]


def complete_toml(incomplete: str) -> list[str]:
    """Paths to TOML files."""
    return _paths(incomplete, ".toml")


def complete_folder(incomplete: str) -> list[str]:
    """Paths to folders."""
    return _paths(incomplete, None)


def _beginning(names: list[str], incomplete: str) -> list[str]:
    return [name for name in names if name.startswith(incomplete)]


def _paths(incomplete: str, ending: str | None) -> list[str]:
    """Folders, with a slash at their end, and files of an ending that begin as typed; hidden ones if asked for."""
    head, slash, tail = incomplete.rpartition("/")
    folder = Path(os.path.expanduser(head + slash or "."))
    found = []
    try:
        for entry in sorted(folder.iterdir()):
            if not entry.name.startswith(tail) or (entry.name.startswith(".") and not tail):
                continue
            if entry.is_dir():
                found.append(f"{head}{slash}{entry.name}/")
            elif ending is not None and entry.name.endswith(ending):
                found.append(f"{head}{slash}{entry.name}")
    except OSError:
        return []
    return [path for path in found if path.isprintable()]
