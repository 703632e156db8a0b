"""The reference of the engines and their settings, of those as well whose library is not installed."""

from __future__ import annotations

from importlib.metadata import EntryPoint, distribution
from inspect import getdoc

from fields import list_fields, make_sentence

from velodrome.engines.engine import REFERENCE, describe_engine
from velodrome.engines.libraries import install_command
from velodrome.engines.registry import ENTRY_POINT_GROUP, preview_engine


def find_own_engines() -> dict[str, EntryPoint]:
    """Return the entry points of the engines that the suite itself announces by name, the reference first."""
    own = (point for point in distribution("velodrome").entry_points if point.group == ENTRY_POINT_GROUP)
    return {point.name: point for point in sorted(own, key=lambda point: (point.name != REFERENCE, point.name))}


def describe_engines() -> str:
    """Markdown of every engine: what it is, what it gives, its settings, and how its library is installed."""
    parts = []
    for name, point in find_own_engines().items():
        engine = preview_engine(name)
        given = ", ".join(f"`{field}`" for field in engine.gives) or "nothing"
        doc = (getdoc(engine.settings) or "").partition("\n")[0]
        parts += [
            f"(engine-{name})=",
            f"## `{name}`",
            make_sentence(describe_engine(engine)),
            *([f"Its library is an extra: `{install_command(point)}`."] if point.extras else []),
            f"Gives, beside coordinates, rates and poses: {given}.",
            f"Settings, under `[engines.{name}]` of a scenario file or by `--set engines.{name}.NAME=VALUE`. {doc}",
            list_fields(engine.settings),
        ]
    return "\n\n".join(parts)
