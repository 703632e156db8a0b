"""Lines of the ledger: a claim, what was measured and how, the verdict and the thresholds behind it."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal
from typing import Any

KINDS = ("structure", "number", "stability", "simulation")
REPRODUCED, ROUNDS, TRUNCATED, DEPENDS = "reproduced", "rounds to the print", "truncated", "depends on the cut"
FAILS, UNTESTABLE = "does not hold", "not testable"
VERDICTS = (REPRODUCED, ROUNDS, TRUNCATED, DEPENDS, FAILS, UNTESTABLE)
COMMAND = "velodrome paper"  # command that computes every line again

_RELATIONS: dict[str, Callable[[float, float], bool]] = {
    "<": lambda value, limit: value < limit,
    "<=": lambda value, limit: value <= limit,
    ">": lambda value, limit: value > limit,
    ">=": lambda value, limit: value >= limit,
    "=": lambda value, limit: value == limit,
}


@dataclass(frozen=True)
class SelfCheck:
    """A test of the measurement itself, passed if the value is within the limit.

    Attributes
    ----------
    what : str
    value, limit : float
    """

    what: str
    value: float
    limit: float

    @property
    def passes(self) -> bool:
        """Whether the value is within the limit; nan is not."""
        return bool(self.value <= self.limit)


@dataclass(frozen=True)
class Threshold:
    """A condition on a measured number, on which a verdict depends.

    Attributes
    ----------
    what : str
        The measured number.
    value : float
    relation : str
        ``<``, ``<=``, ``>`` or ``>=``; ``=`` for counts.
    limit : float
    unit : str
    """

    what: str
    value: float
    relation: str
    limit: float
    unit: str = ""

    @property
    def met(self) -> bool:
        """Whether the number meets the condition; nan does not."""
        return bool(_RELATIONS[self.relation](self.value, self.limit))

    @property
    def text(self) -> str:
        """The condition as text."""
        return f"{self.what} {self.relation} {self.limit:.6g} {self.unit}".rstrip()

    def as_json(self) -> dict[str, Any]:
        """Return the condition as a JSON object."""
        numbers = {
            "value": _finite_or_none(self.value),
            "relation": self.relation,
            "limit": _finite_or_none(self.limit),
        }
        return {"what": self.what, **numbers, "unit": self.unit, "met": self.met}


def below(what: str, value: float, limit: float, unit: str = "") -> Threshold:
    """Return the condition that a number is less than a limit."""
    return Threshold(what, float(value), "<", float(limit), unit)


def above(what: str, value: float, limit: float, unit: str = "") -> Threshold:
    """Return the condition that a number is greater than a limit."""
    return Threshold(what, float(value), ">", float(limit), unit)


def equals(what: str, value: int, wanted: int) -> Threshold:
    """Return the condition that a count has a given value."""
    return Threshold(what, float(value), "=", float(wanted))


@dataclass(frozen=True)
class Source:
    """Origin of a measurement.

    Attributes
    ----------
    computed : str
        What was computed.
    functions : tuple of str
        Full names of the functions that compute it.
    command : str or None
        Command that computes it again.
    search : str or None
        How motions were searched for, where the claim is about their number: a search that is not exhaustive
        only shows what it has found.
    """

    computed: str
    functions: tuple[str, ...] = ()
    command: str | None = COMMAND
    search: str | None = None


def source(computed: str, *functions: Callable, command: str = COMMAND, search: str | None = None) -> Source:
    """Return the source of a measurement from the functions that compute it."""
    return Source(computed, tuple(f"{f.__module__}.{f.__qualname__}" for f in functions), command, search)


def _finite_or_none(value: float) -> float | None:
    # JSON has no infinity and no nan: a measurement without a result has no value.
    return float(value) if math.isfinite(value) else None


@dataclass(frozen=True)
class LedgerLine:
    """One line of the ledger.

    Attributes
    ----------
    section : str
        Section of the paper.
    claim : str
        The claim in our words.
    kind : str
        One of `KINDS`.
    measured : str
        What was measured, with numbers.
    verdict : str
        One of `VERDICTS`.
    printed : str or None
        The printed figure.
    value : float or None
        The measured figure.
    source : Source
        What was computed, by which functions and command.
    thresholds : tuple of Threshold
        Conditions behind the verdict. The verdict on a printed figure depends on the first one that is met.
    checks : tuple of SelfCheck
        Tests of the measurement: residuals, an independent way to the same figure.
    """

    section: str
    claim: str
    kind: str
    measured: str
    verdict: str
    source: Source
    thresholds: tuple[Threshold, ...] = ()
    printed: str | None = None
    value: float | None = None
    checks: tuple[SelfCheck, ...] = field(default=())

    @property
    def holds(self) -> bool:
        """Whether the line speaks neither against the paper nor against the measurement."""
        return self.verdict != FAILS

    @property
    def fault(self) -> str | None:
        """Whose fault a line that does not hold is; None for a line that holds.

        ``paper`` if the measurement was tested and passed all its tests, otherwise ``ours``.
        """
        if self.holds:
            return None
        return "paper" if self.checks and all(check.passes for check in self.checks) else "ours"

    @property
    def threshold(self) -> str:
        """The conditions as text; empty where there is nothing to test."""
        return "; ".join(threshold.text for threshold in self.thresholds)

    def as_json(self) -> dict[str, Any]:
        """Return the line as a JSON object."""
        names = ("section", "claim", "kind", "printed", "measured", "value", "verdict", "holds", "fault", "threshold")
        checks = [
            {
                "what": check.what,
                "value": _finite_or_none(check.value),
                "limit": float(check.limit),
                "passes": check.passes,
            }
            for check in self.checks
        ]
        return (
            {name: getattr(self, name) for name in names}
            | {"thresholds": [threshold.as_json() for threshold in self.thresholds]}
            | {name: getattr(self.source, name) for name in ("computed", "command", "search")}
            | {"functions": list(self.source.functions), "checks": checks}
        )


def unit_of(printed: str) -> Decimal:
    """Return one unit of the last printed digit."""
    return Decimal((0, (1,), int(Decimal(printed).as_tuple().exponent)))


def figure_thresholds(value: float, printed: str) -> tuple[Threshold, ...]:
    """Return the conditions on a measured figure: it rounds to the print or else the print truncates it."""
    exact, shown, last = Decimal(value), Decimal(printed), unit_of(printed)
    digits = f"last digit of {printed}"
    distance = float(abs(exact - shown))
    rounds = Threshold(f"distance from the print, to half a unit of the {digits},", distance, "<=", float(last / 2))
    if rounds.met:
        return (rounds,)
    # A truncated figure is further from zero than the print, by less than a unit.
    beyond = float((exact - shown) * (-1 if printed.startswith("-") else 1))
    past = f"distance beyond the print, to a unit of the {digits},"
    return (
        rounds,
        Threshold("distance beyond the print, away from zero,", beyond, ">=", 0.0),
        Threshold(past, beyond, "<", float(last)),
    )


def figure_verdict(thresholds: Sequence[Threshold]) -> str:
    """Return the verdict on a measured figure: it rounds to the print, the print truncates it, or neither."""
    rounds, *cut = thresholds
    if rounds.met:
        return ROUNDS
    return TRUNCATED if all(threshold.met for threshold in cut) else FAILS


def figure_line(
    section: str,
    claim: str,
    printed: str,
    value: float,
    error: float,
    source: Source,
    checks: Iterable[SelfCheck] = (),
    kind: str = "number",
) -> LedgerLine:
    """Make a line on a printed figure.

    Parameters
    ----------
    section, claim : str
    printed : str
        The figure as printed, since its number of digits matters.
    value : float
        Measured figure.
    error : float
        Error of the measurement; it must be too small to change the verdict.
    source : Source
    checks : iterable of SelfCheck
        Further tests of the measurement.
    kind : str

    Returns
    -------
    LedgerLine
    """
    margin = abs(abs(Decimal(value) - Decimal(printed)) - unit_of(printed) / 2)
    tests = (SelfCheck("own error, against the distance from the limit of rounding", error, float(margin)), *checks)
    digits = max(3, -int(Decimal(printed).as_tuple().exponent) + 4)
    thresholds = figure_thresholds(value, printed)
    line = LedgerLine(
        section=section,
        claim=claim,
        kind=kind,
        measured=f"{value:.{digits}f}, own error {error:.1e}",
        verdict=figure_verdict(thresholds),
        source=source,
        thresholds=thresholds,
        printed=printed,
        value=value,
        checks=tests,
    )
    return tested(line)


def claim_line(
    section: str,
    claim: str,
    thresholds: Iterable[Threshold],
    measured: str,
    source: Source,
    checks: Iterable[SelfCheck],
    kind: str = "structure",
    printed: str | None = None,
) -> LedgerLine:
    """Make a line on a claim in words, which holds if every threshold is met; the checks test the measurement."""
    conditions = tuple(thresholds)
    line = LedgerLine(
        section=section,
        claim=claim,
        kind=kind,
        measured=measured,
        verdict=REPRODUCED if conditions and all(each.met for each in conditions) else FAILS,
        source=source,
        thresholds=conditions,
        printed=printed,
        checks=tuple(checks),
    )
    return tested(line)


def count_line(
    section: str, claim: str, printed: int, value: int, measured: str, source: Source, checks: Iterable[SelfCheck] = ()
) -> LedgerLine:
    """Make a line on a printed count."""
    condition = equals("count", value, printed)
    line = LedgerLine(
        section=section,
        claim=claim,
        kind="structure",
        measured=measured,
        verdict=REPRODUCED if condition.met else FAILS,
        source=source,
        thresholds=(condition,),
        printed=str(printed),
        value=float(value),
        checks=tuple(checks),
    )
    return tested(line)


def count_by_cut(
    section: str,
    claim: str,
    printed: int,
    counts: Mapping[str, int],
    measured: str,
    source: Source,
    checks: Iterable[SelfCheck] = (),
) -> LedgerLine:
    """Make a line on a printed count of pieces that can be counted in several ways, with the count under each way."""
    conditions = tuple(equals(cut, value, printed) for cut, value in counts.items())
    met = [condition.met for condition in conditions]
    line = LedgerLine(
        section=section,
        claim=claim,
        kind="structure",
        measured=measured,
        verdict=REPRODUCED if all(met) else DEPENDS if any(met) else FAILS,
        source=source,
        thresholds=conditions,
        printed=str(printed),
        checks=tuple(checks),
    )
    return tested(line)


def untestable_line(section: str, claim: str, why: str, kind: str = "structure") -> LedgerLine:
    """Make a line on a claim that cannot be tested here."""
    nothing = Source("nothing", command=None)
    return LedgerLine(section=section, claim=claim, kind=kind, measured=why, verdict=UNTESTABLE, source=nothing)


def tested(line: LedgerLine, *more: SelfCheck) -> LedgerLine:
    """Add tests to a line; a line whose measurement fails a test does not hold, whatever the figures are."""
    checks = (*line.checks, *more)
    passes = line.verdict == UNTESTABLE or all(check.passes for check in checks)
    return replace(line, checks=checks, verdict=line.verdict if passes else FAILS)


def counts(lines: Sequence[LedgerLine]) -> dict[str, int]:
    """Count the lines by verdict."""
    return {verdict: sum(line.verdict == verdict for line in lines) for verdict in VERDICTS}


def list_surprises(lines: Sequence[LedgerLine], known: Collection[str]) -> list[str]:
    """List what differs from the known result: every line but those of the known discrepancies holds.

    Parameters
    ----------
    lines : sequence of LedgerLine
    known : collection of str
        Claims that are known not to hold by the paper's own fault.

    Returns
    -------
    list of str
        A line of text for each difference.
    """
    found = [
        f"{line.section}: {line.claim}: does not hold, and is no known discrepancy of the paper's"
        for line in lines
        if line.fault == "paper" and line.claim not in known
    ]
    found += [
        f"{line.section}: {line.claim}: the measurement does not pass its own tests"
        for line in lines
        if line.fault == "ours"
    ]
    failing = {line.claim for line in lines if not line.holds}
    return found + [f"{claim}: holds, though known not to" for claim in known if claim not in failing]


def ledger_document(lines: Sequence[LedgerLine], known: Collection[str]) -> dict[str, Any]:
    """Return the ledger as a JSON document.

    ``holds``: whether every line holds; ``faults``: numbers of lines that do not, by whose fault they are;
    ``surprises``: see `list_surprises`.
    """
    faults = {whose: sum(line.fault == whose for line in lines) for whose in ("paper", "ours")}
    return {
        "lines": [line.as_json() for line in lines],
        "counts": counts(lines),
        "faults": faults,
        "surprises": list_surprises(lines, known),
        "holds": all(line.holds for line in lines),
    }
