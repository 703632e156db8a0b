"""The reference of the engines and their settings, from the installed engines."""

from __future__ import annotations

from inspect import getdoc

from fields import list_fields, make_sentence

from velodrome.engines.engine import describe_engine
from velodrome.engines.registry import ENTRY_POINT_GROUP, engine_names, load_engine


def own_engines() -> list[str]:
    """Names of the engines that the suite itself announces, the reference first."""
    from importlib.metadata import distribution

    own = {point.name for point in distribution("velodrome").entry_points if point.group == ENTRY_POINT_GROUP}
    return [name for name in engine_names() if name in own]


def describe_engines() -> str:
    """Markdown of every engine: what it is, what it gives, its settings."""
    parts = []
    for name in own_engines():
        engine = load_engine(name)
        given = ", ".join(f"`{field}`" for field in engine.gives) or "nothing"
        doc = (getdoc(engine.settings) or "").partition("\n")[0]
        parts += [
            f"(engine-{name})=",
            f"## `{name}`",
            make_sentence(describe_engine(engine)),
            f"Gives, beside coordinates, rates and poses: {given}.",
            f"Settings, under `[engines.{name}]` of a scenario file or by `--set engines.{name}.NAME=VALUE`. {doc}",
            list_fields(engine.settings),
        ]
    return "\n\n".join(parts)
