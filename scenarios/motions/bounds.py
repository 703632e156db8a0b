"""How far from the circles of stable sections a bicycle may weave and come back, with its part of documents."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ...reference.bifurcations.hopf import examine_end
from ...reference.bifurcations.orbit_branch import OrbitBranch
from ...reference.bifurcations.stable_within import BoundedCircle, bound_section, follow_branch
from ...reference.families import Family
from ...reference.sections import SectionEnd
from ...reference.stability import VARIABLES

_CIRCLES = 9  # examined in a stable section


@dataclass(frozen=True, kw_only=True, eq=False)
class BoundedSection:
    """A stable section of a family, and how far from its circles a bicycle may weave and come back.

    Attributes
    ----------
    numbers : tuple of int
        Of the families on the curve.
    circles : tuple of BoundedCircle
        Along the section.
    why_not : str or None
        Why no circles were examined.
    """

    numbers: tuple[int, ...]
    circles: tuple[BoundedCircle, ...] = ()
    why_not: str | None = None

    def as_json(self) -> dict[str, Any]:
        """Return the circles' part of documents."""
        columns = {name: VARIABLES.index(name) for name in ("rear_rate", "lean", "steer")}
        return {
            **{name: [float(circle.state[k]) for circle in self.circles] for name, k in columns.items()},
            "energy": [circle.energy for circle in self.circles],
            "stable_within": [circle.stable_within for circle in self.circles],
            "no_circles_because": self.why_not,
        }


def bound_stable_section(
    curve: Family, section: tuple[SectionEnd, SectionEnd], branches: Sequence[OrbitBranch], why_none: str
) -> BoundedSection:
    """Find the orbits that bound the circles of a stable section.

    Parameters
    ----------
    curve : Family
    section : tuple of SectionEnd
    branches : sequence of OrbitBranch
        Of orbits that may bound the circles.
    why_none : str
        Why there are no branches, if there are none.

    Returns
    -------
    BoundedSection
    """
    if not branches:
        return BoundedSection(numbers=curve.numbers, why_not=why_none)
    try:
        circles = bound_section(curve, section, branches, _CIRCLES)
    except ValueError as error:
        return BoundedSection(numbers=curve.numbers, why_not=str(error))
    return BoundedSection(numbers=curve.numbers, circles=tuple(circles))


def bound_stable_sections(
    curve: Family, sections: Sequence[tuple[SectionEnd, SectionEnd]]
) -> tuple[BoundedSection, ...]:
    """Find the orbits that bound the stable circles of a curve, on the branches born at the ends of its sections.

    Parameters
    ----------
    curve : Family
    sections : sequence of (SectionEnd, SectionEnd)
        The stable sections of the curve.

    Returns
    -------
    tuple of BoundedSection
    """
    branches, reasons = [], []
    for end in (end for ends in sections for end in ends if end.cause == "hopf"):
        try:
            branches.append(follow_branch(examine_end(curve, end)))
        except ValueError as error:
            reasons.append(str(error))
    why_none = "; ".join(dict.fromkeys(reasons)) or "no end of a stable section is a Hopf point"
    return tuple(bound_stable_section(curve, section, branches, why_none) for section in sections)
