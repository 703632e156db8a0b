"""Figures for print: solution families, the atlas, eigenvalues, orbits, basins, precision of engines, sweeps."""

from .atlas import growth_figure, stable_figure
from .basin import basin_map_figure, drawn_edges, edge_rides_figure
from .bifurcations import bifurcation_figure, drawn_sections
from .eigenvalues import eigenvalue_figure
from .families import family_figure
from .float32 import float32_figure
from .orbit_tracks import drawn_orbits, orbit_track_figure
from .precision import precision_figure
from .solution_curve import make_curves
from .style import (
    FAMILY_COLOURS,
    GREY,
    INK,
    WIDTH,
    WIDTHS,
    new_figure,
    use_style,
    write_figure,
    write_formats,
)
from .sweep import SweepAxis, SweepRuns, sweep_figure
from .sweep_map import CellGrid, MapRuns, SweepMap, average_cells, make_cells, sweep_map_figure
from .within import list_bounded_regions, within_figure

__all__ = [
    "FAMILY_COLOURS",
    "GREY",
    "INK",
    "WIDTH",
    "WIDTHS",
    "CellGrid",
    "MapRuns",
    "SweepAxis",
    "SweepMap",
    "SweepRuns",
    "average_cells",
    "basin_map_figure",
    "bifurcation_figure",
    "drawn_edges",
    "drawn_orbits",
    "drawn_sections",
    "edge_rides_figure",
    "eigenvalue_figure",
    "family_figure",
    "float32_figure",
    "growth_figure",
    "list_bounded_regions",
    "make_cells",
    "make_curves",
    "new_figure",
    "orbit_track_figure",
    "precision_figure",
    "stable_figure",
    "sweep_figure",
    "sweep_map_figure",
    "use_style",
    "within_figure",
    "write_figure",
    "write_formats",
]
