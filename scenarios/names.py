"""Names of scenarios and engines, found without loading anything: the shell's completion asks for them at every key."""

from __future__ import annotations

from pathlib import Path

LIBRARY = Path(__file__).parent / "library"
_ENGINES = "velodrome.engines"  # as `velodrome.engines.engine.ENTRY_POINT_GROUP`, which takes half a second to load


def list_library() -> list[str]:
    """Names of the library's scenarios, sorted."""
    return sorted(entry.name.removesuffix(".toml") for entry in LIBRARY.iterdir() if entry.name.endswith(".toml"))


def announced_names() -> list[str]:
    """Names under which engines are announced, sorted, whether they can be loaded or not."""
    # A fifth of the time that a completion takes; only engines need it.
    from importlib.metadata import entry_points

    return sorted({point.name for point in entry_points(group=_ENGINES)})
