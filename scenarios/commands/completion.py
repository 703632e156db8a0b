"""Shell completion of scenarios, engines and paths.

This code runs at every press of the tab key, so it loads no engine, kernel or schema.
"""

from __future__ import annotations

import os
from pathlib import Path

from ..names import announced_names, list_library


def complete_scenario(incomplete: str) -> list[str]:
    """Complete names of the library's scenarios, and paths to TOML files and folders."""
    return [*_filter_names(list_library(), incomplete), *_list_paths(incomplete, ".toml")]


def complete_engine(incomplete: str) -> list[str]:
    """Complete names of announced engines, and ``all``."""
    return _filter_names([*announced_names(), "all"], incomplete)


def complete_shown(incomplete: str) -> list[str]:
    """Complete the names that `velodrome show` accepts."""
    others = _filter_names([*announced_names(), "bicycle", "scenario", "sweep"], incomplete)
    return [*complete_scenario(incomplete), *others]


def complete_toml(incomplete: str) -> list[str]:
    """Complete paths to TOML files."""
    return _list_paths(incomplete, ".toml")


def complete_folder(incomplete: str) -> list[str]:
    """Complete paths to folders."""
    return _list_paths(incomplete, None)


def _filter_names(names: list[str], incomplete: str) -> list[str]:
    return [name for name in names if name.startswith(incomplete)]


def _list_paths(incomplete: str, ending: str | None) -> list[str]:
    """List folders, with a final slash, and files with a suffix, that begin with the typed text.

    Hidden entries are listed only if the typed name begins with a dot.
    """
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
