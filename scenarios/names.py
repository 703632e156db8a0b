"""Names of scenarios and engines, found without loading anything, since shell completion needs them quickly."""

from __future__ import annotations

from pathlib import Path

LIBRARY = Path(__file__).parent / "library"
# The same as `velodrome.engines.engine.ENTRY_POINT_GROUP`, whose module takes half a second to load.
_ENGINES = "velodrome.engines"


def list_library() -> list[str]:
    """Return the names of the library's scenarios, sorted."""
    return sorted(entry.name.removesuffix(".toml") for entry in LIBRARY.iterdir() if entry.name.endswith(".toml"))


def announced_names() -> list[str]:
    """Return the names of announced engines, sorted, whether the engines can be loaded or not."""
    # This import takes a fifth of the time of a completion, and only engines need it.
    from importlib.metadata import entry_points

    return sorted({point.name for point in entry_points(group=_ENGINES)})
