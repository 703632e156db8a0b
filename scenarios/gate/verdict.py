"""Judge what engines measure on a gated scenario against their baselines.

A baseline holds what each engine measured against the exact ride; the limits of changes are derived in
`velodrome.reports.measure.limits`. Drift rates are compared with their signs, and a move to smaller values also fails
as long as version and settings are the baseline's: a fault may cancel part of an engine's own error.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

# Quantities of a ride, in the order of the table.
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

# Shown in addition, but not judged: the friction follows from the forces, which are judged; the CPU time, relative to
# the reference's in the same run, depends on the machine.
SHOWN = ("required_friction", "cpu_ratio")

# Why an order may be missing; with another version this counts as an improvement.
BELOW_NOISE = "the errors of its steps cannot be told from what its iterations leave"

CHANGES = "settings"  # quantity under which a change of settings or version is reported
NEW = "new"  # status of an engine that has no baseline yet

# Judged against limits of their own, without the baseline: no engine may contradict itself.
ABSOLUTE = ("report_mismatch",)

# Quantities of which more is better; of all others, less in size is better.
_MORE_IS_BETTER = ("fell_at", "observed_order")
# A change in either direction is neither better nor worse: it means another computation.
_NEITHER = ("steps",)
# Judged only on request: the CPU time of several rides, relative to the reference's.
HELD_CPU = "held_cpu_ratio"
# Quantities whose decrease never fails, because it hides no fault.
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
        opposite, with another version or other settings), ``changed`` (otherwise moved), ``missing``, ``new`` (an
        engine without a baseline yet: nothing is judged, and the gate does not pass) or ``shown`` (not judged).
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
        """Whether the verdict lets the gate pass."""
        return self.status in ("holds", "better", "shown")

    @property
    def moved(self) -> bool:
        """Whether the quantity was judged and does not hold."""
        return self.status not in ("holds", "shown")

    @property
    def told(self) -> bool:
        """Whether to report it in words: whatever moved, and a change of settings or version."""
        return self.moved or self.quantity == CHANGES

    @property
    def share(self) -> float | None:
        """Change of the value relative to its limit; None where there is nothing to compare."""
        if self.value is None or self.baseline is None or not self.limit:
            return None
        return abs(self.value - self.baseline) / self.limit

    def as_json(self) -> dict[str, Any]:
        """Return the fields as JSON values."""
        return asdict(self) | {"passes": self.passes}


# Statuses in words, the worst first.
_STATUS_WORDS = {"missing": "missing", "worse": "worse", "changed": "changed", NEW: "new", "better": "improved"}


def status_word(verdict: Verdict) -> str:
    """Return the word for a verdict's status in a message."""
    return _STATUS_WORDS.get(verdict.status, verdict.status)


def count_statuses(verdicts: Sequence[Verdict], failing: bool = False) -> str:
    """Return how many verdicts have each status other than ``holds`` and ``shown``, the worst first; may be empty.

    Parameters
    ----------
    verdicts : sequence of Verdict
    failing : bool
        Whether to count only those that do not let the gate pass.
    """
    found = Counter(verdict.status for verdict in verdicts if not (failing and verdict.passes))
    return ", ".join(f"{found[status]} {word}" for status, word in _STATUS_WORDS.items() if found[status])


def count_held(verdicts: Sequence[Verdict]) -> str:
    """Return how many of the judged quantities hold, such as ``25 of 36``; empty where none was to be judged."""
    judged = [one for one in verdicts if one.status not in ("shown", NEW) and one.quantity != CHANGES]
    return f"{sum(verdict.status == 'holds' for verdict in judged)} of {len(judged)}" if judged else ""


def find_outcome(verdicts: Sequence[Verdict]) -> str:
    """Return the outcome of the gate: ``holds``, ``fails``, or ``new`` where all that does not pass is new."""
    failing = {verdict.status for verdict in verdicts if not verdict.passes}
    if not failing:
        return "holds"
    return NEW if failing == {NEW} else "fails"


def judge_sample(
    engine: str,
    values: Mapping[str, float | None],
    baseline: Mapping[str, Any] | None,
    allowed: Mapping[str, float | None],
    settings: Mapping[str, Any],
    version: str,
    reasons: Mapping[str, str] | None = None,
    absent: str | None = None,
) -> list[Verdict]:
    """Judge an engine's quantities against its baseline.

    Parameters
    ----------
    engine : str
    values : mapping
        Quantities of this run.
    baseline : mapping or None
        The engine's entry: ``quantities``, ``settings``, ``version``, and where known the date ``created``, or the
        ``release`` that was ridden for it.
    allowed : mapping
        Limits by quantity; None where this run cannot determine the quantity.
    settings, version
        Those of this run, to explain a change.
    reasons : mapping, optional
        Why this run does not give a quantity.
    absent : str, optional
        Why there is no baseline, if one was to be; without it the engine is new.

    Returns
    -------
    list of Verdict
    """
    absolute = [_judge_absolute(engine, name, values, allowed, reasons or {}) for name in ABSOLUTE if name in allowed]
    if baseline is None:
        new = Verdict(engine, "run", None, None, None, NEW, "no baseline yet; velodrome check --update writes one")
        without = new if absent is None else missing_verdict(engine, absent)
        return [without, *(verdict for verdict in absolute if not verdict.passes)]
    changes = _describe_changes(baseline, settings, version)
    stored = _name_baseline(baseline)
    since = f"since {stored}: {changes}" if changes else f"same version and settings as {stored}"
    verdicts = [Verdict(engine, CHANGES, None, None, None, "holds", since)] if changes else []
    verdicts += absolute
    for quantity, limit in allowed.items():
        if quantity in ABSOLUTE:
            continue
        value, before = values.get(quantity), baseline["quantities"].get(quantity)
        if value is None and before is None:
            continue  # the engine does not give this quantity and did not give it before
        if quantity == "fell_at" and (value is None or before is None):
            verdicts.append(_judge_fall(engine, value, before, since, excused=bool(changes)))
            continue
        if value is None or before is None or limit is None:
            why = (reasons or {}).get(quantity, "not given by this run")
            reason = "not in the baseline" if before is None else why
            status = "better" if why == BELOW_NOISE and before is not None and changes else "missing"
            verdicts.append(Verdict(engine, quantity, value, before, limit, status, f"{reason}; {since}"))
            continue
        status = _find_status(quantity, value, before, limit, excused=bool(changes))
        move = f"{before:.6g} -> {value:.6g}, limit {limit:.2g}"
        reason = move if status == "holds" else f"{move}; {since}"
        verdicts.append(Verdict(engine, quantity, value, before, limit, status, reason))
    return verdicts + [
        _show_unjudged(engine, quantity, value, baseline["quantities"].get(quantity))
        for quantity in SHOWN
        if quantity not in allowed and (value := values.get(quantity)) is not None
    ]


def _show_unjudged(engine: str, quantity: str, value: float, before: float | None) -> Verdict:
    """Return the verdict on a quantity that is not judged, which passes."""
    reason = f"{value:.3g}" if before is None else f"{before:.3g} -> {value:.3g}"
    return Verdict(engine, quantity, value, before, None, "shown", f"{reason}, not judged")


def _judge_absolute(
    engine: str,
    quantity: str,
    values: Mapping[str, float | None],
    allowed: Mapping[str, float | None],
    reasons: Mapping[str, str],
) -> Verdict:
    """Return the verdict on a quantity that must lie within its limit of zero, whatever the baseline."""
    value, limit = values.get(quantity), allowed[quantity]
    if value is None or limit is None:
        why = reasons.get(quantity, "not given by this run")
        return Verdict(engine, quantity, value, None, limit, "missing", why)
    status = "holds" if value <= limit else "worse"
    reason = reasons.get(quantity, f"{value:.6g}, limit {limit:.2g}, whatever the baseline")
    return Verdict(engine, quantity, value, None, limit, status, reason)


def _judge_fall(engine: str, value: float | None, before: float | None, since: str, excused: bool) -> Verdict:
    """Return the verdict where the bicycle fell in only one of the two runs."""
    if value is not None:
        return Verdict(engine, "fell_at", value, before, None, "worse", f"falls at {value:.6g} s; {since}")
    return Verdict(
        engine, "fell_at", value, before, None, "better" if excused else "changed", f"does not fall any more; {since}"
    )


def _find_status(quantity: str, value: float, before: float, limit: float, excused: bool) -> str:
    """Return the status of a value; ``excused`` where another version or other settings may have improved it."""
    if abs(value - before) <= limit or (quantity in _NEVER_TOO_SMALL and value < before):
        return "holds"
    if quantity in _NEITHER:
        return "changed"
    # At a finite step an order is a whole number plus the effect of the next power, which another version may change.
    if quantity == "observed_order" and excused and round(value) == round(before):
        return "holds"
    growth = (abs(value) - abs(before)) * (-1 if quantity in _MORE_IS_BETTER else 1)
    # Not "larger than": NaN is no improvement.
    if not growth <= limit:
        return "worse"
    return "better" if excused and growth < -limit else "changed"


def missing_verdict(engine: str, reason: str) -> Verdict:
    """Return the failing verdict on an engine that gives nothing to judge."""
    return Verdict(engine, "run", None, None, None, "missing", reason)


def _name_baseline(baseline: Mapping[str, Any]) -> str:
    if "release" in baseline:
        return baseline["release"]
    return f"the baseline of {baseline['created']}" if "created" in baseline else "the baseline"


def _describe_changes(baseline: Mapping[str, Any], settings: Mapping[str, Any], version: str) -> str:
    """Return the changes of version and settings since the baseline in words; empty where there are none."""
    found = []
    if baseline["version"] != version:
        found.append(f"version {baseline['version']} -> {version}")
    for name in sorted(set(settings) | set(baseline["settings"])):
        before, now = baseline["settings"].get(name), settings.get(name)
        if before != now:
            found.append(f"{name} {before!r} -> {now!r}")
    return ", ".join(found)
