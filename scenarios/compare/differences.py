"""Comparison of two stored runs of one scenario, for example of an engine's old version and its new one.

The same engine from the same start repeats its ride up to round-off and to what its iterations leave unconverged. With
the relative error of the state that these allow by a time t (`velodrome.reports.measure.limits.noise`),

    reach(t) = noise(t) x (1 + speed x t / radius)

is the distance that two rides may have, in radii of the circle: a relative error of the rates moves a bicycle by the
same fraction of the distance ridden. All other stored fields have limits of the same form with sizes of their own
(`velodrome.scenarios.compare.fields`). A larger difference has another cause: the engine, its settings, or the
machine's arithmetic.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from functools import partial
from typing import Any

import numpy as np

from ...engines.engine import Trajectory
from ...reference.bicycle import Bicycle
from ...reference.surface import Surface
from ...reports.measure import Scale, evaluate_ride, noise, ride_limits, until_fall
from .fields import FieldDifference, FieldOfOneRun, field_differences
from .metric_changes import MetricChange, compare_metrics
from .positions import PositionDifference, compare_positions
from .reasons import list_reasons

TO_THE_BIT, WITHIN_ROUND_OFF, DIFFERS = "same to the bit", "same within round-off", "differs"


@dataclass(frozen=True)
class StoredRun:
    """Contents of a run folder.

    Attributes
    ----------
    name : str
        Name of the run in texts.
    manifest : mapping
        As in ``manifest.json``.
    metrics : mapping
        By engine, as in ``metrics.json``.
    trajectories : mapping
        By engine; engines without a trajectory are missing.
    """

    name: str
    manifest: Mapping[str, Any]
    metrics: Mapping[str, Mapping[str, Any]]
    trajectories: Mapping[str, Trajectory]


@dataclass(frozen=True)
class StoredGround:
    """Bicycle and surface of both runs, and the sizes of the ride.

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


@dataclass(frozen=True)
class CpuTimes:
    """CPU times of both rides [s] and their ratio, which depend on the machine as much as on the engine."""

    before: float
    after: float
    ratio: float | None


@dataclass(frozen=True)
class EngineDifference:
    """Difference of one engine's rides in both runs.

    Attributes
    ----------
    version : list of str
        Before and after.
    settings : dict
        Changed settings, as [before, after].
    step_noise : float
        Relative error that a step may add beyond its method.
    verdict : str
        One of `TO_THE_BIT`, `WITHIN_ROUND_OFF` and `DIFFERS`.
    reasons : list of str
        Why the rides differ; empty if they are the same.
    position_difference, fields, metrics, cpu_time
        What was compared; empty where a run has no trajectory of the engine.
    """

    version: list[str]
    settings: dict[str, list[Any]]
    step_noise: float
    verdict: str
    reasons: list[str]
    position_difference: PositionDifference | None = None
    fields: Mapping[str, FieldDifference | FieldOfOneRun] = field(default_factory=dict)
    metrics: Mapping[str, MetricChange] = field(default_factory=dict)
    cpu_time: CpuTimes | None = None

    def as_json(self) -> dict[str, Any]:
        """Return the difference as a JSON object."""
        position, cpu_time = self.position_difference, self.cpu_time
        return {
            "version": self.version,
            "settings": self.settings,
            "step_noise": self.step_noise,
            "position_difference": None if position is None else position.as_json(),
            "fields": {name: difference.as_json() for name, difference in self.fields.items()},
            "metrics": {name: change.as_json() for name, change in self.metrics.items()},
            "cpu_time": None if cpu_time is None else asdict(cpu_time),
            "verdict": self.verdict,
            "reasons": self.reasons,
        }


def diff_document(
    before: StoredRun, after: StoredRun, ground: StoredGround, step_noise: Mapping[str, float]
) -> dict[str, Any]:
    """Compare two runs of one scenario from one start.

    Parameters
    ----------
    before, after : StoredRun
        Sampled at the same times.
    ground : StoredGround
    step_noise : mapping
        By engine, the relative error that one of its steps may add beyond its method, see
        `velodrome.engines.engine.Engine.step_noise`.

    Returns
    -------
    dict
        JSON values: the two ``runs``, what ``differs`` between them besides the engines, under ``engines`` an
        `EngineDifference` for each engine of both runs, the engines of one run only, and whether all common engines
        are the ``same``.
    """
    first, second = before.manifest["engines"], after.manifest["engines"]
    common = [name for name in second if name in first]
    engines = {name: _compare_engine(name, before, after, ground, step_noise[name]) for name in common}
    return {
        "scenario": after.manifest["scenario"],
        "title": after.manifest["title"],
        "duration": ground.scale.duration,
        "growth_rate": ground.scale.growth_rate,
        "runs": [_describe_run(before), _describe_run(after)],
        "differs": {
            part: _list_changes(before.manifest[part], after.manifest[part]) for part in ("libraries", "platform")
        },
        "engines": {name: difference.as_json() for name, difference in engines.items()},
        "only_before": [name for name in first if name not in second],
        "only_after": [name for name in second if name not in first],
        "same": all(difference.verdict != DIFFERS for difference in engines.values()),
    }


def _describe_run(run: StoredRun) -> dict[str, Any]:
    return {"name": run.name, "created": run.manifest["created"], "complete": run.manifest["complete"]}


def _list_changes(before: Mapping[str, Any], after: Mapping[str, Any]) -> dict[str, list[Any]]:
    """Return values that differ, as [before, after]; None where a value is missing."""
    names = dict.fromkeys([*before, *after])
    return {name: [before.get(name), after.get(name)] for name in names if before.get(name) != after.get(name)}


def _compare_engine(
    name: str, before: StoredRun, after: StoredRun, ground: StoredGround, step_noise: float
) -> EngineDifference:
    facts = [run.manifest["engines"][name] for run in (before, after)]
    version = [fact["version"] for fact in facts]
    settings = _list_changes(facts[0]["settings"], facts[1]["settings"])
    missing = [run for run in (before, after) if name not in run.trajectories]
    if missing:
        reasons = [f"gave no trajectory in {run.name}: {_describe_failure(run, name)}" for run in missing]
        return EngineDifference(version, settings, step_noise, DIFFERS, reasons)
    rides = (before.trajectories[name], after.trajectories[name])
    upright = [_cut_at_fall(ride, ground) for ride in rides]
    # If only one ride falls, the fall is a difference and not a growth that both have.
    fell = all(len(short.time) < len(ride.time) for short, ride in zip(upright, rides, strict=True))
    # The rate of the ride with the smaller steps, since each ride may have errors.
    rate = max(ride.steps / (float(ride.time[-1]) or ground.scale.duration) for ride in rides)
    allowed, reach = (partial(law, ground.scale, step_noise * rate, fell) for law in (_allowed_noise, _allowed_reach))
    position = compare_positions(upright, ground.scale.radius, reach)
    # Fields are compared as far as positions are: beyond, nothing can be concluded.
    compared = [ride.first(position.samples) for ride in upright]
    differences = field_differences((compared[0], compared[1]), ground.scale, allowed, reach)
    scale = replace(ground.scale, duration=position.compared_until or ground.scale.duration)
    # Metrics depend on the whole ride: they are not judged where only a part of it is compared.
    limits = ride_limits(scale, reach(scale.duration)) if position.horizon is None else {}
    metrics = compare_metrics(before.metrics[name], after.metrics[name], limits)
    reasons = list_reasons(position, differences, metrics, rides)
    same = TO_THE_BIT if _are_identical(*rides) else WITHIN_ROUND_OFF
    return EngineDifference(
        version=version,
        settings=settings,
        step_noise=step_noise,
        verdict=DIFFERS if reasons else same,
        reasons=reasons,
        position_difference=position,
        fields=differences,
        metrics=metrics,
        cpu_time=_compare_cpu_times(*rides),
    )


def _cut_at_fall(ride: Trajectory, ground: StoredGround) -> Trajectory:
    """Return the ride as stored, up to the fall that its coordinates show."""
    evaluated = evaluate_ride(ride, ground.bicycle, ground.surface)
    return ride.first(len(until_fall(evaluated, ground.bicycle, ground.surface).time))


def _compare_cpu_times(before: Trajectory, after: Trajectory) -> CpuTimes:
    ratio = after.cpu_time / before.cpu_time if before.cpu_time > 0 else None
    return CpuTimes(before.cpu_time, after.cpu_time, ratio)


def _describe_failure(run: StoredRun, name: str) -> str:
    return run.manifest["engines"][name].get("failed", "it was interrupted")


def _are_identical(before: Trajectory, after: Trajectory) -> bool:
    """Return whether all arrays of two rides are the same to the bit, and both end for the same reason."""
    pairs = ((getattr(before, entry.name), getattr(after, entry.name)) for entry in fields(Trajectory))
    return before.ended == after.ended and all(
        (a is None) == (b is None) and (a is None or np.array_equal(a, b, equal_nan=True))
        for a, b in pairs
        if isinstance(a, np.ndarray) or isinstance(b, np.ndarray)
    )


def _allowed_noise(scale: Scale, noise_rate: float, fell: bool, time: float) -> float:
    """Return the relative error of the state allowed at a time [s]; steps add ``noise_rate`` to it per second."""
    try:
        return noise(replace(scale, duration=time), noise_rate * time, 1, fell)
    except OverflowError:
        return math.inf


def _allowed_reach(scale: Scale, noise_rate: float, fell: bool, time: float) -> float:
    """Return the distance of two rides allowed at a time [s], in radii."""
    return _allowed_noise(scale, noise_rate, fell, time) * scale.away(time)
