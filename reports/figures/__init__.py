"""Figures for print: solution families, the atlas, work-precision, single precision."""

from .atlas import growth_figure, stable_figure
from .eigenvalues import eigenvalue_figure
from .families import family_figure, solution_figure
from .float32 import float32_figure
from .precision import precision_figure
from .solution_curve import make_curves
from .style import FAMILY_COLOURS, GREY, INK, WIDTH, new_figure, use_style, write_figure

__all__ = [
    "FAMILY_COLOURS",
    "GREY",
    "INK",
    "WIDTH",
    "eigenvalue_figure",
    "family_figure",
    "float32_figure",
    "growth_figure",
    "make_curves",
    "new_figure",
    "precision_figure",
    "solution_figure",
    "stable_figure",
    "use_style",
    "write_figure",
]
