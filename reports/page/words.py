"""The facts of a run as text."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from datetime import datetime
from typing import Any

from markupsafe import Markup, escape

from ...reference.bicycle import Bicycle
from ...reference.inputs import NO_INPUTS, Inputs

_LONGEST = 80  # largest number of characters for a field with a list of numbers
_ROUNDING_OF_STEPS = 0.01  # relative: a whole number of steps between samples need not meet a setting to the digit
_UNITS = {
    "x": "m",
    "y": "m",
    "lean": "rad",
    "steer": "rad",
    "lean_rate": "rad/s",
    "steer_rate": "rad/s",
    "rear_rate": "rad/s",
}


def list_facts(manifest: Mapping[str, Any], scenario: Mapping[str, Any]) -> list[tuple[str, str]]:
    """List terms and their meanings in this run.

    Parameters
    ----------
    manifest : mapping
        As in ``manifest.json``.
    scenario : mapping
        As in ``scenario.toml``.

    Returns
    -------
    list of (str, str)
    """
    simulation, start = scenario["simulation"], manifest["start"]
    rows = [
        ("Scenario", str(manifest["scenario"])),
        ("Ground", describe_ground(scenario["surface"])),
        ("Motion", describe_motion(scenario["motion"])),
    ]
    if start["family"] is not None:
        rows.append(("Family", f"{start['family']} of the circular motions"))
    return [
        *rows,
        *_list_inputs(scenario.get("inputs") or {}),
        ("Disturbed by", describe_disturbance(scenario.get("perturbation", {}))),
        ("Growth rate", f"{start['growth_rate']:.4g} 1/s"),
        ("Duration", f"{simulation['duration']:g} s, {simulation['output_rate']:g} samples a second"),
        ("Bicycle", describe_bicycle(scenario.get("bicycle", {}))),
        ("Run on", describe_date(manifest["created"])),
        ("State", "complete" if manifest["complete"] else "interrupted: the engines that had finished are shown"),
    ]


def describe_date(created: str) -> str:
    """Format a date as documents have it."""
    return f"{datetime.fromisoformat(created):%Y-%m-%d, %H:%M:%S %Z}"


def _list_inputs(table: Mapping[str, float]) -> list[tuple[str, str]]:
    """List the term of the inputs if any of them is not zero."""
    inputs = Inputs(**table)
    return [] if inputs == NO_INPUTS else [("Inputs", inputs.describe().replace("_", " "))]


def describe_ground(surface: Mapping[str, Any]) -> str:
    """Describe a surface."""
    if surface["kind"] == "plane":
        return "level plane"
    if surface["kind"] == "paraboloid":
        return f"bowl z = α (x² + y²), α = {surface['alpha']:g} 1/m"
    fields = (f"{name} {_shorten(value)}" for name, value in surface.items() if name != "kind" and value is not None)
    return ", ".join([str(surface["kind"]), *fields])


def describe_motion(table: Mapping[str, Any]) -> str:
    """Describe the motion at the start."""
    if table.get("kind") == "upright":
        return f"straight and upright, {table['speed']:g} m/s"
    return f"circle with the rear wheel at {table['rear_rate']:g} rad/s"


def describe_disturbance(table: Mapping[str, float]) -> str:
    """What was added to the motion's start, in words."""
    added = (f"{name.replace('_', ' ')} {value:+g} {_UNITS[name]}" for name, value in table.items() if value != 0)
    return ", ".join(added) or "nothing"


def describe_bicycle(changes: Mapping[str, float]) -> str:
    """Describe the bicycle by the parameters that differ from the benchmark bicycle's."""
    name = "benchmark bicycle (Meijaard et al. 2007)"
    benchmark = Bicycle()
    others = {key: value for key, value in changes.items() if value != getattr(benchmark, key, None)}
    changed = ", ".join(f"{key.replace('_', ' ')} {value:g}" for key, value in others.items())
    return f"{name} with {changed}" if changed else name


def keep_whole(text: str, names: Iterable[str]) -> Markup:
    """Return text as HTML in which no line breaks within one of the names, although they contain hyphens."""
    longest_first = sorted(names, key=len, reverse=True)
    if not longest_first:
        return escape(text)
    parts = re.split("(" + "|".join(map(re.escape, longest_first)) + ")", text)
    whole = Markup('<span class="whole">{}</span>')
    # A split by one group returns the text between and the names in turn.
    return Markup("").join(whole.format(part) if k % 2 else escape(part) for k, part in enumerate(parts))


def describe_own_steps(engines: Mapping[str, Mapping[str, Any]], duration: float) -> dict[str, str]:
    """Describe the setting ``step`` of engines that did not take such steps, with those that they took, by engine.

    Methods with steps of their own have such a setting too, for studies of convergence. Rides that ended early are
    left out, as their mean step is not known from the manifest.
    """
    found = {}
    for name, engine in engines.items():
        step, steps = (engine.get("settings") or {}).get("step"), engine.get("steps")
        if not isinstance(step, float) or not steps or engine.get("ended") is not None:
            continue
        mean = duration / steps
        if abs(mean / step - 1) > _ROUNDING_OF_STEPS:
            found[name] = f"{describe_setting(step)}, but it took {mean:.2g} on average"
    return found


def describe_setting(value: Any) -> str:
    """Format a setting's value as in a scenario file."""
    if value is None:
        return "not set"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list | tuple):
        return ", ".join(describe_setting(item) for item in value)
    return f"{value!r}" if isinstance(value, float) else str(value)


def _shorten(value: Any) -> str:
    text = str(value)
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"
