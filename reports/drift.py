"""The drift gate: what an engine may lose against its baseline, and the verdict.

A baseline holds what each engine measured on a circular motion, whose exact solution is known. The
same engine with the same settings repeats those values up to round-off and to what its iterations
leave unconverged; anything beyond is a change of the engine. So no percentage is set by hand: with

    noise = (error of the start + relative error a step may add x steps) x exp(max(growth rate, 0) x duration)

the state may differ by ``noise`` relative to the motion's own sizes, and each quantity by its
sensitivity to the state times that.

Drift rates are held with their signs, and a move to smaller values is no excuse while version and
settings are the baseline's: a fault may well cancel part of an engine's own error.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

# A bounded disturbance |e| <= b over a duration T tilts a least-squares line by 3 b / T at the most.
_SLOPE = 3.0

# The start is a root of equations known to round-off, some 1e-13 of their rows, and their condition is
# the inverse of the Jacobian's least singular value, some 1e2.
START_ERROR = 1e-11


@dataclass(frozen=True)
class Scale:
    """Sizes of a gated motion that turn a relative state error into each quantity's.

    Attributes
    ----------
    radius, speed : float
        Of point D [m, m/s].
    rear_rate : float
        Rear-wheel rate [rad/s].
    growth_rate : float
        Of disturbances [1/s].
    duration : float
        Of the gated run [s].
    """

    radius: float
    speed: float
    rear_rate: float
    growth_rate: float
    duration: float


@dataclass(frozen=True)
class Verdict:
    """Verdict on one quantity of one engine.

    Attributes
    ----------
    engine, quantity : str
    value, baseline, limit : float or None
        The value holds within baseline +- limit.
    status : str
        ``holds``, ``worse`` (larger in size beyond the limit), ``better`` (smaller in size beyond it,
        with another version or other settings), ``changed`` (otherwise moved) or ``missing``.
    reason : str
        One line for a reader.
    """

    engine: str
    quantity: str
    value: float | None
    baseline: float | None
    limit: float | None
    status: str
    reason: str

    @property
    def passes(self) -> bool:
        """Whether the gate stays open."""
        return self.status in ("holds", "better")

    def as_json(self) -> dict[str, Any]:
        """Fields as JSON values."""
        return asdict(self) | {"passes": self.passes}


def quantities(measured: Mapping[str, Any], short_error: float) -> dict[str, float | None]:
    """Pick the gated quantities; drifts keep their signs.

    Parameters
    ----------
    measured : mapping
        Metrics of a run against the exact circular motion.
    short_error : float
        Position error at the short horizon [m].
    """
    names = ("radius_drift_rate", "phase_drift_rate", "rear_rate_drift_rate", "energy_drift", "max_slip", "mean_slip")
    return {"short_error": short_error} | {name: measured[name] for name in names}


def limits(scale: Scale, step_noise: float, steps: int) -> dict[str, float]:
    """What round-off, unconverged iterations and the motion's growth allow each quantity to move.

    Parameters
    ----------
    scale : Scale
    step_noise : float
        Relative error that a step may add beyond the method.
    steps : int
        Steps of the run.

    Returns
    -------
    dict
        Limit by quantity, in the quantity's unit.
    """
    noise = (START_ERROR + step_noise * steps) * math.exp(max(scale.growth_rate, 0.0) * scale.duration)
    return {
        "short_error": noise * scale.radius,
        "radius_drift_rate": _SLOPE * noise * scale.radius / scale.duration,
        "phase_drift_rate": _SLOPE * noise / scale.duration,
        "rear_rate_drift_rate": _SLOPE * noise * scale.rear_rate / scale.duration,
        # Energy is quadratic in the speeds.
        "energy_drift": 2 * noise,
        "max_slip": noise * scale.speed,
        "mean_slip": noise * scale.speed,
    }


def judge(
    engine: str,
    values: Mapping[str, float | None],
    baseline: Mapping[str, Any] | None,
    allowed: Mapping[str, float],
    settings: Mapping[str, Any],
    version: str,
) -> list[Verdict]:
    """Hold an engine's quantities against its baseline.

    Parameters
    ----------
    engine : str
    values : mapping
        Quantities of this run.
    baseline : mapping or None
        The engine's entry: ``quantities``, ``settings``, ``version``.
    allowed : mapping
        Limits by quantity.
    settings, version
        Of this run, to explain a change.

    Returns
    -------
    list of Verdict
    """
    if baseline is None:
        return [missing(engine, "no baseline; velodrome check --update writes one")]
    changes = _changes(baseline, settings, version)
    verdicts = []
    for quantity, limit in allowed.items():
        value, before = values.get(quantity), baseline["quantities"].get(quantity)
        if value is None and before is None:
            continue  # the engine cannot give it, and never could
        if value is None or before is None:
            reason = "not given by this run" if value is None else "not in the baseline"
            verdicts.append(Verdict(engine, quantity, value, before, limit, "missing", reason))
            continue
        status = _status(value, before, limit, excused=bool(changes))
        move = f"{before:.6g} -> {value:.6g}, limit {limit:.2g}"
        since = f"since the baseline: {changes}" if changes else "same version and settings as the baseline"
        reason = move if status == "holds" else f"{move}; {since}"
        verdicts.append(Verdict(engine, quantity, value, before, limit, status, reason))
    return verdicts


def _status(value: float, before: float, limit: float, excused: bool) -> str:
    """Status of a value; ``excused`` where another version or other settings may have improved it."""
    if abs(value - before) <= limit:
        return "holds"
    # Not "larger than": a value that is no number is no improvement.
    if not abs(value) <= abs(before) + limit:
        return "worse"
    return "better" if excused and abs(value) < abs(before) - limit else "changed"


def missing(engine: str, reason: str) -> Verdict:
    """Verdict on an engine that gives nothing to judge: it fails."""
    return Verdict(engine, "run", None, None, None, "missing", reason)


def _changes(baseline: Mapping[str, Any], settings: Mapping[str, Any], version: str) -> str:
    """Version and settings that differ from the baseline's, in words; empty where none does."""
    found = []
    if baseline["version"] != version:
        found.append(f"version {baseline['version']} -> {version}")
    for name in sorted(set(settings) | set(baseline["settings"])):
        before, now = baseline["settings"].get(name), settings.get(name)
        if before != now:
            found.append(f"{name} {before!r} -> {now!r}")
    return ", ".join(found)
