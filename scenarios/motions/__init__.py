"""Documents and files of circular motions, their families and their atlas."""

from .atlas import make_atlas
from .circular import CircularSolution, solve_circular
from .families import (
    MERGING,
    CriticalShapes,
    FamilyCurve,
    SolutionFamilies,
    families_document,
    find_critical_shapes,
    follow_families,
    write_families,
)

__all__ = [
    "MERGING",
    "CircularSolution",
    "CriticalShapes",
    "FamilyCurve",
    "SolutionFamilies",
    "families_document",
    "find_critical_shapes",
    "follow_families",
    "make_atlas",
    "solve_circular",
    "write_families",
]
