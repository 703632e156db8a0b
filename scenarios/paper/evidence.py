"""Measurements shared by the ledger's lines: families, their samples and special points, each computed once."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from ...reference.bicycle import Bicycle
from ...reference.circular import SIGMA, CircularMotion, Steady
from ...reference.critical import CriticalPoint, reconnections
from ...reference.curve import Samples
from ...reference.families import FAMILIES, Family, find_motions, trace
from ...reference.kernels.newton import LARGEST_RESIDUAL
from ...reference.sections import SectionEnd, sample_family, stable_sections
from ...reference.special import SpecialPoint, special_points
from ...reference.surface import Paraboloid
from .ledger import SelfCheck
from .printed import read_printed
from .search import OTHER_GRID, FoundMotion, find_missing, search_motions

LONGEST_PAPER_STEP = 0.05  # of the arc: 100 to 300 points a family, at least three in every known stable section
OTHER_STEP = 0.03  # of a second tracing, whose points lie elsewhere: the difference shows the error of the first
LARGEST_TOUCHING = 0.4  # largest alpha at which touching points are searched for: two are known below

Thing = TypeVar("Thing")


def families_command_line(*alphas: float) -> str:
    """Return the command that follows the families at some alphas and shows their special points and sections."""
    return " && ".join(f"velodrome families --alpha {alpha:g}" for alpha in alphas)


@dataclass(frozen=True)
class Evidence:
    """Measurements shared by the ledger's lines.

    Attributes
    ----------
    figures : mapping
        The printed figures, see `velodrome.scenarios.paper.printed.read_printed`.
    bicycle : Bicycle
    """

    figures: Mapping[str, Any] = field(default_factory=read_printed)
    bicycle: Bicycle = field(default_factory=Bicycle)
    _known: dict[tuple, Any] = field(default_factory=dict, repr=False)

    def once(self, key: tuple, compute: Callable[[], Thing]) -> Thing:
        """Return the value of a key, computed the first time."""
        if key not in self._known:
            self._known[key] = compute()
        return self._known[key]

    @property
    def cases(self) -> tuple[float, ...]:
        """The paper's five alphas."""
        return tuple(self.figures["cases"])

    def family(self, alpha: float, number: int, longest: float = LONGEST_PAPER_STEP) -> Family:
        """Return a family from end to end."""
        return self.once(
            ("family", number, "alpha", alpha, "step", longest),
            lambda: trace(self.bicycle, Paraboloid(alpha), number, longest),
        )

    def samples(self, alpha: float, number: int) -> Samples:
        """Return the properties of all points of a family."""
        return self.once(("points", number, "alpha", alpha), lambda: sample_family(self.family(alpha, number)))

    def sections(
        self, alpha: float, number: int, longest: float = LONGEST_PAPER_STEP
    ) -> list[tuple[SectionEnd, SectionEnd]]:
        """Return the stable sections of a family."""
        return self.once(
            ("stable sections", number, "alpha", alpha, "step", longest),
            lambda: stable_sections(self.family(alpha, number, longest)),
        )

    def special(self, alpha: float, number: int, name: str, longest: float = LONGEST_PAPER_STEP) -> SpecialPoint | None:
        """Return a special point of a family by its name; None where there is none."""
        points = self.once(
            ("special points", number, "alpha", alpha, "step", longest),
            lambda: special_points(self.family(alpha, number, longest)),
        )
        return next((point for point in points if point.name == name), None)

    def found(self, alpha: float) -> FoundMotion:
        """Return static equilibria, pivoting motions and whole curves, found from a grid of starts."""
        return self.once(("search", "alpha", alpha), lambda: search_motions(Steady(self.bicycle, Paraboloid(alpha))))

    def searched_again(self, *alphas: float) -> SelfCheck:
        """Check that a search from other starts finds the same, so that counts do not depend on the grid."""
        lone = 0
        for alpha in alphas:
            again = self.once(
                ("second search", "alpha", alpha),
                lambda a=alpha: search_motions(Steady(self.bicycle, Paraboloid(a)), OTHER_GRID),
            )
            lone += find_missing(self.found(alpha), again)
        return SelfCheck("motions and curves found by only one of two searches from different starts", float(lone), 0.0)

    def motions(self, alpha: float, number: int, rear_rate: float) -> list[CircularMotion]:
        """Return the motions of a family at a rear rate."""
        return self.once(
            ("motions", number, "alpha", alpha, "rear rate", rear_rate),
            lambda: find_motions(self.bicycle, Paraboloid(alpha), number, rear_rate),
        )

    def touching(self, families: tuple[int, int]) -> CriticalPoint | None:
        """Return the point where two families exchange parts; None where there is none."""
        points = self.once(("touching points",), lambda: reconnections(self.bicycle, largest=LARGEST_TOUCHING))
        return next((point for point in points if point.families == families), None)

    def residual(self, alphas: tuple[float, ...] | None = None) -> SelfCheck:
        """Check the largest residual of the full equations over all points of all families.

        The families are solved from eight reduced equations; the full equations are a different form of them.
        """
        alphas = self.cases if alphas is None else alphas
        worst = max(self._residual(alpha, number) for alpha in alphas for number in FAMILIES)
        return SelfCheck("largest residual of the 21 equations along the families", worst, LARGEST_RESIDUAL)

    def _residual(self, alpha: float, number: int) -> float:
        family = self.family(alpha, number)
        return self.once(
            ("residual", number, "alpha", alpha),
            lambda: max(_relative_residual(family.equations, point.unknowns) for point in family.points),
        )


def _relative_residual(equations: Steady, unknowns: np.ndarray) -> float:
    # Rows are of order one except for heights on large circles and forces at high speeds.
    size = 1 + float(np.abs(unknowns).max()) + abs(float(unknowns[SIGMA]))
    return float(np.abs(equations.residual(unknowns)).max()) / size
