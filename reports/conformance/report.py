"""What became of an examination: its checks, and the error that a failed one is."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal

Outcome = Literal["passed", "failed", "skipped"]

_WIDTH = 118


@dataclass(frozen=True)
class ConformanceCheck:
    """One check of an engine.

    Attributes
    ----------
    name : str
    outcome : {"passed", "failed", "skipped"}
    claim : str
        What must hold.
    found : tuple of str
        Of a failed check what is wrong, with a diagnosis where there is one; of a skipped one why; of a passed one
        what was seen, and what the check could not have told.
    tolerance : str
        What its limits follow from; empty where nothing may differ.
    """

    name: str
    outcome: Outcome
    claim: str
    found: tuple[str, ...] = ()
    tolerance: str = ""

    def __str__(self) -> str:
        lines = [f"{self.outcome:>7}  {self.name}: {self.claim}"]
        lines += [f"         - {line}" for line in self.found]
        if self.tolerance and self.outcome == "failed":
            lines.append(f"         limit: {self.tolerance}")
        return "\n".join(textwrap.fill(line, _WIDTH, subsequent_indent=11 * " ") for line in lines)


@dataclass(frozen=True)
class ConformanceReport:
    """All checks of an engine; printed, it is a table of them.

    Attributes
    ----------
    engine, version : str
    settings : dict
        With which it was examined, JSON values.
    checks : tuple of ConformanceCheck
    """

    engine: str
    version: str
    settings: dict[str, Any]
    checks: tuple[ConformanceCheck, ...]

    @property
    def failed(self) -> tuple[ConformanceCheck, ...]:
        """The checks that failed."""
        return tuple(check for check in self.checks if check.outcome == "failed")

    @property
    def passed(self) -> bool:
        """Whether no check failed."""
        return not self.failed

    def __getitem__(self, name: str) -> ConformanceCheck:
        """Return the check of a name."""
        for check in self.checks:
            if check.name == name:
                return check
        raise KeyError(name)

    def __str__(self) -> str:
        counts = {kind: sum(check.outcome == kind for check in self.checks) for kind in ("passed", "failed", "skipped")}
        head = f"{self.engine} {self.version}: " + ", ".join(f"{count} {kind}" for kind, count in counts.items())
        return "\n".join([head, *(str(check) for check in self.checks)])


class ConformanceError(AssertionError):
    """An engine does not conform: all checks that failed, with their diagnoses.

    Attributes
    ----------
    report : ConformanceReport
    """

    def __init__(self, report: ConformanceReport) -> None:
        count = len(report.failed)
        head = f"engine {report.engine!r} fails {count} of {len(report.checks)} checks"
        super().__init__("\n".join([head, *(str(check) for check in report.failed)]))
        self.report = report


def make_check(
    name: str, claim: str, wrong: Iterable[str], seen: Iterable[str] = (), tolerance: str = ""
) -> ConformanceCheck:
    """Make a check that fails if anything is ``wrong``, and else says what was ``seen``."""
    faults = tuple(wrong)
    return ConformanceCheck(name, "failed" if faults else "passed", claim, faults or tuple(seen), tolerance)


def skip_check(name: str, claim: str, why: str) -> ConformanceCheck:
    """Make a check that was not done."""
    return ConformanceCheck(name, "skipped", claim, (why,))
