"""Two stored runs of one scenario against each other: yesterday's engine against today's.

The same engine from the same start repeats its ride up to round-off and what its iterations leave unconverged. With
the relative error of the state that these allow by a time t (`velodrome.reports.measure.limits.noise`),

    reach(t) = noise(t) x (1 + speed x t / radius)

is how far two rides may be apart, in radii of the circle: an error of the rates takes a bicycle away by its share of
the way ridden. All else that is stored is held to the same law, by sizes of its own
(`velodrome.scenarios.compare.fields`). Beyond that something else is different: the engine, its settings, or the
machine's arithmetic.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any

import numpy as np

from ...engines.engine import Trajectory
from ...reference.bicycle import Bicycle
from ...reference.surface import Surface
from ...reports.drawing import escape_markdown
from ...reports.measure import Scale, evaluate_ride, noise, position_errors, ride_limits, to_number, until_fall
from .fields import field_differences

TO_THE_BIT, WITHIN_ROUND_OFF, DIFFERS = "same to the bit", "same within round-off", "differs"


@dataclass(frozen=True)
class StoredRun:
    """What is read of a run folder.

    Attributes
    ----------
    name : str
        To call it by.
    manifest : mapping
        As in ``manifest.json``.
    metrics : mapping
        By engine, as in ``metrics.json``.
    trajectories : mapping
        By engine; those that gave none are missing.
    """

    name: str
    manifest: Mapping[str, Any]
    metrics: Mapping[str, Mapping[str, Any]]
    trajectories: Mapping[str, Trajectory]


@dataclass(frozen=True)
class StoredGround:
    """What both runs ride on and with, and the sizes of the ride.

    Attributes
    ----------
    bicycle : Bicycle
    surface : Surface
    scale : Scale
        Its duration is that of the whole ride.
    """

    bicycle: Bicycle
    surface: Surface
    scale: Scale


def diff_document(
    before: StoredRun, after: StoredRun, ground: StoredGround, step_noise: Mapping[str, float]
) -> dict[str, Any]:
    """Compare two runs of one scenario from one start.

    Parameters
    ----------
    before, after : StoredRun
        Sampled at the same times.
    ground : Ground
    step_noise : mapping
        By engine, the relative error that one of its steps may add beyond its method, see
        `velodrome.engines.engine.Engine.step_noise`.

    Returns
    -------
    dict
        JSON values: the two ``runs``, what ``differs`` between them beside the engines, a part per engine common to
        both under ``engines``, those in one only, and whether all common ones are the ``same``.
    """
    first, second = before.manifest["engines"], after.manifest["engines"]
    common = [name for name in second if name in first]
    engines = {name: _engine(name, before, after, ground, step_noise[name]) for name in common}
    return {
        "scenario": after.manifest["scenario"],
        "title": after.manifest["title"],
        "duration": ground.scale.duration,
        "growth_rate": ground.scale.growth_rate,
        "runs": [_run(before), _run(after)],
        "differs": {part: _changed(before.manifest[part], after.manifest[part]) for part in ("libraries", "platform")},
        "engines": engines,
        "only_before": [name for name in first if name not in second],
        "only_after": [name for name in second if name not in first],
        "same": all(entry["verdict"] != DIFFERS for entry in engines.values()),
    }


def _run(run: StoredRun) -> dict[str, Any]:
    return {"name": run.name, "created": run.manifest["created"], "complete": run.manifest["complete"]}


def _changed(before: Mapping[str, Any], after: Mapping[str, Any]) -> dict[str, list[Any]]:
    """Values that differ, as [before, after]; None where there is none."""
    names = dict.fromkeys([*before, *after])
    return {name: [before.get(name), after.get(name)] for name in names if before.get(name) != after.get(name)}


def _engine(name: str, before: StoredRun, after: StoredRun, ground: StoredGround, step_noise: float) -> dict[str, Any]:
    """One engine's part of the document."""
    facts = [run.manifest["engines"][name] for run in (before, after)]
    entry: dict[str, Any] = {
        "version": [fact["version"] for fact in facts],
        "settings": _changed(facts[0]["settings"], facts[1]["settings"]),
        "step_noise": step_noise,
        "position_difference": None,
        "fields": {},
        "metrics": {},
        "cpu_time": None,
    }
    gone = [run for run in (before, after) if name not in run.trajectories]
    if gone:
        reasons = [f"gave no trajectory in {run.name}: {_failure(run, name)}" for run in gone]
        return entry | {"verdict": DIFFERS, "reasons": reasons}
    rides = (before.trajectories[name], after.trajectories[name])
    standing = [_until_fall(ride, ground) for ride in rides]
    # Where one falls and the other does not, the fall is no growth that both have: it is what differs.
    fell = all(len(short.time) < len(ride.time) for short, ride in zip(standing, rides, strict=True))
    # Of the run with the smaller steps, since each may err.
    rate = max(ride.steps / (float(ride.time[-1]) or ground.scale.duration) for ride in rides)
    allowed, reach = (partial(law, ground.scale, step_noise * rate, fell) for law in (_noise, _reach))
    difference = _position_difference(standing, ground.scale.radius, reach)
    # No further than positions are: beyond, nothing means anything.
    compared = [ride.first(difference["samples"]) for ride in standing]
    found = field_differences((compared[0], compared[1]), ground.scale, allowed, reach)
    scale = replace(ground.scale, duration=difference["compared_until"] or ground.scale.duration)
    # Metrics are of the whole ride: where a part of it means nothing, neither do they.
    limits = ride_limits(scale, reach(scale.duration)) if difference["horizon"] is None else {}
    metrics = _metrics(before.metrics[name], after.metrics[name], limits)
    reasons = _reasons(difference, found, metrics, rides)
    same = TO_THE_BIT if _identical(*rides) else WITHIN_ROUND_OFF
    return entry | {
        "position_difference": difference,
        "fields": found,
        "metrics": metrics,
        "cpu_time": _cpu_time(*rides),
        "verdict": DIFFERS if reasons else same,
        "reasons": reasons,
    }


def _until_fall(ride: Trajectory, ground: StoredGround) -> Trajectory:
    """The ride as stored, up to the fall that its coordinates show."""
    followed = evaluate_ride(ride, ground.bicycle, ground.surface)
    return ride.first(len(until_fall(followed, ground.bicycle, ground.surface).time))


def _cpu_time(before: Trajectory, after: Trajectory) -> dict[str, float | None]:
    """CPU times [s] and their ratio: information, since they say as much of the machine."""
    ratio = after.cpu_time / before.cpu_time if before.cpu_time > 0 else None
    return {"before": before.cpu_time, "after": after.cpu_time, "ratio": ratio}


def _failure(run: StoredRun, name: str) -> str:
    return run.manifest["engines"][name].get("failed", "it was interrupted")


def _identical(before: Trajectory, after: Trajectory) -> bool:
    """Whether every number of a ride is the same to the bit."""
    pairs = ((getattr(before, field.name), getattr(after, field.name)) for field in fields(Trajectory))
    return before.ended == after.ended and all(
        (a is None) == (b is None) and (a is None or np.array_equal(a, b, equal_nan=True))
        for a, b in pairs
        if isinstance(a, np.ndarray) or isinstance(b, np.ndarray)
    )


def _noise(scale: Scale, noise_rate: float, fell: bool, time: float) -> float:
    """Relative error of the state that is allowed after a time [s]; steps add ``noise_rate`` to it a second."""
    try:
        return noise(replace(scale, duration=time), noise_rate * time, 1, fell)
    except OverflowError:
        return math.inf


def _reach(scale: Scale, noise_rate: float, fell: bool, time: float) -> float:
    """How far two rides may be apart after a time [s], in radii."""
    return _noise(scale, noise_rate, fell, time) * scale.away(time)


def _position_difference(rides: Sequence[Trajectory], radius: float, reach: Callable[[float], float]) -> dict[str, Any]:
    """Distance of D in one ride from D in the other over time, and what is allowed [m].

    They are compared as far as both stand, and as the motion's growth leaves anything to compare: up to where
    what is allowed reaches the size of the motion.
    """
    distance = np.nan_to_num(position_errors(rides[1], rides[0]), nan=np.inf)
    lost = [np.isnan(ride.q[: len(distance), :3]) for ride in rides]
    if (lost[0] | lost[1]).any():
        # No number in the same places is no difference.
        distance[lost[0].any(axis=1) & (lost[0] == lost[1]).all(axis=1)] = 0.0
    allowed = np.array([radius * reach(t) for t in rides[0].time[: len(distance)].tolist()])
    telling = max(1, int(np.searchsorted(allowed, radius)))
    cut = telling < len(distance)
    distance, allowed, time = distance[:telling], allowed[:telling], rides[0].time[:telling]
    beyond, apart = np.flatnonzero(distance > allowed), np.flatnonzero(distance)
    most = int(distance.argmax())
    return {
        "samples": telling,
        "max": to_number(distance[most]),
        "max_at": float(time[most]),
        "end": to_number(distance[-1]),
        "end_limit": float(allowed[-1]),
        "compared_until": float(time[-1]),
        "horizon": float(time[-1]) if cut else None,
        "begins_at": float(time[apart[0]]) if len(apart) else None,
        "exceeds_at": float(time[beyond[0]]) if len(beyond) else None,
    }


def _metrics(
    before: Mapping[str, Any], after: Mapping[str, Any], limits: Mapping[str, float]
) -> dict[str, dict[str, Any]]:
    """Every metric of both runs: its values, its change, and where one can be derived its limit."""
    old, new = _flat(before), _flat(after)
    found = {}
    for name in dict.fromkeys([*new, *old]):
        a, b, limit = old.get(name), new.get(name), limits.get(name)
        change = b - a if isinstance(a, float | int) and isinstance(b, float | int) else None
        if limit is None or name not in old or name not in new:
            holds = None
        else:
            holds = a == b if change is None else abs(change) <= limit
        found[name] = {"before": a, "after": b, "change": change, "limit": limit, "holds": holds}
    return found


def _flat(metrics: Mapping[str, Any]) -> dict[str, Any]:
    """Metrics with the parts of those that have parts under names of their own."""
    found: dict[str, Any] = {}
    for name, value in metrics.items():
        if isinstance(value, Mapping):
            found |= {f"{name}.{part}": number for part, number in value.items()}
        elif name == "inconsistent_reports":
            found[name] = ", ".join(report["quantity"] for report in value) or None
        else:
            found[name] = value
    return found


def _reasons(
    difference: Mapping[str, Any],
    found: Mapping[str, Mapping[str, Any]],
    metrics: Mapping[str, Mapping[str, Any]],
    rides: tuple[Trajectory, Trajectory],
) -> list[str]:
    """Why two rides are not the same, a line each; none if they are."""
    reasons = []
    if difference["exceeds_at"] is not None:
        far = "" if difference["max"] is None else f", by up to {difference['max']:.3g} m"
        reasons.append(f"positions are apart by more than round-off from {difference['exceeds_at']:.4g} s on{far}")
    reasons += [line for name, entry in found.items() if (line := _field_reason(name, entry)) is not None]
    if len(rides[0].time) != len(rides[1].time) or rides[0].ended != rides[1].ended:
        ends = (f"at {ride.time[-1]:.4g} s ({ride.ended or 'its end'})" for ride in rides)
        reasons.append("they end differently: " + " and ".join(ends))
    if rides[0].friction != rides[1].friction:
        reasons.append(f"friction: {_shown(rides[0].friction)} -> {_shown(rides[1].friction)}")
    if rides[0].unconverged_steps != rides[1].unconverged_steps:
        counts = (_shown(ride.unconverged_steps) for ride in rides)
        reasons.append("steps whose iterations did not converge: " + " -> ".join(counts))
    for name, entry in metrics.items():
        if entry["holds"] is False:
            move = "" if entry["change"] is None else f", by {entry['change']:.2g}"
            limit = f"{move}, limit {entry['limit']:.2g}"
            reasons.append(f"{name}: {_shown(entry['before'])} -> {_shown(entry['after'])}{limit}")
    return reasons


def _field_reason(name: str, entry: Mapping[str, Any]) -> str | None:
    """What is to say of a field that differs."""
    words = name.replace("_", " ")
    if "only_in" in entry:
        return f"{words}: only the run {entry['only_in']} has it"
    if entry["exceeds_at"] is None:
        return None
    more = entry["columns_beyond"] - 1
    column = entry["column"].replace("_", " ") + (f" and {more} more" if more else "")
    what = column if name in (entry["column"], "q", "qd") else f"{words} ({column})"
    far = (
        "no number in one"
        if entry["max"] is None
        else f"by up to {entry['max']:.3g} {entry['unit']}".removesuffix(" 1")
    )
    return (
        f"{what}: apart by more than round-off from {entry['exceeds_at']:.4g} s on, where {entry['allowed_first']:.2g} "
        f"is allowed, {far}"
    )


def _shown(value: Any) -> str:
    return "none" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)


def diff_markdown(document: Mapping[str, Any]) -> str:
    """The document, with its ``notes``, as a page: the verdict, then a part an engine."""
    names = [run["name"] for run in document["runs"]]
    word = "the same within round-off" if document["same"] else "not the same"
    title = escape_markdown(f"{document['title']}: {names[0]} against {names[1]}")
    lines = [f"# {title}", "", f"The engines in both runs are {word}.", ""]
    for part, changes in document["differs"].items():
        lines += [
            f"- {part}: {escape_markdown(f'{name} {_shown(a)} -> {_shown(b)}')}" for name, (a, b) in changes.items()
        ]
    lines += [f"- {escape_markdown(note)}" for note in document["notes"]]
    for when, names in (("before", document["only_before"]), ("after", document["only_after"])):
        lines += [f"- only in the run {when}: {escape_markdown(', '.join(names))}"] if names else []
    for name, entry in document["engines"].items():
        said = [f"- {escape_markdown(line)}" for line in [*diff_remarks(entry), *entry["reasons"]]]
        lines += ["", f"## {escape_markdown(name)}: {entry['verdict']}", "", *said]
        if entry["fields"]:
            lines += [*([""] if said else []), *_field_table(entry["fields"])]
            said = ["a table"]
        if entry["metrics"]:
            lines += ([""] if said else []) + [
                "| metric | before | after | change | limit |",
                "|---|---:|---:|---:|---:|",
            ]
        for metric, values in entry["metrics"].items():
            cells = (_cell(values[key]) for key in ("before", "after", "change", "limit"))
            lines.append(f"| {metric} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def _field_table(found: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Fields that both runs have, as rows: the column nearest to its limit or furthest beyond, and how far."""
    rows = ["| field | column | unit | largest difference | at s | allowed there | beyond from s |"]
    rows.append("|---|---|---|---:|---:|---:|---:|")
    for name, entry in found.items():
        if "only_in" not in entry:
            cells = [_cell(entry[key]) for key in ("column", "unit", "max", "max_at", "allowed", "exceeds_at")]
            rows.append(f"| {name} | " + " | ".join(cells) + " |")
    return rows


def diff_remarks(entry: Mapping[str, Any]) -> list[str]:
    """What a reader must know of an engine's part: version and settings that differ, and how far it was compared."""
    before, after = entry["version"]
    lines = [f"version {before} -> {after}"] if before != after else []
    lines += [f"{name} {_shown(a)} -> {_shown(b)}" for name, (a, b) in entry["settings"].items()]
    if entry["cpu_time"] is not None and entry["cpu_time"]["ratio"] is not None:
        spent = entry["cpu_time"]
        lines.append(f"CPU time {spent['before']:.3g} s -> {spent['after']:.3g} s, {spent['ratio']:.3g} times")
    found = entry["position_difference"]
    if found is not None and found["horizon"] is not None:
        lines.append(
            f"compared up to {found['horizon']:.4g} s: beyond, the motion's own growth leaves nothing to compare"
        )
    return lines


def _cell(value: Any) -> str:
    return "–" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)
