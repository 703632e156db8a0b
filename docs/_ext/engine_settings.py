"""The reference of the engines and their settings, from the installed engines."""

from __future__ import annotations

from inspect import getdoc

from fields import list_fields

from velodrome.engines.engine import ENTRY_POINT_GROUP, engine_names, load_engine


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
            WHAT[name],
            f"Gives, beside coordinates, rates and poses: {given}.",
            f"Settings, under `[engines.{name}]` of a scenario file or by `--set engines.{name}.NAME=VALUE`. {doc}",
            list_fields(engine.settings),
        ]
    return "\n\n".join(parts)


# What an engine is, for a reader who chooses one.
WHAT = {
    "reference": "Lagrange's equations with six multipliers, as in the paper, integrated to round-off.",
    "exudyn": "Rigid bodies and knife edges on true rolling constraints, by a joint that works in any Exudyn model.",
    "exudyn-plane-normal": "Exudyn's own rolling disc; its plane is turned to the contact's before every residual.",
    "exudyn-builtin": "Exudyn's own rolling disc as it is, on the level plane only. Its first contact forces are "
    "wrong by half; `examples/exudyn_contact_forces.py` shows why.",
    "mujoco-default": "MuJoCo with all its defaults. The bicycle falls.",
    "mujoco-native": "MuJoCo as a careful user sets it. Its wheels creep.",
    "mujoco-exact-contact": "MuJoCo's solver on exact knife-edge contacts, with the acceleration that its own contact "
    "rows leave out.",
    "mujoco-multipliers": "MuJoCo's tree and integrator under the exact forces of rolling: a check of the tree, not "
    "of its contacts.",
}
