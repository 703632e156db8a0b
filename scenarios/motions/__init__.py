"""Documents and files of circular motions, their families and their atlas.

Names are imported when they are first used: one motion needs a third of what families and the atlas need.
"""

from importlib import import_module as _import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .atlas import make_atlas as make_atlas
    from .basin import Basin as Basin
    from .basin import BasinRequest as BasinRequest
    from .basin import find_basin as find_basin
    from .basin import write_basin as write_basin
    from .bifurcations import Bifurcations as Bifurcations
    from .bifurcations import find_bifurcations as find_bifurcations
    from .bifurcations import write_bifurcations as write_bifurcations
    from .circular import CircularSolution as CircularSolution
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
    "solve_circular",
    "write_basin",
    "write_bifurcations",
    "write_families",
]

_HOME = {
    "make_atlas": ".atlas",
    "Basin": ".basin",
    "BasinRequest": ".basin",
    "find_basin": ".basin",
    "write_basin": ".basin",
    "Bifurcations": ".bifurcations",
    "find_bifurcations": ".bifurcations",
    "write_bifurcations": ".bifurcations",
    "CircularSolution": ".circular",
    "solve_circular": ".circular",
}


if not TYPE_CHECKING:  # with __getattr__, type checkers would accept any name

    def __getattr__(name: str) -> object:
        """Import a name of the room when it is first used."""
        if name not in __all__:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        value = getattr(_import_module(_HOME.get(name, ".families"), __name__), name)
        globals()[name] = value
        return value
