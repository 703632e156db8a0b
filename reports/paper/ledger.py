"""Lines of the ledger: a claim, what was measured, the verdict, and whose fault it is where it does not hold."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from decimal import ROUND_DOWN, Decimal
from typing import Any

KINDS = ("structure", "number", "stability", "simulation")
REPRODUCED, ROUNDS, TRUNCATED = "reproduced", "rounds to the print", "truncated"
FAILS, UNTESTABLE = "does not hold", "not testable"
VERDICTS = (REPRODUCED, ROUNDS, TRUNCATED, FAILS, UNTESTABLE)


@dataclass(frozen=True)
class Check:
    """A test of the measurement itself: it may be trusted where the value is within the limit.

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
        """Whether the value is within the limit; a value that is no number is not."""
        return bool(self.value <= self.limit)


@dataclass(frozen=True)
class Line:
    """One line of the ledger.

    Attributes
    ----------
    section : str
        Of the paper.
    claim : str
        In our own words.
    kind : str
        One of `KINDS`.
    measured : str
        What was found, with its figures.
    verdict : str
        One of `VERDICTS`.
    printed : str or None
        The printed figure.
    value : float or None
        The measured one.
    checks : tuple of Check
        Tests of the measurement: residuals, an independent way to the same figure.
    """

    section: str
    claim: str
    kind: str
    measured: str
    verdict: str
    printed: str | None = None
    value: float | None = None
    checks: tuple[Check, ...] = field(default=())

    @property
    def holds(self) -> bool:
        """Whether the line does not speak against the paper or the measurement."""
        return self.verdict != FAILS

    @property
    def fault(self) -> str | None:
        """Whose a line that does not hold is.

        ``paper`` where the measurement was tested and passed all its tests, else ``ours``.
        """
        if self.holds:
            return None
        return "paper" if self.checks and all(check.passes for check in self.checks) else "ours"

    def as_json(self) -> dict[str, Any]:
        """The line as a JSON object."""
        names = ("section", "claim", "kind", "printed", "measured", "value", "verdict", "holds", "fault")
        # JSON knows no infinity: a measurement that came to nothing has no value.
        checks = [
            {
                "what": check.what,
                "value": float(check.value) if math.isfinite(check.value) else None,
                "limit": float(check.limit),
                "passes": check.passes,
            }
            for check in self.checks
        ]
        return {name: getattr(self, name) for name in names} | {"checks": checks}


def unit(printed: str) -> Decimal:
    """A unit of the last printed digit."""
    return Decimal((0, (1,), int(Decimal(printed).as_tuple().exponent)))


def figure_verdict(value: float, printed: str) -> str:
    """Verdict on a measured figure: it rounds to the print, the print cuts it off, or neither."""
    exact, shown = Decimal(value), Decimal(printed)
    if abs(exact - shown) <= unit(printed) / 2:
        return ROUNDS
    cut = exact.quantize(unit(printed), rounding=ROUND_DOWN)
    return TRUNCATED if cut == shown else FAILS


def figure(
    section: str,
    claim: str,
    printed: str,
    value: float,
    error: float,
    checks: Iterable[Check] = (),
    kind: str = "number",
) -> Line:
    """Line on a printed figure.

    Parameters
    ----------
    section, claim : str
    printed : str
        As printed: its digits count.
    value : float
        Measured.
    error : float
        Its own error; it must be too small to change the verdict.
    checks : iterable of Check
        Further tests of the measurement.
    kind : str

    Returns
    -------
    Line
    """
    margin = abs(abs(Decimal(value) - Decimal(printed)) - unit(printed) / 2)
    tests = (Check("own error, against the distance from the limit of rounding", error, float(margin)), *checks)
    digits = max(3, -int(Decimal(printed).as_tuple().exponent) + 4)
    measured = f"{value:.{digits}f}, own error {error:.1e}"
    return tested(Line(section, claim, kind, measured, figure_verdict(value, printed), printed, value, tests))


def words(
    section: str,
    claim: str,
    holds: bool,
    measured: str,
    checks: Iterable[Check],
    kind: str = "structure",
    printed: str | None = None,
) -> Line:
    """Line on a claim in words, which holds or does not; the checks test the measurement."""
    return tested(Line(section, claim, kind, measured, REPRODUCED if holds else FAILS, printed, None, tuple(checks)))


def count(section: str, claim: str, printed: int, value: int, measured: str, checks: Iterable[Check] = ()) -> Line:
    """Line on a printed count."""
    verdict = REPRODUCED if value == printed else FAILS
    return tested(Line(section, claim, "structure", measured, verdict, str(printed), float(value), tuple(checks)))


def untestable(section: str, claim: str, why: str, kind: str = "structure") -> Line:
    """Line on a claim that nothing here can test."""
    return Line(section, claim, kind, why, UNTESTABLE)


def tested(line: Line, *more: Check) -> Line:
    """The line with more tests: one whose measurement fails a test does not hold, whatever the figures say."""
    checks = (*line.checks, *more)
    passes = line.verdict == UNTESTABLE or all(check.passes for check in checks)
    return replace(line, checks=checks, verdict=line.verdict if passes else FAILS)


def counts(lines: Sequence[Line]) -> dict[str, int]:
    """Number of lines by verdict."""
    return {verdict: sum(line.verdict == verdict for line in lines) for verdict in VERDICTS}


def document(lines: Sequence[Line]) -> dict[str, Any]:
    """The ledger as a JSON document.

    ``holds``: every line does; ``faults``: lines that do not, by whose they are.
    """
    faults = {whose: sum(line.fault == whose for line in lines) for whose in ("paper", "ours")}
    return {
        "lines": [line.as_json() for line in lines],
        "counts": counts(lines),
        "faults": faults,
        "holds": all(line.holds for line in lines),
    }
