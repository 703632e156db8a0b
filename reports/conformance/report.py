"""The report of an examination, its checks, and the error that is raised if checks fail."""

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
        The statement that the check tests.
    found : tuple of str
        For a failed check the faults, with a diagnosis where there is one. For a skipped check the reason. For a passed
        check what was observed, and which faults the check could not have detected.
    tolerance : str
        How the limits are derived; empty if nothing may differ.
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
    """All checks of an engine; `str` gives them as a table.

    Attributes
    ----------
    engine, version : str
    settings : dict
        JSON values of the settings that the engine was examined with.
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
        """Return the check with a name; raises KeyError if there is none."""
        for check in self.checks:
            if check.name == name:
                return check
        raise KeyError(name)

    def __str__(self) -> str:
        counts = {kind: sum(check.outcome == kind for check in self.checks) for kind in ("passed", "failed", "skipped")}
        head = f"{self.engine} {self.version}: " + ", ".join(f"{count} {kind}" for kind, count in counts.items())
        return "\n".join([head, *(str(check) for check in self.checks)])


class ConformanceError(AssertionError):
    """Raised if an engine fails checks; the message lists them with their diagnoses.

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
    name: str, claim: str, wrong: Iterable[str], observations: Iterable[str] = (), tolerance: str = ""
) -> ConformanceCheck:
    """Make a check that fails if there are faults in ``wrong``; if there are none, it reports the observations."""
    faults = tuple(wrong)
    return ConformanceCheck(name, "failed" if faults else "passed", claim, faults or tuple(observations), tolerance)


def skip_check(name: str, claim: str, why: str) -> ConformanceCheck:
    """Make a check that was skipped, with the reason."""
    return ConformanceCheck(name, "skipped", claim, (why,))
