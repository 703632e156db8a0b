"""The drift gate: what engines measure on a gated scenario against their baselines, and the verdict.

A baseline holds what each engine measured against the exact ride; what it may move by is derived in
`velodrome.reports.measure.limits`. Drift rates are held with their signs, and a move to smaller values is
no excuse while version and settings are the baseline's: a fault may well cancel part of an engine's own error.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

# Of a ride, in the order shown.
RIDE_QUANTITIES = (
    "short_error",
    "position_error",
    "state_error",
    "radius_drift_rate",
    "phase_drift_rate",
    "rear_rate_drift_rate",
    "energy_drift",
    "max_gap",
    "max_slip",
    "mean_slip",
    "report_mismatch",
    "contact_force_error",
    "settled_force_error",
    "rms_force_error",
    "fell_at",
    "steps",
)

# Shown beside them: the friction follows from the forces, which are judged; the CPU time, relative to the reference's
# in the same run, depends on the machine.
SHOWN = ("required_friction", "cpu_ratio")

# Why an order may not be seen; of another version that is an improvement.
BELOW_NOISE = "the errors of its steps cannot be told from what its iterations leave"

CHANGES = "settings"  # under which other settings or another version are told, whatever they do

# Held against a limit of its own, whatever the baseline says: no engine may contradict itself.
ABSOLUTE = ("report_mismatch",)

# Of these more is better; of all others, less in size.
_MORE_IS_BETTER = ("fell_at", "observed_order")
# Another number of steps is another computation, be it better or worse.
_NEITHER = ("steps",)
# Judged only if asked for: the CPU time of several rides, relative to the reference's.
HELD_CPU = "held_cpu_ratio"
# Less of it hides no fault.
_NEVER_TOO_SMALL = (HELD_CPU,)


@dataclass(frozen=True)
class Verdict:
    """Verdict on one quantity of one engine.

    Attributes
    ----------
    engine, quantity : str
    value, baseline, limit : float or None
        The value holds within baseline +- limit; without a baseline, within the limit of 0.
    status : str
        ``holds``, ``worse`` (an error larger beyond the limit, an earlier fall, a lower order), ``better`` (the
        opposite, with another version or other settings), ``changed`` (otherwise moved), ``missing`` or ``shown``
        (not judged).
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
        return self.status in ("holds", "better", "shown")

    @property
    def moved(self) -> bool:
        """Whether it was judged and does not hold."""
        return self.status not in ("holds", "shown")

    @property
    def told(self) -> bool:
        """Whether a reader is told of it in words: of what moved, and of other settings or another version."""
        return self.moved or self.quantity == CHANGES

    @property
    def share(self) -> float | None:
        """How far the value moved, in limits; None where there is nothing to compare."""
        if self.value is None or self.baseline is None or not self.limit:
            return None
        return abs(self.value - self.baseline) / self.limit

    def as_json(self) -> dict[str, Any]:
        """Fields as JSON values."""
        return asdict(self) | {"passes": self.passes}


def judge_sample(
    engine: str,
    values: Mapping[str, float | None],
    baseline: Mapping[str, Any] | None,
    allowed: Mapping[str, float | None],
    settings: Mapping[str, Any],
    version: str,
    reasons: Mapping[str, str] | None = None,
) -> list[Verdict]:
    """Hold an engine's quantities against its baseline.

    Parameters
    ----------
    engine : str
    values : mapping
        Quantities of this run.
    baseline : mapping or None
        The engine's entry: ``quantities``, ``settings``, ``version``, and where known the date ``created``.
    allowed : mapping
        Limits by quantity; None where this run cannot tell the quantity.
    settings, version
        Of this run, to explain a change.
    reasons : mapping, optional
        Why this run does not give a quantity.

    Returns
    -------
    list of Verdict
    """
    absolute = [_absolute(engine, name, values, allowed, reasons or {}) for name in ABSOLUTE if name in allowed]
    if baseline is None:
        without = missing_verdict(engine, "no baseline; velodrome check --update writes one")
        return [without, *(verdict for verdict in absolute if not verdict.passes)]
    changes = _changes(baseline, settings, version)
    stored = " ".join(["the baseline", *(["of " + baseline["created"]] if "created" in baseline else [])])
    since = f"since {stored}: {changes}" if changes else f"same version and settings as {stored}"
    verdicts = [Verdict(engine, CHANGES, None, None, None, "holds", since)] if changes else []
    verdicts += absolute
    for quantity, limit in allowed.items():
        if quantity in ABSOLUTE:
            continue
        value, before = values.get(quantity), baseline["quantities"].get(quantity)
        if value is None and before is None:
            continue  # the engine cannot give it, and never could
        if quantity == "fell_at" and (value is None or before is None):
            verdicts.append(_fall(engine, value, before, since, excused=bool(changes)))
            continue
        if value is None or before is None or limit is None:
            why = (reasons or {}).get(quantity, "not given by this run")
            reason = "not in the baseline" if before is None else why
            status = "better" if why == BELOW_NOISE and before is not None and changes else "missing"
            verdicts.append(Verdict(engine, quantity, value, before, limit, status, f"{reason}; {since}"))
            continue
        status = _status(quantity, value, before, limit, excused=bool(changes))
        move = f"{before:.6g} -> {value:.6g}, limit {limit:.2g}"
        reason = move if status == "holds" else f"{move}; {since}"
        verdicts.append(Verdict(engine, quantity, value, before, limit, status, reason))
    return verdicts + [
        _shown(engine, quantity, value, baseline["quantities"].get(quantity))
        for quantity in SHOWN
        if quantity not in allowed and (value := values.get(quantity)) is not None
    ]


def _shown(engine: str, quantity: str, value: float, before: float | None) -> Verdict:
    """Verdict on a quantity that is not judged: it passes."""
    reason = f"{value:.3g}" if before is None else f"{before:.3g} -> {value:.3g}"
    return Verdict(engine, quantity, value, before, None, "shown", f"{reason}, not judged")


def _absolute(
    engine: str,
    quantity: str,
    values: Mapping[str, float | None],
    allowed: Mapping[str, float | None],
    reasons: Mapping[str, str],
) -> Verdict:
    """Verdict on a quantity that must be within its limit of zero."""
    value, limit = values.get(quantity), allowed[quantity]
    if value is None or limit is None:
        why = reasons.get(quantity, "not given by this run")
        return Verdict(engine, quantity, value, None, limit, "missing", why)
    status = "holds" if value <= limit else "worse"
    reason = reasons.get(quantity, f"{value:.6g}, limit {limit:.2g}, whatever the baseline")
    return Verdict(engine, quantity, value, None, limit, status, reason)


def _fall(engine: str, value: float | None, before: float | None, since: str, excused: bool) -> Verdict:
    """Verdict where the bicycle fell in one of the two runs only."""
    if value is not None:
        return Verdict(engine, "fell_at", value, before, None, "worse", f"falls at {value:.6g} s; {since}")
    return Verdict(
        engine, "fell_at", value, before, None, "better" if excused else "changed", f"does not fall any more; {since}"
    )


def _status(quantity: str, value: float, before: float, limit: float, excused: bool) -> str:
    """Status of a value; ``excused`` where another version or other settings may have improved it."""
    if abs(value - before) <= limit or (quantity in _NEVER_TOO_SMALL and value < before):
        return "holds"
    if quantity in _NEITHER:
        return "changed"
    # At a finite step an order is a whole number and what the next power adds, which another version may change.
    if quantity == "observed_order" and excused and round(value) == round(before):
        return "holds"
    growth = (abs(value) - abs(before)) * (-1 if quantity in _MORE_IS_BETTER else 1)
    # Not "larger than": a value that is no number is no improvement.
    if not growth <= limit:
        return "worse"
    return "better" if excused and growth < -limit else "changed"


def missing_verdict(engine: str, reason: str) -> Verdict:
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
