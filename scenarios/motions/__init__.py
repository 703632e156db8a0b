"""Documents and files of circular motions, their families and their atlas.

Names are imported when they are first used: one motion needs a third of what families and the atlas need.
"""

from typing import TYPE_CHECKING

from ...engines.lazy import import_when_used as _import_when_used

if TYPE_CHECKING:
    from .atlas import make_atlas as make_atlas
    from .basin import Basin as Basin
    from .basin import BasinRequest as BasinRequest
    from .basin import find_basin as find_basin
    from .basin import write_basin as write_basin
    from .bifurcations import Bifurcations as Bifurcations
    from .bifurcations import find_bifurcations as find_bifurcations
    from .bifurcations import write_bifurcations as write_bifurcations
    from .circular import NOT_SEARCHED as NOT_SEARCHED
    from .circular import CircularSolution as CircularSolution
    from .circular import search_bound as search_bound
    from .circular import solve_circular as solve_circular
    from .families import MERGING as MERGING
    from .families import CriticalShapes as CriticalShapes
    from .families import FamilyCurve as FamilyCurve
    from .families import SolutionFamilies as SolutionFamilies
    from .families import families_document as families_document
    from .families import find_critical_shapes as find_critical_shapes
    from .families import follow_families as follow_families
    from .families import write_families as write_families

__all__ = [
    "MERGING",
    "NOT_SEARCHED",
    "Basin",
    "BasinRequest",
    "Bifurcations",
    "CircularSolution",
    "CriticalShapes",
    "FamilyCurve",
    "SolutionFamilies",
    "families_document",
    "find_basin",
    "find_bifurcations",
    "find_critical_shapes",
    "follow_families",
    "make_atlas",
    "search_bound",
    "solve_circular",
    "write_basin",
    "write_bifurcations",
    "write_families",
]

if not TYPE_CHECKING:  # with __getattr__, type checkers would accept any name
    __getattr__ = _import_when_used(
        __name__,
        {
            ".atlas": ("make_atlas",),
            ".basin": ("Basin", "BasinRequest", "find_basin", "write_basin"),
            ".bifurcations": ("Bifurcations", "find_bifurcations", "write_bifurcations"),
            ".circular": ("NOT_SEARCHED", "CircularSolution", "search_bound", "solve_circular"),
            ".families": (
                "MERGING",
                "CriticalShapes",
                "FamilyCurve",
                "SolutionFamilies",
                "families_document",
                "find_critical_shapes",
                "follow_families",
                "write_families",
            ),
        },
    )
