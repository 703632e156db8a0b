"""Circular motions, their families and their atlas as documents and files."""

from .atlas import make_atlas
from .circular import CircularSolution, solve_circular
from .families import critical_document, families_document, write_families

__all__ = [
    "CircularSolution",
    "critical_document",
    "families_document",
    "make_atlas",
    "solve_circular",
    "write_families",
]
